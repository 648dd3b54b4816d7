"""A copy of a map's cells, to be looked at while the map goes on."""

from dataclasses import dataclass

import numpy as np

from ..geometry import Array, FloatArray, as_floats
from ..grid import OccupancyGrid
from ..grid.blocks import BLOCK
from ..grid.cells import LogOddsCells


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

    def occupied_m(self, threshold: float, below_m: float = np.inf) -> FloatArray:
        """Centres (N, 3) in world [m] of the known cells with p > threshold that lie below the height below_m."""
        words = self.words
        row, place = np.nonzero((words >= self.rule.least_word_above(threshold)) & ((words & self.rule.count_mask) > 0))
        within = np.stack(np.unravel_index(place, (BLOCK, BLOCK, BLOCK)), axis=-1)
        centres = as_floats((self.indices[row] * BLOCK + within + 0.5) * self.cell_m)
        return centres[centres[:, 2] < below_m]
