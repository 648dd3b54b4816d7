"""Sparse storage: a growing pool of cubic blocks, found by their index."""

import math
from collections.abc import Iterator

import numpy as np

from ..geometry import Array
from .kernels import BLOCK

BYTES_PER_CELL = 6
"""float32 log-odds and a uint16 update count."""
SHAPE = (BLOCK, BLOCK, BLOCK)


class BlockStore:
    """Blocks of 16^3 cells: log_odds (capacity, 16, 16, 16) float32 and n_updates, uint16, rows by block index."""

    def __init__(self, initial_log_odds: float) -> None:
        self._initial = np.float32(initial_log_odds)
        self._row_of: dict[tuple[int, int, int], int] = {}
        self.log_odds: Array = np.empty((0, *SHAPE), dtype=np.float32)
        self.n_updates: Array = np.empty((0, *SHAPE), dtype=np.uint16)

    def __len__(self) -> int:
        return len(self._row_of)

    @property
    def n_bytes(self) -> int:
        """Memory of the blocks in use [bytes]."""
        return len(self) * BLOCK**3 * BYTES_PER_CELL

    def bytes_with(self, blocks: Array) -> int:
        """Memory that the store would use with blocks (B, 3) added [bytes]."""
        new = sum(tuple(block) not in self._row_of for block in blocks.tolist())
        return (len(self) + new) * BLOCK**3 * BYTES_PER_CELL

    def rows(self, blocks: Array) -> Array:
        """The rows (B,) int64 of blocks (B, 3); blocks not held yet are added, unknown."""
        rows = [self._row_of.setdefault(tuple(block), len(self._row_of)) for block in blocks.tolist()]
        if len(self._row_of) > len(self.log_odds):
            self._grow(max(len(self._row_of), 3 * len(self.log_odds) // 2))
        return np.array(rows, dtype=np.int64)

    def _grow(self, capacity: int) -> None:
        added = capacity - len(self.log_odds)
        self.log_odds = np.concatenate([self.log_odds, np.full((added, *SHAPE), self._initial, dtype=np.float32)])
        self.n_updates = np.concatenate([self.n_updates, np.zeros((added, *SHAPE), dtype=np.uint16)])

    def indices(self) -> Array:
        """Indices (B, 3) int64 of the blocks held, row by row."""
        return np.array(list(self._row_of), dtype=np.int64).reshape(-1, 3)

    def counts(self) -> Array:
        """Update counts (B, 16, 16, 16) of the blocks held, row by row."""
        counts: Array = self.n_updates[: len(self)]
        return counts

    def at(self, cells: Array) -> tuple[Array, Array]:
        """Log-odds and update counts (N,) of cells (N, 3) int64; count 0 where no block is held."""
        row = self._rows_or_none(cells // BLOCK)
        held = row >= 0
        values = np.full(len(cells), self._initial, dtype=np.float32)
        counts = np.zeros(len(cells), dtype=np.uint16)
        place = (row[held], *(cells[held] % BLOCK).T)
        values[held], counts[held] = self.log_odds[place], self.n_updates[place]
        return values, counts

    def _rows_or_none(self, blocks: Array) -> Array:
        """The rows (N,) int64 of blocks (N, 3) with many repeats, -1 where a block is not held."""
        indices = self.indices()
        if not len(indices):
            return np.full(len(blocks), -1, dtype=np.int64)
        low, high = indices.min(axis=0), indices.max(axis=0)
        inside = ((blocks >= low) & (blocks <= high)).all(axis=1)
        size = high - low + 1
        if math.prod(size.tolist()) >= 2**63:
            return np.array([self._row_of.get(tuple(block), -1) for block in blocks.tolist()], dtype=np.int64)
        # One number a block: sorting numbers is many times faster than sorting rows.
        keys = np.ravel_multi_index(tuple((indices - low).T), tuple(size))
        order = np.argsort(keys)
        wanted = np.ravel_multi_index(tuple((blocks[inside] - low).T), tuple(size))
        place = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
        rows = np.full(len(blocks), -1, dtype=np.int64)
        rows[inside] = np.where(keys[order][place] == wanted, order[place], -1)
        return rows

    def in_order(self) -> Iterator[tuple[Array, Array, Array]]:
        """Block by block in lexical order of the index: index (3,), log-odds (16, 16, 16), and which are known."""
        indices = self.indices()
        for row in np.lexsort(indices.T[::-1]):
            yield indices[row], self.log_odds[row], self.n_updates[row] > 0

    def known(self, above: float = -np.inf) -> tuple[Array, Array]:
        """Cells (N, 3) int64 that were updated and whose log-odds exceed `above`, and their log-odds (N,).

        Block by block in lexical order, and so within a block: the order does not depend on the map's history.
        """
        cells, values = [np.empty((0, 3), dtype=np.int64)], [np.empty(0, dtype=np.float32)]
        for index, log_odds, known in self.in_order():
            kept = known & (log_odds > above)
            cells.append(index * BLOCK + np.argwhere(kept))
            values.append(log_odds[kept])
        return np.concatenate(cells), np.concatenate(values)
