"""What the experiments on simulated drives share: the drive, the scores of a map, and which of them come first."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sim.record import record_drive
from sim.world import WORLDS
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.grid import OccupancyGrid
from stereogrid.mapping_run import Mapped
from stereogrid.observation import Recording
from stereogrid.scoring import Score
from stereogrid.scoring.truth import MapTruth

from .parallel import Stage

HEADLINE = (
    "auc",
    "occupied_precision",
    "occupied_recall",
    "occupied_f1",
    "obstacle_auc",
    "obstacle_occupied_f1",
    "coverage_occupied",
    "brier_balanced",
    "log_loss",
    "ece_width",
    "accuracy_m",
    "completeness_m",
)
"""What the tables show of the scores in metrics.json."""
OBSTACLES_M = (0.15, 2.4)
"""Heights between the floor and the ceiling of the corridor [m]."""
OBSTACLE_SCORES = ("auc", "occupied_precision", "occupied_recall", "occupied_f1")
OBSTACLE_MEANINGS = {
    f"obstacle_{name}": f"{name} of the cells from {OBSTACLES_M[0]} to {OBSTACLES_M[1]} m" for name in OBSTACLE_SCORES
}


@dataclass(frozen=True)
class DriveConfig:
    """A simulated drive. seed paints the world.

    every_m: distance between two pairs [m]. distance_m: how much of the path is driven, 0 = all [m].
    """

    world: str = "corridor"
    seed: int = 0
    every_m: float = 0.25
    distance_m: float = 0.0

    def __post_init__(self) -> None:
        if self.world not in WORLDS:
            raise unknown_name("world", self.world, WORLDS)
        if not (np.isfinite(self.every_m) and self.every_m > 0):
            raise InvalidInputError(f"every_m must be positive and finite, not {self.every_m}")
        for name in ("seed", "distance_m"):
            if not getattr(self, name) >= 0:
                raise InvalidInputError(f"{name} must be >= 0, not {getattr(self, name)}")


def record(drive: DriveConfig, path: Path, stage: Stage) -> Path:
    """Simulate the drive into an MCAP file."""
    with stage("driving", 1) as step:
        return record_drive(
            path,
            world=drive.world,
            seed=drive.seed,
            every_m=drive.every_m,
            max_distance_m=drive.distance_m or None,
            progress=step.to,
        )


def score(truth: MapTruth, obstacles: MapTruth, mapped: Mapped) -> list[Score]:
    """Every score of a map, and those of the obstacles alone: floor and ceiling are easy, and half of the cells."""
    return score_grid(truth, obstacles, mapped.grid)


def score_grid(truth: MapTruth, obstacles: MapTruth, grid: OccupancyGrid) -> list[Score]:
    """The same of a grid."""
    among = obstacles.score(grid, prior=grid.model.prior, surface=False)
    named = (replace(each, name=f"obstacle_{each.name}") for each in among if each.name in OBSTACLE_SCORES)
    return [*truth.score(grid, prior=grid.model.prior), *named]


def about(drive: Recording) -> dict[str, str]:
    """Facts of a drive for a report: a reused one tells its own seed and spacing, which the config may not."""
    metadata: Mapping[str, str] = getattr(drive, "metadata", {})
    return {"pairs": str(len(drive)), **{f"drive {key}": value for key, value in metadata.items()}}
