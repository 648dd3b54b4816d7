"""What the truth would make of a map: its probabilities set right, or its cells."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression

from stereogrid.geometry import FloatArray
from stereogrid.grid import OccupancyGrid
from stereogrid.scoring import OCCUPIED, CellLabels, sample_cells
from stereogrid.scoring.truth import MapTruth


@dataclass(frozen=True)
class Recalibrated:
    """A map that says of its cells how often such cells are occupied: p (K,) becomes frequency (K,), which never falls.

    The best log-loss and Brier score that any monotone change of its probabilities could have on this truth. The
    order of the cells stays, but for ties where it was wrong: what the map cannot tell apart, nothing here can.
    """

    grid: OccupancyGrid
    p: FloatArray
    frequency: FloatArray

    @classmethod
    def by(cls, truth: MapTruth, grid: OccupancyGrid) -> "Recalibrated":
        """Fitted to the touched cells of the truth's visible set, by isotonic regression."""
        cells = sample_cells(grid, truth.labels, truth.visible)
        p, which = np.unique(cells.p[cells.touched], return_inverse=True)
        if not len(p):
            return cls(grid, np.array([0.5]), np.array([0.5]))
        count = np.bincount(which)
        occupied = np.bincount(which, weights=cells.occupied[cells.touched])
        return cls(grid, p, isotonic_regression(occupied / count, weights=count).x)

    @property
    def cell_m(self) -> float:
        """Side of its cells [m]."""
        return self.grid.cell_m

    def probability(self, points_m: FloatArray) -> FloatArray:
        """p(occupied) (N,) at points (N, 3) in world [m]; NaN where the map was never updated."""
        return np.interp(self.grid.probability(points_m), self.p, self.frequency)

    def occupied_centres(self) -> FloatArray:
        """Centres (N, 3) in world [m] of the cells at p > .5."""
        centres_m = self.grid.occupied_centres(0.0)
        return centres_m[self.probability(centres_m) > 0.5]


@dataclass(frozen=True)
class Labelled:
    """A map whose touched cells have their true labels: what is then wrong is what it never touched."""

    grid: OccupancyGrid
    labels: CellLabels

    @property
    def cell_m(self) -> float:
        """Side of its cells [m]."""
        return self.grid.cell_m

    def probability(self, points_m: FloatArray) -> FloatArray:
        """0 or 1 (N,) at points (N, 3) in world [m]; NaN where the map was never updated."""
        index = self.labels.index_of(points_m)
        inside = ((index >= 0) & (index < self.labels.label.shape)).all(axis=1)
        occupied = np.zeros(len(points_m))
        occupied[inside] = self.labels.label[tuple(index[inside].T)] == OCCUPIED
        return np.where(np.isnan(self.grid.probability(points_m)), np.nan, occupied)

    def occupied_centres(self) -> FloatArray:
        """Centres (N, 3) in world [m] of the touched cells that are occupied."""
        centres_m = self.grid.occupied_centres(0.0)
        return centres_m[self.probability(centres_m) > 0.5]
