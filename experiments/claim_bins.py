"""The reliability of one map as plain sums, so that those of many seeds can be added up."""

import numpy as np

from stereogrid.grid import OccupancyGrid
from stereogrid.scoring import Score
from stereogrid.scoring.calibration import BINS
from stereogrid.scoring.score import DIMENSIONLESS
from stereogrid.scoring.truth import MapTruth

PREFIX = "bin_"
KINDS = ("n", "p", "occupied")
"""Of each bin: how many cells it holds, the sum of their p, and how many are occupied."""


def bin_scores(truth: MapTruth, grid: OccupancyGrid) -> list[Score]:
    """What the reliability of a map over all visible cells is summed up from."""
    table = truth.reliability(grid, prior=grid.model.prior)
    sums = {
        "n": table.count.astype(float),
        "p": np.nan_to_num(table.mean_p) * table.count,
        "occupied": np.nan_to_num(table.frequency) * table.count,
    }
    return [
        Score(f"{PREFIX}{kind}_{k}", float(sums[kind][k]), DIMENSIONLESS, int(table.count[k]))
        for kind in KINDS
        for k in range(BINS)
    ]
