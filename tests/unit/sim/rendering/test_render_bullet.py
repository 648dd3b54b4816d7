"""PyBullet's own picture is a quick look: about right, and taken through the same door."""

import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("pybullet")

from open_air import open_air

from sim.rendering.renderers import RENDERERS, make_renderer
from sim.rig import MINORU, StereoRig
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_yaw


def test_the_quick_look_sees_the_same_world_roughly() -> None:
    world = open_air(60)
    T = from_yaw(0.4, [-3.0, -3.0, 0.6]) @ StereoRig().T_base_cam
    pictures = {name: make_renderer(name, world).view(MINORU, T, time_s=1.0) for name in RENDERERS}
    quick, true = pictures["bullet"], pictures["raster"]
    assert (np.isnan(quick.depth_m) == np.isnan(true.depth_m)).mean() > 0.99
    off = np.abs(quick.depth_m / true.depth_m - 1)
    assert np.nanmedian(off) < 0.005 and np.nanquantile(off, 0.9) < 0.03


def test_the_quick_look_shows_what_moves_where_it_is() -> None:
    renderer = make_renderer("bullet", open_air(5))
    T = StereoRig().T_base_cam
    first, second, again = (renderer.view(MINORU, T, time_s=t) for t in (0.5, 2.5, 0.5))
    assert (np.abs(first.depth_m - second.depth_m) > 1).mean() > 0.02
    np.testing.assert_array_equal(first.gray, again.gray)


def test_a_rig_may_look_through_it() -> None:
    left, right = StereoRig().look(make_renderer("bullet", open_air(5)), np.eye(4))
    assert left.gray.shape == right.shape == MINORU.shape
    assert (left.gray != right).any()


def test_an_unknown_renderer_is_told_from_the_known() -> None:
    with pytest.raises(InvalidInputError, match="no renderer named 'blender'; choose from: bullet, raster"):
        make_renderer("blender", open_air(5))
