"""Which cells of a map are right, wrong and missing, where the truth is known."""

from typing import TYPE_CHECKING

import numpy as np

from ..geometry import Array
from .cell_blocks import Selected

if TYPE_CHECKING:
    from ..scoring.truth import MapTruth

TRUE, FALSE, MISSED, UNJUDGED = range(4)


class BesideTruth:
    """What could be seen of the true world on a drive, to hold maps against: labels and visible set of a MapTruth."""

    def __init__(self, truth: "MapTruth") -> None:
        from ..scoring.labels import OCCUPIED

        labels = truth.labels
        self.cell_m = labels.cell_m
        self._origin = labels.origin_index
        self._seen = truth.visible.mask
        self._occupied = labels.label == OCCUPIED
        self._to_find = np.argwhere(self._seen & self._occupied)

    def judge(self, found: Selected) -> tuple[Array, Array]:
        """Cells (N, 3) int32, those found and those missed, and what each is (N,): TRUE, FALSE, MISSED or UNJUDGED."""
        at = found.cells - self._origin
        inside = np.all((at >= 0) & (at < self._seen.shape), axis=1)
        kinds = np.full(len(at), UNJUDGED)
        i, j, k = at[inside].T
        occupied = np.where(self._occupied[i, j, k], TRUE, FALSE)
        kinds[inside] = np.where(self._seen[i, j, k], occupied, UNJUDGED)
        hit = np.zeros(self._seen.shape, dtype=bool)
        hit[i, j, k] = True
        missed = self._to_find[~hit[tuple(self._to_find.T)]] + self._origin
        cells = np.concatenate([found.cells, missed.astype(np.int32)])
        return cells, np.concatenate([kinds, np.full(len(missed), MISSED)])
