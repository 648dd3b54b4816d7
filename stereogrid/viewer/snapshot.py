"""A copy of a map's cells, to be looked at while the map goes on."""

from dataclasses import dataclass

import numpy as np

from ..geometry import Array
from ..grid import OccupancyGrid
from ..grid.cells import LogOddsCells
from .cell_blocks import UNKNOWN, CellBlocks


@dataclass(frozen=True)
class Snapshot:
    """The blocks of a map at a moment: indices (B, 3), words (B, 512) of the rule; cells of cell_m [m]."""

    indices: Array
    words: Array
    rule: LogOddsCells
    cell_m: float

    @classmethod
    def of(cls, grid: OccupancyGrid) -> "Snapshot":
        """A copy of all that the map holds; nobody may change the map meanwhile."""
        blocks = grid.blocks
        return cls(blocks.indices(), blocks.words[: len(blocks)].copy(), blocks.rule, grid.cell_m)

    def values(self) -> Array:
        """(B, 512) int16 as CellBlocks has them."""
        limit = np.iinfo(np.int16).max
        values = np.clip(self.words >> self.rule.count_bits, -limit, limit)
        return np.where((self.words & self.rule.count_mask) > 0, values, UNKNOWN).astype(np.int16)

    def cells(self) -> CellBlocks:
        """What is drawn of it."""
        return CellBlocks(self.indices, self.values(), self.rule, self.cell_m)
