"""Axis-aligned boxes of the map: as dense arrays, and what many of them hold."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from ..errors import InvalidInputError, MapTooLargeError
from ..geometry import Array, FloatArray, as_floats
from ..sensor_model import probability
from .blocks import BLOCK, BlockStore
from .hashing import row_of
from .states import Judge

EDGE_CELLS = 1e-6
"""A face of a box that lies this near to a boundary of cells lies on it: 0.3 / 0.1 is not 3 in floating point."""
FARTHEST_CELLS = 2**40
"""An index beyond this is a mistake, not a place."""
NO_WORD = np.iinfo(np.int64).min
"""The largest word of a box that knows no cell."""

Span = tuple[Array, Array]
"""Least cell (..., 3) int64 and the one past the largest."""


@dataclass(frozen=True)
class DenseBox:
    """p(occupied) of a box of cells. origin (3,) int64: the index of the cell of probability[0, 0, 0].

    probability (X, Y, Z) float32, NaN where the cell was never updated.
    """

    origin: Array
    cell_m: float
    probability: Array

    @property
    def low_m(self) -> FloatArray:
        """The corner (3,) of the first cell in world [m]."""
        corner: FloatArray = self.origin * self.cell_m
        return corner


@dataclass(frozen=True)
class BoxCounts:
    """Of each of N boxes: its number of occupied, free and unknown cells (N,) int64, and its largest probability.

    max_probability (N,) is NaN where the box knows no cell.
    """

    n_occupied: Array
    n_free: Array
    n_unknown: Array
    max_probability: FloatArray

    @cached_property
    def n_cells(self) -> Array:
        """Cells that each box meets (N,); n_occupied / n_cells is the occupied share."""
        return self.n_occupied + self.n_free + self.n_unknown


def check_memory(n_bytes: float, limit_gb: float, what: str) -> None:
    """Raise MapTooLargeError, naming the need and the limit, when an answer of n_bytes would exceed limit_gb."""
    if n_bytes > limit_gb * 1e9:
        raise MapTooLargeError(
            f"{what} needs {n_bytes / 1e9:,.6g} GB, the map's memory_limit_gb is {limit_gb:g}; ask for less at once"
        )


def span_of(low_m: ArrayLike, high_m: ArrayLike, cell_m: float) -> Span:
    """The cells that boxes from low_m to high_m (..., 3) [m] meet; a box without volume still meets its cell.

    Raises InvalidInputError where a corner is not finite or a box is inverted.
    """
    low, high = as_floats(low_m), as_floats(high_m)
    if low.shape[-1:] != (3,) or low.shape != high.shape:
        raise InvalidInputError(f"a box has two corners (3,), not {low.shape} and {high.shape}")
    if not (np.abs(low) <= FARTHEST_CELLS * cell_m).all() or not (np.abs(high) <= FARTHEST_CELLS * cell_m).all():
        raise InvalidInputError("a corner of a box is NaN, infinite or too far away to be in a map")
    if not (low <= high).all():
        raise InvalidInputError("a box is inverted: its low corner exceeds its high corner")
    first = np.floor(low / cell_m + EDGE_CELLS).astype(np.int64)
    past = np.ceil(high / cell_m - EDGE_CELLS).astype(np.int64)
    return first, np.maximum(past, first + 1)


def padded_size(span: Span) -> float:
    """Cells of the whole blocks that a span (3,) meets: what `dense` makes room for."""
    low, high = span
    return float(np.prod((-(-high // BLOCK) - low // BLOCK) * float(BLOCK)))


def dense(blocks: BlockStore, span: Span, of: Callable[[Array], Array], unknown: float) -> Array:
    """of(words) of the cells of a span as an array (X, Y, Z), `unknown` where no block is held."""
    low, high = span
    first, past = low // BLOCK, -(-high // BLOCK)
    indices = blocks.indices()
    rows = np.flatnonzero(((indices >= first) & (indices < past)).all(axis=1))
    values = of(blocks.words[rows])
    nx, ny, nz = past - first
    whole = np.full((nx, BLOCK, ny, BLOCK, nz, BLOCK), unknown, dtype=values.dtype)
    i, j, k = (indices[rows] - first).T
    whole[i, :, j, :, k, :] = values.reshape(-1, BLOCK, BLOCK, BLOCK)
    within = tuple(slice(a, b) for a, b in zip(low - first * BLOCK, high - first * BLOCK, strict=True))
    return whole.reshape(nx * BLOCK, ny * BLOCK, nz * BLOCK)[within]


def dense_box(blocks: BlockStore, cell_m: float, span: Span, *, limit_gb: float) -> DenseBox:
    """p of the cells of a span (3,). Raises MapTooLargeError when the array would exceed limit_gb."""
    size = " x ".join(str(n) for n in span[1] - span[0])
    check_memory(4 * padded_size(span), limit_gb, f"a box of {size} cells")
    return DenseBox(span[0], cell_m, dense(blocks, span, lambda words: known_probability(blocks, words), np.nan))


def known_probability(blocks: BlockStore, words: Array) -> Array:
    """float32 p of words of any shape, NaN where never updated."""
    rule = blocks.rule
    return np.where(words & rule.count_mask, probability(rule.log_odds(words)).astype(np.float32), np.float32(np.nan))


def count_boxes(blocks: BlockStore, span: Span, judge: Judge) -> BoxCounts:
    """What each of N boxes, spans (N, 3), holds."""
    low, high = span
    sizes = np.prod((high - low).astype(np.float64), axis=1)
    if (sizes > 2**62).any():
        raise InvalidInputError(f"a box of {sizes.max():.3g} cells is too large to count")
    first, past = blocks.span()
    inside_low = np.minimum(np.maximum(low, first), past)
    inside_high = np.maximum(np.minimum(high, past), inside_low)
    out = np.zeros((len(low), 3), dtype=np.int64)
    _count_boxes(inside_low, inside_high, blocks.table(), judge, out)
    n_free, n_occupied, largest = out.T
    p = probability(blocks.rule.log_odds(np.maximum(largest, -(2**62))))
    n_unknown = np.prod(high - low, axis=1) - n_free - n_occupied
    return BoxCounts(n_occupied, n_free, n_unknown, np.where(largest == NO_WORD, np.nan, p))


@njit(cache=True, nogil=True, error_model="numpy")
def _count_boxes(lows: Array, highs: Array, table: tuple[Array, Array, Array], judge: Judge, out: Array) -> None:
    slots, indices, words = table
    for n in range(len(lows)):
        low, high, found = lows[n], highs[n], out[n]
        found[2] = NO_WORD
        if low[0] == high[0] or low[1] == high[1] or low[2] == high[2]:
            continue
        for i in range(low[0] // BLOCK, (high[0] - 1) // BLOCK + 1):
            for j in range(low[1] // BLOCK, (high[1] - 1) // BLOCK + 1):
                for k in range(low[2] // BLOCK, (high[2] - 1) // BLOCK + 1):
                    row = row_of(i, j, k, slots, indices)
                    if row >= 0:
                        _count_block(words[row], indices[row], low, high, judge, found)


@njit(cache=True, nogil=True, error_model="numpy")
def _count_block(words: Array, block: Array, low: Array, high: Array, judge: Judge, found: Array) -> None:
    count_mask, not_free, occupied = judge
    x, y, z = block[0] * BLOCK, block[1] * BLOCK, block[2] * BLOCK
    for i in range(max(low[0] - x, 0), min(high[0] - x, BLOCK)):
        for j in range(max(low[1] - y, 0), min(high[1] - y, BLOCK)):
            for k in range(max(low[2] - z, 0), min(high[2] - z, BLOCK)):
                word = words[(i * BLOCK + j) * BLOCK + k]
                if word & count_mask:
                    found[0] += word < not_free
                    found[1] += word >= occupied
                    found[2] = max(found[2], word)
