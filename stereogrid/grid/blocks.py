"""Sparse storage: a growing pool of cubic blocks of cells, found by their index."""

import numpy as np

from ..geometry import Array
from .cells import LogOddsCells
from .hashing import FREE_SLOT, add_rows, fill_slots, find_rows

BLOCK = 8
"""Cells along the edge of a block."""
CELLS = BLOCK**3
FEWEST = 4096
"""Room for so many blocks is made at first: a view or two, so that the first frames of a drive copy nothing."""


class BlockStore:
    """Blocks of 8^3 cells, row by row: words (capacity, 512) of a cell rule, C order within a block."""

    def __init__(self, rule: LogOddsCells) -> None:
        self.rule = rule
        self.words: Array = np.zeros((0, CELLS), dtype=rule.dtype)
        self._indices = np.zeros((0, 3), dtype=np.int64)
        self._slots = np.full(64, FREE_SLOT, dtype=np.int32)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def n_bytes(self) -> int:
        """Memory of the blocks in use [bytes]: their cells, their indices and their share of the hash."""
        return self.bytes_of(len(self))

    def bytes_of(self, n_blocks: int) -> int:
        """Memory that n_blocks take [bytes]."""
        slots = 2 * self._slots.itemsize
        return n_blocks * (CELLS * self.words.itemsize + 3 * self._indices.itemsize + slots)

    def bytes_with(self, blocks: Array) -> int:
        """Memory that the store would use with blocks (B, 3), all different, added [bytes]."""
        return self.bytes_of(len(self) + int(np.count_nonzero(self.find(blocks) < 0)))

    def find(self, blocks: Array) -> Array:
        """The rows (B,) int64 of blocks (B, 3), -1 where a block is not held."""
        rows = np.empty(len(blocks), dtype=np.int64)
        find_rows(np.ascontiguousarray(blocks, dtype=np.int64), self._slots, self._indices, rows)
        return rows

    def table(self) -> tuple[Array, Array, Array]:
        """Hash slots, block indices and words, as kernels take them to look cells up (hashing.row_of)."""
        return self._slots, self._indices, self.words

    def span(self) -> tuple[Array, Array]:
        """Least cell (3,) and the one past the largest of the blocks held; both 0 where none is."""
        held = self._indices[: len(self)]
        if not len(held):
            return np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64)
        return held.min(axis=0) * BLOCK, (held.max(axis=0) + 1) * BLOCK

    def rows(self, blocks: Array) -> Array:
        """The rows (B,) int64 of blocks (B, 3); blocks not held yet are added, unknown."""
        self._reserve(len(self) + len(blocks))
        rows = np.empty(len(blocks), dtype=np.int64)
        blocks = np.ascontiguousarray(blocks, dtype=np.int64)
        self._count = int(add_rows(blocks, self._slots, self._indices, self._count, rows))
        return rows

    def _reserve(self, needed: int) -> None:
        if needed <= len(self.words):
            return
        capacity = max(needed, 3 * len(self.words) // 2, FEWEST)
        # Zeros that nobody has touched take no memory yet: room to grow costs nothing.
        words = np.zeros((capacity, CELLS), dtype=self.rule.dtype)
        indices = np.zeros((capacity, 3), dtype=np.int64)
        words[: len(self)], indices[: len(self)] = self.words[: len(self)], self._indices[: len(self)]
        self.words, self._indices = words, indices
        if 2 * capacity > len(self._slots):
            self._slots = np.full(1 << (2 * capacity - 1).bit_length(), FREE_SLOT, dtype=np.int32)
            fill_slots(self._slots, self._indices, self._count)

    def indices(self) -> Array:
        """Indices (B, 3) int64 of the blocks held, row by row."""
        return self._indices[: len(self)].copy()

    def in_order(self) -> Array:
        """The rows (B,) int64 of the blocks held, in lexical order of their indices: no trace of the map's history."""
        order: Array = np.lexsort(self._indices[: len(self)].T[::-1])
        return order

    def log_odds(self) -> Array:
        """float32 (B, 8, 8, 8) log-odds of the blocks held, row by row."""
        return self.rule.log_odds(self.words[: len(self)]).reshape(-1, BLOCK, BLOCK, BLOCK)

    def counts(self) -> Array:
        """uint16 (B, 8, 8, 8) update counts of the blocks held, row by row."""
        return self.rule.n_updates(self.words[: len(self)]).reshape(-1, BLOCK, BLOCK, BLOCK)

    def at(self, cells: Array) -> tuple[Array, Array]:
        """Log-odds (N,) float32 and update counts (N,) uint16 of cells (N, 3) int64; count 0 where none is held."""
        words = self.words_at(cells)
        return self.rule.log_odds(words), self.rule.n_updates(words)

    def words_at(self, cells: Array) -> Array:
        """The words (N,) of cells (N, 3) int64; 0 where no block is held."""
        rows = self.find(cells // BLOCK)
        held = rows >= 0
        words = np.zeros(len(cells), dtype=self.rule.dtype)
        words[held] = self.words[rows[held], _place(cells[held])]
        return words

    def put(self, cells: Array, words: Array) -> None:
        """Set the words (N,) of cells (N, 3) int64, all different; blocks not held yet are added."""
        self.rows(blocks_of(cells))
        self.words[self.find(cells // BLOCK), _place(cells)] = words

    def known(self, above: float = -np.inf) -> tuple[Array, Array]:
        """Cells (N, 3) int64 that were updated and whose log-odds exceed `above`, and their log-odds (N,).

        Block by block in lexical order, and so within a block: the order does not depend on the map's history.
        """
        order = self.in_order()
        words = self.words[order]
        row, place = np.nonzero((self.rule.n_updates(words) > 0) & (self.rule.log_odds(words) > above))
        within = np.stack(np.unravel_index(place, (BLOCK, BLOCK, BLOCK)), axis=-1)
        return self._indices[order[row]] * BLOCK + within, self.rule.log_odds(words[row, place])


def blocks_of(cells: Array) -> Array:
    """The blocks (B, 3) int64, all different, that hold cells (N, 3) int64."""
    blocks = cells // BLOCK
    # Cells mostly come block by block: few are left to sort.
    blocks = _without_repeats(blocks)
    return _without_repeats(blocks[np.lexsort(blocks.T[::-1])])


def _without_repeats(rows: Array) -> Array:
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return rows[new]


def _place(cells: Array) -> Array:
    """Where in its block's row each of cells (N, 3) stands."""
    i, j, k = (cells % BLOCK).T
    place: Array = (i * BLOCK + j) * BLOCK + k
    return place
