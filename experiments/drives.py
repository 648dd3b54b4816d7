"""What the experiments on simulated drives share: the drive, the scores of a map, and which of them come first."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from sim.faults import PRESETS
from sim.record import record_drive
from sim.rendering.renderers import RASTER
from sim.rig import MINORU, StereoRig, webcam
from sim.robot.pioneer import SimulationError
from sim.worlds.world import WORLDS, WorldPlan
from stereogrid.camera import StereoCamera
from stereogrid.described import Doc, check_fields
from stereogrid.errors import RecordingError
from stereogrid.grid import OccupancyGrid
from stereogrid.mapping_run import Mapped
from stereogrid.observation import Disparity, Observation, Recording
from stereogrid.recording import open_recording
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
FEWEST_PAIRS = 2
TRUE_SIGMA_PX = 0.05
"""Of the true disparity: small against any matcher's, large enough that the sensor model stays smooth."""
OBSTACLES_M = (0.15, 2.4)
"""Heights between the floor and the ceiling of the corridor [m]."""
OBSTACLE_SCORES = ("auc", "occupied_precision", "occupied_recall", "occupied_f1")
# Words of parameters that several experiments have.
WORLD = Doc("The world that is driven through.", choices=tuple(WORLDS))
WIDTH = Doc("Width of the images; the cameras stay 42 degrees wide.", "px", above=0)
HEIGHT = Doc("Height of the images.", "px", above=0)
EVERY = Doc("Distance between two pairs.", "m", above=0)
DISTANCE = Doc("How much of the path is driven; 0: all.", "m", least=0)
OBSTACLES = Doc("Heights above the ground of the cells that are scored as obstacles, the lower first.", "m")
CAMERA_FAULTS = Doc(f"A preset, with changes to it as docs/simulator.md has them: {', '.join(PRESETS)}.")
N_SEEDS = Doc("Noise is drawn with the seeds 1, 2, ... so many.", above=0)
NUM_DISPARITIES = Doc("Disparities searched on the drive.", "px", above=0)


def obstacle_meanings(heights_m: Sequence[float]) -> dict[str, str]:
    """What the scores of the obstacles are, for a report; heights_m: the lowest and the highest above the ground."""
    return {
        f"obstacle_{name}": f"{name} of the cells {heights_m[0]} to {heights_m[1]} m above the ground"
        for name in OBSTACLE_SCORES
    }


OBSTACLE_MEANINGS = obstacle_meanings(OBSTACLES_M)


@dataclass(frozen=True)
class DriveConfig:
    """A simulated drive; the cameras are 42 degrees wide, whatever their images' size."""

    world: Annotated[str, WORLD] = "corridor"
    seed: Annotated[int, Doc("Paints and furnishes the world.", least=0)] = 0
    every_m: Annotated[float, EVERY] = 0.25
    distance_m: Annotated[float, DISTANCE] = 0.0
    people: Annotated[int, Doc("So many walk about.", least=0)] = 0
    width_px: Annotated[int, WIDTH] = MINORU.width_px
    height_px: Annotated[int, HEIGHT] = MINORU.height_px

    def __post_init__(self) -> None:
        WorldPlan(self.world, self.seed, self.people)
        _ = self.rig
        check_fields(self)

    @property
    def rig(self) -> StereoRig:
        """The cameras on the robot."""
        return StereoRig(webcam(self.width_px, self.height_px))


def record(drive: DriveConfig, path: Path, stage: Stage) -> Path:
    """Simulate the drive into an MCAP file.

    A robot that is stuck or falls ends the drive, not the experiment: the recording's metadata say why, and so does
    `about`. Raises SimulationError when it never moved.
    """
    with stage("driving", 1) as step:
        try:
            record_drive(
                path,
                world=drive.world,
                seed=drive.seed,
                people=drive.people,
                rig=drive.rig,
                every_m=drive.every_m,
                max_distance_m=drive.distance_m or None,
                progress=step.to,
            )
        except SimulationError as error:
            if len(open_recording(path)) < FEWEST_PAIRS:
                raise SimulationError(f"{error.__cause__}, before there was anything to map") from error
            print(f"{error.__cause__}; going on with the drive up to there", file=sys.stderr)
    return path


def open_drive(path: Path) -> Recording:
    """A recorded drive that is to be scored. Raises RecordingError when it was drawn for a quick look alone."""
    drive = open_recording(path)
    renderer = _metadata(drive).get("renderer", RASTER)
    if renderer != RASTER:
        raise RecordingError(f"{path}: drawn by the renderer {renderer!r}, which is never for scores; use {RASTER!r}")
    return drive


def true_disparity(camera: StereoCamera, observation: Observation) -> Disparity:
    """The disparity of the true depth (H, W)."""
    if observation.truth is None or observation.truth.depth_m is None:
        raise RecordingError("the recording carries no true depth, so the ceiling cannot be mapped")
    depth_m = observation.truth.depth_m
    disparity_px = camera.disparity_px(np.where(depth_m > 0, depth_m, np.nan)).astype(np.float32)
    disparity_px[disparity_px == 0] = np.nan  # infinitely far
    return Disparity(disparity_px, np.full_like(disparity_px, TRUE_SIGMA_PX))


def score(truth: MapTruth, obstacles: MapTruth, mapped: Mapped, *, intervals: bool = False) -> list[Score]:
    """Every score of a map, and those of the obstacles alone: floor and ceiling are easy, and half of the cells."""
    return score_grid(truth, obstacles, mapped.grid, intervals=intervals)


def score_grid(
    truth: MapTruth, obstacles: MapTruth, grid: OccupancyGrid, *, surface: bool = True, intervals: bool = False
) -> list[Score]:
    """The same of a grid; without those of the surface, which take the most time, where surface is False."""
    among = obstacles.score(grid, prior=grid.model.prior, surface=False, intervals=intervals)
    named = (replace(each, name=f"obstacle_{each.name}") for each in among if each.name in OBSTACLE_SCORES)
    return [*truth.score(grid, prior=grid.model.prior, surface=surface, intervals=intervals), *named]


def about(drive: Recording) -> dict[str, str]:
    """Facts of a drive for a report: a reused one tells its own seed and spacing, which the config may not."""
    return {"pairs": str(len(drive)), **{f"drive {key}": value for key, value in _metadata(drive).items()}}


def world_of(drive: Recording) -> str:
    """The world of a simulated drive; "unknown" where it does not say."""
    return _metadata(drive).get("world", "unknown")


def _metadata(drive: Recording) -> Mapping[str, str]:
    metadata: Mapping[str, str] = getattr(drive, "metadata", {})
    return metadata
