"""An open-addressing hash from block indices (i, j, k) to rows, in Numba: a view meets thousands of blocks a frame."""

from typing import Any

import numpy as np
from numba import njit

from ..geometry import Array

FREE_SLOT = -1


@njit(cache=True, nogil=True, error_model="numpy")
def _slot(i: int, j: int, k: int, slots: Array, indices: Array) -> Any:
    """The slot that holds the row of block (i, j, k), or the free one where it would be put."""
    # Multipliers after Teschner et al., "Optimized spatial hashing", 2003; the last mix spreads them over all bits.
    h = np.uint64(i) * np.uint64(73856093) ^ np.uint64(j) * np.uint64(19349669) ^ np.uint64(k) * np.uint64(83492791)
    h = (h ^ (h >> np.uint64(29))) * np.uint64(0x9E3779B97F4A7C15)
    mask = len(slots) - 1
    at = np.int64((h >> np.uint64(32)) & np.uint64(mask))
    while slots[at] >= 0:
        row = slots[at]
        if indices[row, 0] == i and indices[row, 1] == j and indices[row, 2] == k:
            break
        at = (at + 1) & mask
    return int(at)


@njit(cache=True, nogil=True, error_model="numpy")
def row_of(i: int, j: int, k: int, slots: Array, indices: Array) -> Any:
    """The row of block (i, j, k), -1 where it is not held: for the kernels that walk through the map.

    Numba's cache does not notice in their files when this one changes: remove __pycache__ then.
    """
    row: int = slots[_slot(i, j, k, slots, indices)]
    return row


@njit(cache=True, nogil=True, error_model="numpy")
def find_rows(blocks: Array, slots: Array, indices: Array, rows: Array) -> None:
    """Write into rows (N,) int64 the row of each of blocks (N, 3) int64, -1 where there is none.

    slots (2^n,) int32: rows by hash, FREE_SLOT where none; indices (R, 3) int64: the block of each row.
    """
    for n in range(len(blocks)):
        rows[n] = slots[_slot(blocks[n, 0], blocks[n, 1], blocks[n, 2], slots, indices)]


@njit(cache=True, nogil=True, error_model="numpy")
def add_rows(blocks: Array, slots: Array, indices: Array, count: int, rows: Array) -> int:
    """As find_rows, but blocks not held yet get the next rows after the first `count`; the new count.

    There must be room: len(indices) >= count + len(blocks), and more slots than that.
    """
    for n in range(len(blocks)):
        at = _slot(blocks[n, 0], blocks[n, 1], blocks[n, 2], slots, indices)
        if slots[at] < 0:
            indices[count] = blocks[n]
            slots[at] = count
            count += 1
        rows[n] = slots[at]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def fill_slots(slots: Array, indices: Array, count: int) -> None:
    """Enter the first `count` rows of indices, all different, into slots that are all free."""
    for row in range(count):
        slots[_slot(indices[row, 0], indices[row, 1], indices[row, 2], slots, indices)] = row
