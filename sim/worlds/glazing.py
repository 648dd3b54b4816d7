"""Glass in frames: panes as thin closed boxes, in the frame of the wall that they stand in."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..scene.solids import Vector

PROFILE_M = 0.05
"""Width of a frame's profile."""
PANE_M = 0.01


@dataclass(frozen=True)
class Part:
    """A box of the frame or a pane, between two corners [m], and its texture's name."""

    name: str
    low_m: Vector
    high_m: Vector
    texture: str


def frame_and_panes(low_m: Vector, high_m: Vector, panes: int = 1) -> Iterator[Part]:
    """A frame that fills the opening between two corners, x along it and z up, and `panes` equal panes in it.

    Its profiles reach 5 mm into the masonry around, and the panes as far into the profiles: no faces coincide.
    """
    (x0, y0, z0), (x1, y1, z1) = low_m, high_m
    tuck = 0.005
    yield Part("foot", (x0 - tuck, y0, z0 - tuck), (x1 + tuck, y1, z0 + PROFILE_M), "frame")
    yield Part("head", (x0 - tuck, y0, z1 - PROFILE_M), (x1 + tuck, y1, z1 + tuck), "frame")
    half = PROFILE_M / 2
    posts = np.linspace(x0 + half, x1 - half, panes + 1)
    for k, x in enumerate(float(p) for p in posts):
        # The posts stand back by a millimetre from the faces of head and foot.
        low = (x - half - 0.8 * tuck * (k == 0), y0 + 0.001, z0 + 0.02)
        yield Part(f"post {k}", low, (x + half + 0.8 * tuck * (k == panes), y1 - 0.001, z1 - 0.02), "frame")
    middle = (y0 + y1) / 2
    for k, (a, b) in enumerate(pairwise(float(p) for p in posts)):
        left, right = a + half - tuck, b - half + tuck
        foot, head = z0 + PROFILE_M - tuck, z1 - PROFILE_M + tuck
        yield Part(f"pane {k}", (left, middle - PANE_M / 2, foot), (right, middle + PANE_M / 2, head), "glass")
