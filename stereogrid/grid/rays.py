"""What rays meet in the map: the first hit of each, and the depth image that a camera would see."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_floats, as_pose
from .blocks import BlockStore
from .states import Judge, State
from .walk import Rays, walk_rays

FARTHEST_CELLS = 1e9
"""A ray that starts or ends farther from the origin is a mistake."""
PARALLEL = 1e-100
"""A component of a direction that never takes a ray across a cell, and whose reciprocal might overflow."""
RAYS_PER_JOB = 4096
"""Enough to be worth a thread's while."""


@dataclass(frozen=True)
class RayHits:
    """Where N rays ended: end_m (N,) [m] from their origins, in cell (N, 3) int64, whose state (N,) int8 says why.

    OCCUPIED: the ray enters that cell there (0 m if it starts in it). UNKNOWN: an unknown cell stopped it, or it
    reached its largest range in one. FREE: it reached its largest range.
    """

    end_m: FloatArray
    cell: Array
    state: Array

    @cached_property
    def range_m(self) -> FloatArray:
        """Range (N,) to the first occupied cell [m]; infinite where none was hit."""
        return np.where(self.state == State.OCCUPIED, self.end_m, np.inf)


def cast(
    blocks: BlockStore,
    rays: Rays,
    max_range: float,
    *,
    judge: Judge,
    unknown_stops: bool,
) -> tuple[Array, Array, Array]:
    """End (N,) float64, cell (N, 3) int64 and state (N,) int8 of rays, all in cells.

    Chunks of rays go to as many threads as there are processors; the answer does not depend on how many.
    """
    n = len(rays[0])
    out = np.empty(n), np.empty((n, 3), dtype=np.int64), np.empty(n, dtype=np.int8)
    table, span = (*blocks.table(), np.zeros(len(blocks), dtype=np.int8)), blocks.span()

    def job(start: int) -> None:
        part = slice(start, start + RAYS_PER_JOB)
        some = rays[0][part], rays[1][part], rays[2][part]
        walk_rays(some, max_range, unknown_stops, table, span, judge, (out[0][part], out[1][part], out[2][part]))

    starts = range(0, n, RAYS_PER_JOB)
    if len(starts) < 2:
        for start in starts:
            job(start)
        return out
    with ThreadPoolExecutor(min(os.cpu_count() or 1, len(starts))) as pool:
        list(pool.map(job, starts))
    return out


def first_hits(
    blocks: BlockStore,
    cell_m: float,
    rays_m: tuple[ArrayLike, ArrayLike],
    max_range_m: float,
    *,
    judge: Judge,
    unknown_stops: bool,
) -> RayHits:
    """Follow rays (origins (N, 3) or (3,), directions (N, 3) of any length) in world up to max_range_m [m]."""
    rays, longest = _checked(*rays_m, max_range_m, cell_m=cell_m)
    end, cell, state = cast(blocks, rays, longest, judge=judge, unknown_stops=unknown_stops)
    # Not end * cell_m: the largest range comes back as it was given.
    return RayHits(np.where(end == longest, max_range_m, end * cell_m), cell, state)


def depth_image(
    blocks: BlockStore,
    cell_m: float,
    view: tuple[StereoCamera, ArrayLike],
    max_range_m: float,
    *,
    judge: Judge,
    unknown_stops: bool,
) -> Array:
    """Depth z (H, W) float32 [m] of the occupied cells that the left camera sees from view = camera, T_world_cam."""
    camera, T_world_cam = view[0], as_pose(view[1], "T_world_cam")
    toward_cam = camera.ray_directions.reshape(-1, 3)
    directions = toward_cam @ T_world_cam[:3, :3].T
    hits = first_hits(
        blocks, cell_m, (T_world_cam[:3, 3], directions), max_range_m, judge=judge, unknown_stops=unknown_stops
    )
    depth_m = hits.end_m / np.linalg.norm(toward_cam, axis=1)
    return np.where(hits.state == State.OCCUPIED, depth_m, np.nan).astype(np.float32).reshape(camera.shape)


def _checked(origins_m: ArrayLike, directions: ArrayLike, max_range_m: float, *, cell_m: float) -> tuple[Rays, float]:
    """The rays (N, 3), contiguous, and the largest range, in cells."""
    origins, toward = as_floats(origins_m), as_floats(directions)
    if toward.ndim != 2 or toward.shape[1] != 3 or origins.shape not in ((3,), toward.shape):
        raise InvalidInputError(
            f"rays are origins (N, 3) or (3,) and directions (N, 3), not {origins.shape} and {toward.shape}"
        )
    if not (np.isfinite(origins).all() and np.isfinite(toward).all()):
        raise InvalidInputError("an origin or a direction of a ray contains NaN or infinity")
    largest = np.abs(toward).max(axis=1, keepdims=True)
    if (largest == 0).any():
        raise InvalidInputError(f"the direction of ray {int(np.argmin(largest))} is zero")
    if not 0 < max_range_m <= FARTHEST_CELLS * cell_m:
        raise InvalidInputError(f"max_range_m must be in (0, {FARTHEST_CELLS * cell_m:g}], not {max_range_m}")
    if np.abs(origins).max(initial=0.0) > FARTHEST_CELLS * cell_m:
        raise InvalidInputError(f"a ray starts {np.abs(origins).max():.3g} m from the origin: too far to be in a map")
    # The largest component first: squares of very small or large numbers would vanish or overflow.
    scaled = toward / largest
    unit = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    unit[np.abs(unit) < PARALLEL] = 0
    # A copy: Numba would compile once more for arrays that may not be written to.
    starts = np.array(np.broadcast_to(origins / cell_m, unit.shape))
    reciprocal = np.divide(1, unit, out=np.full(unit.shape, np.inf), where=unit != 0)
    return (starts, unit, reciprocal), max_range_m / cell_m
