"""The cells of a map as they are drawn: by blocks, in two bytes each, and coarser where they are too many."""

from dataclasses import dataclass, replace

import numpy as np

from ..geometry import Array, FloatArray, as_floats
from ..grid.blocks import BLOCK
from ..grid.cells import ONE, LogOddsCells
from ..sensor_model import probability

UNKNOWN = np.int16(-32768)
"""The value of a cell that was never updated."""
Box = tuple[Array, Array]
"""First cell (3,) and the one past the last (3,), as floats: an end may be infinite."""


@dataclass(frozen=True)
class Selected:
    """Cells (N, 3) int32, their values (N,) int16, and when each last changed (N,), None where nobody knows."""

    cells: Array
    values: Array
    changed: Array | None


@dataclass(frozen=True)
class CellBlocks:
    """Blocks of edge^3 cells of cell_m [m] at a moment.

    indices (B, 3); values (B, edge^3) int16: log-odds less the prior's, in 1 / ONE nat; UNKNOWN: never updated.
    changed (B, edge^3) uint16: the last observation that changed each, counted in units that History knows.
    coarser: how many cells of the map lie along an edge of one of these.
    """

    indices: Array
    values: Array
    rule: LogOddsCells
    cell_m: float
    edge: int = BLOCK
    changed: Array | None = None
    coarser: int = 1

    def least_above(self, p: float) -> int:
        """The least value of a cell with a probability above p."""
        limit = int(np.iinfo(np.int16).max)
        return int(np.clip(self.rule.least_word_above(p) >> self.rule.count_bits, -limit, limit))

    def probability(self, values: Array) -> FloatArray:
        """p(occupied) of values of any shape; NaN where unknown."""
        return np.where(values == UNKNOWN, np.nan, probability(values / ONE + self.rule.prior_log_odds))

    def centres_m(self, cells: Array) -> FloatArray:
        """Centres (N, 3) in world [m]."""
        return as_floats((cells + 0.5) * self.cell_m)

    def count_above(self, p: float) -> int:
        """How many cells have a probability above p."""
        return int(np.count_nonzero(self.values >= self.least_above(p)))

    def fitting(self, most: int, p: float = 0.5) -> "CellBlocks":
        """These, or coarser ones, so that at most so many have a probability above p, if blocks can be so coarse."""
        blocks = self
        while blocks.count_above(p) > most and blocks.edge > 1:
            blocks = blocks._halved()
        return blocks

    def _halved(self) -> "CellBlocks":
        """Cells twice as large: of their children the largest value and the latest change."""
        n = self.edge // 2

        def largest(each: Array) -> Array:
            children: Array = each.reshape(-1, n, 2, n, 2, n, 2).max(axis=(2, 4, 6)).reshape(-1, n**3)
            return children

        changed = None if self.changed is None else largest(self.changed)
        return replace(
            self, values=largest(self.values), changed=changed, cell_m=2 * self.cell_m, edge=n, coarser=2 * self.coarser
        )

    def select(self, p: float, box: Box | None = None) -> Selected:
        """The cells with a probability above p whose indices lie in the box."""
        edge = self.edge
        row, place = np.nonzero(self.values >= self.least_above(p))
        within = np.stack(np.unravel_index(place, (edge, edge, edge)), axis=-1).astype(np.int32)
        cells = self.indices[row].astype(np.int32) * edge + within
        values, changed = self.values[row, place], None if self.changed is None else self.changed[row, place]
        if box is None:
            return Selected(cells, values, changed)
        kept = in_box(cells, box)
        return Selected(cells[kept], values[kept], None if changed is None else changed[kept])

    def layer(self, axis: int, at: int) -> tuple[Array, Array]:
        """Values (U, V) of the cells whose index along axis is `at`, and the cell (2,) of the first, along the other
        axes in their order; (0, 0) where no block is there."""
        edge = self.edge
        rows = np.flatnonzero(self.indices[:, axis] == at // edge)
        others = [each for each in range(3) if each != axis]
        blocks = self.indices[rows][:, others]
        if not len(rows):
            return np.full((0, 0), UNKNOWN), np.zeros(2, np.int64)
        low = blocks.min(axis=0)
        size = (blocks.max(axis=0) + 1 - low) * edge
        tiles = np.full((size[0] // edge, size[1] // edge, edge, edge), UNKNOWN)
        cubes = self.values[rows].reshape(-1, edge, edge, edge)
        tiles[tuple((blocks - low).T)] = np.take(cubes, at % edge, axis=1 + axis)
        return tiles.transpose(0, 2, 1, 3).reshape(size), low * edge

    def ends_m(self, p: float = 0.5) -> FloatArray:
        """Lower and upper corner (2, 3) [m] of the cells above p, or of all blocks where none is; 0 of no blocks."""
        cells = self.select(p).cells
        if len(cells):
            return as_floats(np.stack([cells.min(axis=0), cells.max(axis=0) + 1]) * self.cell_m)
        if not len(self.indices):
            return np.zeros((2, 3))
        low, high = self.indices.min(axis=0), self.indices.max(axis=0) + 1
        return as_floats(np.stack([low, high]) * self.edge * self.cell_m)


def in_box(cells: Array, box: Box) -> Array:
    """(N,) whether each of cells (N, 3) lies in the box."""
    within: Array = np.all((cells >= box[0]) & (cells < box[1]), axis=1)
    return within
