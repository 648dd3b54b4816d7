"""Maps made from a map: a part of it, and the same in larger or smaller cells."""

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInputError
from ..geometry import Array, as_floats
from .blocks import BLOCK, CELLS, BlockStore
from .boxes import check_memory

LARGEST_FACTOR = 1000
BLOCKS_AT_ONCE = 4096
"""So that the indices of their cells take no more than some 100 MB."""


def cropped(blocks: BlockStore, cell_m: float, low_m: ArrayLike, high_m: ArrayLike) -> BlockStore:
    """The cells whose centres c obey low_m <= c < high_m (3,) [m]; an end may be infinite."""
    low, high = as_floats(low_m), as_floats(high_m)
    if low.shape != (3,) or high.shape != (3,):
        raise InvalidInputError(f"a box has two corners (3,), not {low.shape} and {high.shape}")
    if not (low < high).all():
        raise InvalidInputError(f"the box from {low.tolist()} to {high.tolist()} m is empty or inverted, or holds NaN")
    indices = blocks.indices()
    centres = (indices[:, :, None] * BLOCK + np.arange(BLOCK) + 0.5) * cell_m
    within: Array = (centres >= low[:, None]) & (centres < high[:, None])
    rows = np.flatnonzero(np.all(np.any(within, axis=2), axis=1))
    x, y, z = within[rows].transpose(1, 0, 2)
    inside = x[:, :, None, None] & y[:, None, :, None] & z[:, None, None, :]
    part = BlockStore(blocks.rule)
    _add(part, indices[rows], np.where(inside.reshape(-1, CELLS), blocks.words[rows], 0))
    return part


def coarsened(blocks: BlockStore, factor: int) -> BlockStore:
    """Cells `factor` times larger: cell i holds the cells c with c // factor = i, negative ones too.

    Its log-odds are the largest of its known children (as of OctoMap's inner nodes: what is occupied stays so) and
    its update count the largest: one observation updates many children, and a sum would count it many times.
    """
    _check_factor(factor)
    larger = BlockStore(blocks.rule)
    for start in range(0, len(blocks), BLOCKS_AT_ONCE):
        cells, words = _known_words(blocks, slice(start, min(start + BLOCKS_AT_ONCE, len(blocks))))
        parents = cells // factor
        homes = parents // BLOCK
        # Neighbours share a home: most repetitions follow one another.
        new = np.ones(len(homes), dtype=bool)
        new[1:] = (homes[1:] != homes[:-1]).any(axis=1)
        rows = larger.rows(homes[new])
        touched, of_row = np.unique(rows, return_inverse=True)
        i, j, k = (parents - homes * BLOCK).T
        at = of_row[np.cumsum(new) - 1] * CELLS + (i * BLOCK + j) * BLOCK + k
        top = blocks.rule.highest_by(at, words, len(touched) * CELLS).reshape(-1, CELLS)
        larger.words[touched] = blocks.rule.highest(larger.words[touched], top)
    return larger


def _known_words(blocks: BlockStore, some: slice) -> tuple[Array, Array]:
    """Known cells (N, 3) int64 of some rows, and their words (N,)."""
    row, place = np.nonzero(blocks.words[some])
    within = np.stack(np.unravel_index(place, (BLOCK, BLOCK, BLOCK)), axis=-1)
    return blocks.indices()[some][row] * BLOCK + within, blocks.words[some][row, place]


def refined(blocks: BlockStore, factor: int, *, limit_gb: float) -> BlockStore:
    """Cells `factor` times smaller, each a copy of the one it lies in. Nothing is learnt by it."""
    _check_factor(factor)
    check_memory(float(blocks.bytes_of(len(blocks))) * factor**3, limit_gb, f"a map refined {factor} times")
    smaller = BlockStore(blocks.rule)
    indices = blocks.indices()
    words = blocks.words[: len(blocks)].reshape(-1, BLOCK, BLOCK, BLOCK)
    for offset in np.ndindex(factor, factor, factor):
        i, j, k = (np.arange(a * BLOCK, (a + 1) * BLOCK) // factor for a in offset)
        children = words[:, i[:, None, None], j[:, None], k].reshape(-1, CELLS)
        _add(smaller, indices * factor + offset, children)
    return smaller


def _add(blocks: BlockStore, indices: Array, words: Array) -> None:
    """Put the words (B, 512) of blocks (B, 3), all new; those that know nothing stay away."""
    known = words.any(axis=1)
    rows = blocks.rows(indices[known])
    blocks.words[rows] = words[known]


def _check_factor(factor: int) -> None:
    if isinstance(factor, bool) or not isinstance(factor, int | np.integer) or not 1 <= factor <= LARGEST_FACTOR:
        raise InvalidInputError(f"factor must be a whole number of 1 to {LARGEST_FACTOR}, not {factor!r}")
