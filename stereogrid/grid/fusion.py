"""How one observation becomes evidence for cells: the rules that a map can be made by."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..camera import StereoCamera
from ..errors import InvalidInputError, unknown_name
from ..geometry import Array, FloatArray, as_covariance, as_floats, as_pose, inverse
from ..observation import Disparity
from ..sensor_model import MOTION_RULES, SensorModel, kernel_parameters, widened_sigma_px
from .blocks import BLOCK, CELLS
from .cells import LARGEST_EVIDENCE, NOTHING, ONE, to_evidence
from .judgement import judgement
from .literal import sum_rays
from .marginal import EXPONENTIALS, average
from .pose_nodes import PoseNodes, pose_nodes
from .pyramid import LEAST_CERTAINTY, Pyramid, eps_of_nodes, layout_of
from .sweep import FREE, JUDGED, SKIPPED, level_of, sweep_blocks
from .view import blocks_in_views

FARTHEST_CELLS = 1e9
"""A pose farther from the origin is a mistake, not a place."""
PARTS_A_THREAD = 4
"""More parts than threads: some blocks take longer than others."""


@dataclass(frozen=True)
class View:
    """One observation as it is to be fused: checked when it is made.

    eps_m: of Eq. 13 [m]; motion_rule, pose_covariance, weight: see OccupancyGrid.integrate.
    """

    camera: StereoCamera
    disparity: Disparity
    T_world_cam: ArrayLike
    cell_m: float
    model: SensorModel
    eps_m: float = 0.0
    motion_rule: str = "rss"
    pose_covariance: ArrayLike | None = None
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
        if self.motion_rule not in MOTION_RULES:
            raise unknown_name("motion rule", self.motion_rule, MOTION_RULES)
        if not 0 < self.weight <= 1:
            raise InvalidInputError(f"weight must be above 0 and at most 1, not {self.weight}")
        object.__setattr__(self, "T_world_cam", pose)
        if self.pose_covariance is not None:
            covariance = as_covariance(self.pose_covariance, 6, "pose_covariance")
            sigma_m = float(np.sqrt(max(covariance.diagonal()[:3].max(), 0.0)))
            if sigma_m > FARTHEST_CELLS * self.cell_m:
                raise InvalidInputError(f"pose_covariance lets the camera err by {sigma_m:.3g} m: too far to map")
            object.__setattr__(self, "pose_covariance", covariance)

    @property
    def pose(self) -> FloatArray:
        """T_world_cam (4, 4)."""
        return as_floats(self.T_world_cam)

    @cached_property
    def nodes(self) -> PoseNodes:
        """The poses that the camera may have had: just the one that it claims, where that is exact."""
        if self.pose_covariance is None:
            return PoseNodes(self.pose[None], np.ones(1), np.zeros((3, 3)))
        half_way_m = 0.5 * self.model.max_range_m
        covariance = as_floats(self.pose_covariance)
        return pose_nodes(self.pose, covariance, reference_m=half_way_m, cell_m=self.cell_m)

    @property
    def left_m2(self) -> FloatArray | None:
        """What the nodes leave of the position's covariance (3, 3) [m^2], along the axes of cam; None: 0."""
        return self.nodes.left_m2 if self.nodes.left_m2.any() else None

    @property
    def pose_weight(self) -> float:
        """The weight by which each of the nodes is judged: the mean over several is weighed as a whole."""
        return self.weight if len(self.nodes) == 1 else 1.0

    def blocks(self) -> Array:
        """Indices (B, 3) of the blocks that it may say something of."""
        return blocks_in_views(self.camera, self.nodes.poses, self.cell_m, max_range_m=self.model.max_range_m)


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


@dataclass(frozen=True)
class Stack:
    """What an observation says by each of the K poses of its view, as the sweep writes it.

    kinds (K, B) int8, free_evidence (K, B) int16, evidence (K, B, 512) int16 of the blocks (B, 3).
    """

    blocks: Array
    kinds: Array
    free_evidence: Array
    evidence: Array

    @classmethod
    def empty(cls, view: View) -> "Stack":
        """Room for what a view will say."""
        blocks = view.blocks()
        shape = len(view.nodes), len(blocks)
        return cls(blocks, np.empty(shape, np.int8), np.empty(shape, np.int16), np.empty((*shape, CELLS), np.int16))

    def of_pose(self, k: int) -> tuple[Array, Array, Array]:
        """Kinds (B,), free evidence (B,) and evidence (B, 512) of one pose."""
        return self.kinds[k], self.free_evidence[k], self.evidence[k]

    def average(self, part: tuple[int, int], view: View) -> None:
        """Give the first pose the mean over all of them, in blocks part[0] to part[1]; nothing to do for one pose."""
        if len(view.nodes) > 1:
            weights = view.nodes.weights.astype(np.float32)
            average(part, weights, view.weight, (self.kinds, self.free_evidence, self.evidence), EXPONENTIALS)

    @property
    def learnt(self) -> Learnt:
        """What the first pose says: that of all, once averaged."""
        kinds, free_evidence, evidence = self.of_pose(0)
        return Learnt(self.blocks, kinds == JUDGED, evidence, kinds == FREE, free_evidence)


Fusion = Callable[[View, int], Learnt]


def sweep(view: View, threads: int) -> Learnt:
    """One update a cell, from the reading of its whole footprint. The result does not depend on the threads."""
    c, model = view.camera, view.model
    # No cell in view is farther than the range, or sees a finer level than there.
    finest = level_of(c.focal_px * view.cell_m / (model.max_range_m + BLOCK * view.cell_m))
    pyramid = Pyramid.of(
        c,
        view.disparity,
        model,
        motion_sigma_m=view.eps_m,
        motion_rule=view.motion_rule,
        left_m2=view.left_m2,
        finest=finest,
    )
    stack = Stack.empty(view)
    optics = c.focal_px, c.cx_px, c.cy_px, c.focal_baseline_px_m, float(c.width_px), float(c.height_px)
    poses = [np.ascontiguousarray(inverse(pose)[:3]) for pose in view.nodes.poses]
    where = (*map(float, optics), view.cell_m, float(model.max_range_m))
    nodes = pyramid.nodes.view(np.uint64)[:, 0]
    pairs = pyramid.windows.view(np.uint64)[:, 0]
    levels = (nodes, pairs, pyramid.windows, pyramid.layout)
    judge = judgement(model, looks_per_px=view.disparity.correlation_px**-2.0, weight=view.pose_weight)

    def work(part: tuple[int, int]) -> None:
        for k, pose in enumerate(poses):
            sweep_blocks(stack.blocks, part, (pose, *where), levels, judge, stack.of_pose(k))
        stack.average(part, view)

    in_parts(len(stack.blocks), threads, work)
    return stack.learnt


def sum_of_rays(view: View, threads: int) -> Learnt:  # noqa: ARG001
    """The paper read literally: each ray updates each cell on its way, and all of them add up. On one thread."""
    c, stack = view.camera, Stack.empty(view)
    origin = stack.blocks.min(axis=0)
    lookup = np.full(stack.blocks.max(axis=0) - origin + 1, -1, dtype=np.int64)
    lookup[tuple((stack.blocks - origin).T)] = np.arange(len(stack.blocks))
    optics = (c.focal_px, c.cx_px, c.cy_px, c.focal_baseline_px_m, view.cell_m, view.model.max_range_m)
    image, parameters = _rays(view), kernel_parameters(view.model)
    # Cut off before it is weighed, or frames from one place would add what was cut off of the first.
    most = np.float32(LARGEST_EVIDENCE / ONE)
    for k, pose in enumerate(view.nodes.poses):
        gain = np.full((len(stack.blocks), BLOCK, BLOCK, BLOCK), np.nan, dtype=np.float32)
        sum_rays(lookup, origin, pose, np.array(optics), image, parameters, gain)
        told = to_evidence(np.clip(gain, -most, most) * np.float32(view.pose_weight)).reshape(-1, CELLS)
        stack.evidence[k], stack.kinds[k] = told, np.where((told != NOTHING).any(axis=1), JUDGED, SKIPPED)
    stack.average((0, len(stack.blocks)), view)
    return stack.learnt


def _rays(view: View) -> Array:
    """The pixels (H, W, 2) float32 as rays take them: d and d / dd, dd widened by eps; NaN = nothing is known."""
    c, d = view.camera, view.disparity.disparity_px
    eps_m: float | FloatArray = view.eps_m
    if view.left_m2 is not None:
        eps_m = eps_of_nodes(c, layout_of(c.shape)[:1], view.eps_m, view.left_m2).reshape(c.shape)
    sigma_px = widened_sigma_px(c, d, view.disparity.sigma_px, motion_sigma_m=eps_m, motion_rule=view.motion_rule)
    certainty = d / sigma_px
    certainty[~(certainty >= LEAST_CERTAINTY)] = np.nan
    return np.stack([np.where(np.isnan(certainty), np.nan, d), certainty], axis=-1).astype(np.float32)


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
