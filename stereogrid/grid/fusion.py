"""How one observation becomes evidence for cells: the rules that a map can be made by."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_floats, as_pose, inverse
from ..observation import Disparity
from ..sensor_model import SensorModel, kernel_parameters, widened_sigma_px
from .blocks import BLOCK, CELLS
from .cells import LARGEST_EVIDENCE, NOTHING, ONE, to_evidence
from .judgement import judgement
from .literal import sum_rays
from .pyramid import LEAST_CERTAINTY, Pyramid
from .sweep import FREE, JUDGED, level_of, sweep_blocks
from .view import blocks_in_view

FARTHEST_CELLS = 1e9
"""A pose farther from the origin is a mistake, not a place."""
PARTS_A_THREAD = 4
"""More parts than threads: some blocks take longer than others."""


@dataclass(frozen=True)
class View:
    """One observation as it is to be fused: checked when it is made. eps_m: of Eq. 13 [m]; weight: see integrate."""

    camera: StereoCamera
    disparity: Disparity
    T_world_cam: ArrayLike
    cell_m: float
    model: SensorModel
    eps_m: float = 0.0
    weight: float = 1.0

    def __post_init__(self) -> None:
        pose = as_pose(self.T_world_cam, "T_world_cam")
        farthest_m = float(np.abs(pose[:3, 3]).max())
        if farthest_m > FARTHEST_CELLS * self.cell_m:
            raise InvalidInputError(f"T_world_cam is {farthest_m:.3g} m from the origin: too far to map")
        if self.disparity.disparity_px.shape != self.camera.shape:
            raise InvalidInputError(
                f"the disparity is {self.disparity.disparity_px.shape}, the camera {self.camera.shape}"
            )
        if min(self.camera.shape) < 2:
            raise InvalidInputError(f"an image of {self.camera.shape} is too small to map: expected 2 x 2 px or more")
        if not (np.isfinite(self.eps_m) and self.eps_m >= 0):
            raise InvalidInputError(f"motion_sigma_m must be >= 0 and finite, not {self.eps_m}")
        if not 0 < self.weight <= 1:
            raise InvalidInputError(f"weight must be above 0 and at most 1, not {self.weight}")
        object.__setattr__(self, "T_world_cam", pose)

    @property
    def pose(self) -> FloatArray:
        """T_world_cam (4, 4)."""
        return as_floats(self.T_world_cam)

    def blocks(self) -> Array:
        """Indices (B, 3) of the blocks that it may say something of."""
        return blocks_in_view(self.camera, self.pose, self.cell_m, max_range_m=self.model.max_range_m)


@dataclass(frozen=True)
class Learnt:
    """What an observation says: evidence (B, 512) int16 for the cells of blocks (B, 3) where judged (B,) bool, and
    free_evidence (B,) int16 for all the cells of a block where free (B,) bool; nothing elsewhere.
    """

    blocks: Array
    judged: Array
    evidence: Array
    free: Array
    free_evidence: Array


Fusion = Callable[[View, int], Learnt]


def sweep(view: View, threads: int) -> Learnt:
    """One update a cell, from the reading of its whole footprint. The result does not depend on the threads."""
    c, model = view.camera, view.model
    # No cell in view is farther than the range, or sees a finer level than there.
    finest = level_of(c.focal_px * view.cell_m / (model.max_range_m + BLOCK * view.cell_m))
    pyramid = Pyramid.of(c, view.disparity, model, motion_sigma_m=view.eps_m, finest=finest)
    blocks = view.blocks()
    kinds, free_evidence = np.empty(len(blocks), np.int8), np.empty(len(blocks), np.int16)
    evidence = np.empty((len(blocks), CELLS), np.int16)
    optics = c.focal_px, c.cx_px, c.cy_px, c.focal_baseline_px_m, float(c.width_px), float(c.height_px)
    pose = np.ascontiguousarray(inverse(view.pose)[:3])
    where = (pose, *map(float, optics), view.cell_m, float(model.max_range_m))
    nodes = pyramid.nodes.view(np.uint64)[:, 0]
    pairs = pyramid.windows.view(np.uint64)[:, 0]
    levels = (nodes, pairs, pyramid.windows, pyramid.layout)
    judge = judgement(model, looks_per_px=view.disparity.correlation_px**-2.0, weight=view.weight)
    out = (kinds, free_evidence, evidence)
    in_parts(len(blocks), threads, lambda part: sweep_blocks(blocks, part, where, levels, judge, out))
    return Learnt(blocks, kinds == JUDGED, evidence, kinds == FREE, free_evidence)


def sum_of_rays(view: View, threads: int) -> Learnt:  # noqa: ARG001
    """The paper read literally: each ray updates each cell on its way, and all of them add up. On one thread."""
    c, d, blocks = view.camera, view.disparity.disparity_px, view.blocks()
    sigma_px = widened_sigma_px(c, d, view.disparity.sigma_px, motion_sigma_m=view.eps_m, motion=view.model.motion)
    certainty = d / sigma_px
    certainty[~(certainty >= LEAST_CERTAINTY)] = np.nan
    image = np.stack([np.where(np.isnan(certainty), np.nan, d), certainty], axis=-1).astype(np.float32)
    origin = blocks.min(axis=0)
    lookup = np.full(blocks.max(axis=0) - origin + 1, -1, dtype=np.int64)
    lookup[tuple((blocks - origin).T)] = np.arange(len(blocks))
    optics = (c.focal_px, c.cx_px, c.cy_px, c.focal_baseline_px_m, view.cell_m, view.model.max_range_m)
    gain = np.full((len(blocks), BLOCK, BLOCK, BLOCK), np.nan, dtype=np.float32)
    sum_rays(lookup, origin, view.pose, np.array(optics), image, kernel_parameters(view.model), gain)
    # Cut off before it is weighed, or frames from one place would add what was cut off of the first.
    most = np.float32(LARGEST_EVIDENCE / ONE)
    evidence = to_evidence(np.clip(gain, -most, most) * np.float32(view.weight)).reshape(-1, CELLS)
    judged, free = (evidence != NOTHING).any(axis=1), np.zeros(len(blocks), np.bool_)
    return Learnt(blocks, judged, evidence, free, np.zeros(len(blocks), np.int16))


FUSIONS: dict[str, Fusion] = {"cell": sweep, "sum_of_rays": sum_of_rays}
"""cell: one update a cell an observation. sum_of_rays: the paper read literally, every ray adds."""


def in_parts(count: int, threads: int, work: Callable[[tuple[int, int]], object]) -> None:
    """Call work((first, past)) for parts of range(count), on so many threads; what it raises is raised."""
    if threads == 1 or count < 2 * threads:
        work((0, count))
        return
    for _ in _pool(threads).map(work, _parts(count, threads * PARTS_A_THREAD)):
        pass


def _parts(count: int, parts: int) -> Sequence[tuple[int, int]]:
    ends = np.linspace(0, count, parts + 1).astype(int).tolist()
    return list(pairwise(ends))


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="stereogrid")


def default_threads() -> int:
    """The processors that this process may use, 4 at most: more are busy with their own overhead."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(available, 4)
