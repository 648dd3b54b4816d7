"""What the presets do to a matcher: each finds less than the one before, and errs more."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("embreex")

from sim.faults import PRESETS, FaultyPair
from sim.rig import MINORU, StereoRig
from stereogrid.geometry import from_yaw
from stereogrid.matching import matcher

if TYPE_CHECKING:
    from sim.rendering.render import Renderer


def test_block_matching_finds_less_and_less_of_the_corridor_and_errs_more(renderer: "Renderer") -> None:
    rig = StereoRig()
    view, right = rig.look(renderer, from_yaw(0.0, (4.0, 0.0, 0.0)))
    truth_px = MINORU.disparity_px(view.depth_m)
    density, bad_1 = [], []
    for name in ("ideal", "mild", "minoru", "bad"):
        pair = FaultyPair(MINORU, PRESETS[name].still, seed=1).taken((view.gray, right), 0)
        found_px = matcher("bm", num_disparities=80).match(*pair).disparity_px
        matched = np.isfinite(found_px) & np.isfinite(truth_px)
        density.append(matched.mean())
        bad_1.append((np.abs(found_px - truth_px)[matched] > 1).mean())
    assert density == sorted(density, reverse=True) and bad_1 == sorted(bad_1)
    # Real pairs are between .14 (a bare room) and .88 (Middlebury): a rig that sees nothing is no test.
    assert 0.7 < density[1] < density[0] - 0.03 and 0.2 < density[2] < 0.6 and 0.05 < density[3] < 0.3
    assert bad_1[0] < 0.01 and bad_1[3] > 0.03
