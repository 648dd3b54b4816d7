"""Which way surfaces face."""

import numpy as np
from numba import njit

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray
from .blocks import BLOCK, BlockStore
from .hashing import row_of
from .states import Judge

LARGEST_REACH_CELLS = 16
BALANCED = 1e-9
"""Free neighbours whose moments cancel to this share of what they might sum to point nowhere."""


def normals_at(blocks: BlockStore, cells: Array, *, judge: Judge, reach_cells: int) -> FloatArray:
    """Outward unit normals (N, 3) of cells (N, 3) int64, towards free space; NaN where the neighbours do not say.

    The first moment of the free neighbours within a ball of reach_cells about the cell, with a Gaussian weight (its
    sigma half the reach): the smoothed gradient of free space. Unknown and occupied neighbours count alike, for a
    wall that was seen from one side is a thin sheet, and a negative weight of it would double the error.
    """
    if not (isinstance(reach_cells, int | np.integer) and 1 <= reach_cells <= LARGEST_REACH_CELLS):
        raise InvalidInputError(f"reach_cells must be a whole number of 1 to {LARGEST_REACH_CELLS}, not {reach_cells}")
    axis = np.arange(-reach_cells, reach_cells + 1)
    offsets = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    square = (offsets**2).sum(axis=1)
    near = (square > 0) & (square <= (reach_cells + 0.5) ** 2)
    weights = np.exp(-2 * square[near] / reach_cells**2)
    moments = np.zeros((len(cells), 3))
    _moments(np.ascontiguousarray(cells), (offsets[near], weights), blocks.table(), judge, moments)
    length = np.linalg.norm(moments, axis=1, keepdims=True)
    most = (weights * np.sqrt(square[near])).sum()
    return np.where(length > BALANCED * most, moments / np.maximum(length, BALANCED * most), np.nan)


@njit(cache=True, nogil=True, error_model="numpy")
def _moments(
    cells: Array, ball: tuple[Array, Array], table: tuple[Array, Array, Array], judge: Judge, out: Array
) -> None:
    """Add to out (N, 3) the offsets (M, 3) of the free neighbours of cells (N, 3), times their weights (M,)."""
    offsets, weights = ball
    slots, indices, words = table
    count_mask, not_free, _ = judge
    i = j = k = row = np.int64(-(2**62))
    for n in range(len(cells)):
        for m in range(len(offsets)):
            x, y, z = cells[n, 0] + offsets[m, 0], cells[n, 1] + offsets[m, 1], cells[n, 2] + offsets[m, 2]
            if x // BLOCK != i or y // BLOCK != j or z // BLOCK != k:
                i, j, k = x // BLOCK, y // BLOCK, z // BLOCK
                row = row_of(i, j, k, slots, indices)
            if row < 0:
                continue
            word = words[row, ((x - i * BLOCK) * BLOCK + y - j * BLOCK) * BLOCK + z - k * BLOCK]
            if word & count_mask and word < not_free:
                for axis in range(3):
                    out[n, axis] += weights[m] * offsets[m, axis]
