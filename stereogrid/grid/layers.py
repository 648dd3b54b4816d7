"""The map made flat: a band of heights seen from above, and sections by any plane."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_floats, as_pose, transform
from ..sensor_model import probability
from .blocks import BLOCK, BlockStore
from .boxes import EDGE_CELLS, check_memory
from .states import Judge, states_of

WORKING_BYTES = 24
"""Of a column of a projection, or so."""
SAMPLE_BYTES = 200
"""Of a point of a section while the map is asked."""

Ends = tuple[float, float]
"""Low and high end [m]."""


@dataclass(frozen=True)
class Projection:
    """A band of heights from above; column (i, j) spans origin_m + [i, i + 1) cell_m x ... in x and y of world.

    origin_m (2,) [m]; probability (X, Y) float64: the largest p of the column's known cells, NaN without any; state
    (X, Y) int8 codes of State: OCCUPIED where a cell is, FREE where all known ones are, UNKNOWN elsewhere.
    """

    origin_m: FloatArray
    cell_m: float
    probability: FloatArray
    state: Array


@dataclass(frozen=True)
class Section:
    """p(occupied) on a plane: probability (U, V) at the points (u_m (U,), v_m (V,)) [m] of its axes, NaN unknown."""

    T_world_plane: FloatArray
    u_m: FloatArray
    v_m: FloatArray
    probability: FloatArray


def project(blocks: BlockStore, cell_m: float, band: tuple[int, int], *, judge: Judge, limit_gb: float) -> Projection:
    """The cells of heights band[0] <= k < band[1] from above; as wide as what is known there."""
    columns, words = _highest_words(blocks, band)
    if not len(columns):
        heights_m = " to ".join(f"{k * cell_m:g}" for k in band)
        raise InvalidInputError(f"the map knows no cell at z = {heights_m} m, so there is nothing to project")
    low = columns.min(axis=0)
    size = columns.max(axis=0) + 1 - low
    check_memory(WORKING_BYTES * float(size[0]) * float(size[1]), limit_gb, f"a projection of {size[0]} x {size[1]}")
    least = np.iinfo(words.dtype).min
    top = np.full(size, least, dtype=words.dtype)
    np.maximum.at(top, tuple((columns - low).T), words)
    top[top == least] = 0
    known = (top & blocks.rule.count_mask) > 0
    p = np.where(known, probability(blocks.rule.log_odds(top)), np.nan)
    return Projection(low * cell_m, cell_m, p, states_of(top, judge))


def _highest_words(blocks: BlockStore, band: tuple[int, int]) -> tuple[Array, Array]:
    """Columns (N, 2) int64 with a known cell in a band, and the largest word (N,) that each of their blocks has."""
    indices = blocks.indices()
    rows = np.flatnonzero((indices[:, 2] * BLOCK < band[1]) & ((indices[:, 2] + 1) * BLOCK > band[0]))
    words = blocks.words[rows].reshape(-1, BLOCK, BLOCK, BLOCK)
    k = indices[rows, 2, None] * BLOCK + np.arange(BLOCK)
    counts = ((k >= band[0]) & (k < band[1]))[:, None, None, :] & ((words & blocks.rule.count_mask) > 0)
    top = np.where(counts, words, np.iinfo(words.dtype).min).max(axis=3)
    row, i, j = np.nonzero(counts.any(axis=3))
    return indices[rows[row], :2] * BLOCK + np.stack([i, j], axis=-1), top[row, i, j]


def section_points(
    T_world_plane: ArrayLike,
    ranges_m: tuple[Ends, Ends],
    step_m: float,
    *,
    limit_gb: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (U V, 3) in world, and their u (U,) and v (V,) [m]: the middles of steps on the plane z = 0 of a pose."""
    pose = as_pose(T_world_plane, "T_world_plane")
    if not (np.isfinite(step_m) and step_m > 0):
        raise InvalidInputError(f"step_m must be positive and finite, not {step_m}")
    sizes = [_steps(name, ends, step_m) for name, ends in zip(("u_m", "v_m"), ranges_m, strict=True)]
    check_memory(SAMPLE_BYTES * sizes[0] * sizes[1], limit_gb, f"a section of {sizes[0]:g} x {sizes[1]:g} points")
    u, v = (as_floats(ends[0] + (np.arange(int(n)) + 0.5) * step_m) for n, ends in zip(sizes, ranges_m, strict=True))
    plane = np.stack(np.meshgrid(u, v, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    return transform(pose, plane), u, v


def _steps(name: str, ends_m: Ends, step_m: float) -> float:
    low, high = ends_m
    if not (np.isfinite([low, high]).all() and low < high):
        raise InvalidInputError(f"{name} must be a low and a higher end [m], not {low}, {high}")
    return float(np.ceil((high - low) / step_m - EDGE_CELLS))


def band_of(low_m: float, high_m: float, cell_m: float) -> tuple[int, int]:
    """The heights k of the cells that [low_m, high_m) [m] meets: first, and the one past the last."""
    if not low_m < high_m:
        raise InvalidInputError(f"a band of heights goes from a low to a higher end [m], not {low_m} to {high_m}")
    # Infinite ends are whatever the map holds.
    low, high = np.clip([low_m / cell_m, high_m / cell_m], -(2.0**52), 2.0**52)
    first = int(np.floor(low + EDGE_CELLS))
    return first, max(int(np.ceil(high - EDGE_CELLS)), first + 1)
