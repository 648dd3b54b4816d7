"""The main experiment: drive down a corridor, map it, and compare the map with the truth.

Arms, all of the same drive: a perfect rig with true poses; the default camera and odometry noise; and the
controls: true depth (the ceiling: what the grid could do with perfect matching) and shuffled poses (no map).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sim.noise import NoisyImages, image_noise
from sim.record import record_drive
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig, save_config
from stereogrid.figures import reliability_figure, save_figure
from stereogrid.mapping_run import Mapped, build_map, draw_map
from stereogrid.motion import MotionError, NoisyOdometry, OdometryNoise
from stereogrid.observation import Disparity, Observation, Recording
from stereogrid.recording import ShuffledPoses, TruePoses, open_recording
from stereogrid.report import ReportFigure, write_metrics, write_report
from stereogrid.runs import finished_path, run_folder
from stereogrid.scoring import Score, scores_to_dict
from stereogrid.scoring.truth import MapTruth
from stereogrid.sensor_model import SensorModel

from .parallel import Stage, in_parallel

IDEAL, NOISY, TRUE_DEPTH, SHUFFLED = "ideal", "noisy", "true depth", "shuffled poses"
HEADLINE = (
    "auc",
    "occupied_precision",
    "occupied_recall",
    "occupied_f1",
    "coverage_occupied",
    "brier_balanced",
    "log_loss",
    "ece_width",
    "accuracy_m",
    "completeness_m",
)
"""What the table on the screen shows of the scores in metrics.json."""


@dataclass(frozen=True)
class CorridorConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them.

    seed paints the world, noise_seed draws the noise of cameras and odometry. every_m: distance between two
    pairs [m]. distance_m: how much of the path is driven, 0 = all [m]. score_range_m: the visible set reaches so
    far [m]. image_noise: a preset of sim.noise.
    """

    seed: int = 0
    noise_seed: int = 1
    every_m: float = 0.2
    distance_m: float = 0.0
    score_range_m: float = 5.0
    image_noise: str = "mild"
    odometry_noise: OdometryNoise = field(
        default_factory=lambda: OdometryNoise(
            rotation_per_rad=1e-4, rotation_per_m=1e-6, translation_per_m=1e-5, translation_per_rad=1e-5
        )
    )
    mapping: MappingConfig = field(
        default_factory=lambda: MappingConfig(
            matcher=MatcherConfig("bm", num_disparities=80),
            model=SensorModel(max_range_m=5.0),
            grid=GridConfig(cell_m=0.05),
        )
    )
    motion_error: MotionError = field(default_factory=lambda: MotionError(a_m=1e-5))


@dataclass(frozen=True)
class Outcome:
    """One arm's map and its scores."""

    mapped: Mapped
    scores: list[Score]

    def value(self, name: str) -> float:
        """The score of that name."""
        return next(score.value for score in self.scores if score.name == name)


def run(config: CorridorConfig, stage: Stage, *, runs: Path, command: str, recording: Path | None) -> tuple[Path, Any]:
    """Record (or reuse) the drive, map it in every arm, score, draw, report; the run folder and the outcomes."""
    with run_folder(runs, "corridor") as folder:
        drive = open_recording(recording or record(config, folder / "drive.mcap", stage))
        outcomes = score_arms(drive, config, stage)
        with stage("drawing", 1) as step:
            write_results(folder, drive, outcomes, config=config, command=command)
            step()
    return finished_path(folder), outcomes


def record(config: CorridorConfig, path: Path, stage: Stage) -> Path:
    """Simulate the drive into an MCAP file."""
    with stage("driving", 1) as step:
        return record_drive(
            path,
            world="corridor",
            seed=config.seed,
            every_m=config.every_m,
            max_distance_m=config.distance_m or None,
            progress=step.to,
        )


def arms(drive: Recording, config: CorridorConfig) -> dict[str, Callable[[], Mapped]]:
    """How each arm makes its map; all read the same drive."""
    noisy = NoisyImages(
        NoisyOdometry(drive, config.odometry_noise, config.noise_seed),
        image_noise(config.image_noise),
        config.noise_seed,
    )
    perfect = config.mapping
    moving = MappingConfig(perfect.matcher, perfect.model, config.motion_error, perfect.grid)
    return {
        IDEAL: partial(build_map, TruePoses(drive), perfect),
        NOISY: partial(build_map, noisy, moving),
        TRUE_DEPTH: partial(build_map, TruePoses(drive), perfect, disparity_of=partial(true_disparity, drive)),
        SHUFFLED: partial(build_map, ShuffledPoses(TruePoses(drive), config.noise_seed), perfect),
    }


def true_disparity(drive: Recording, observation: Observation) -> Disparity:
    """The disparity of the true depth, exact to TRUE_SIGMA_PX."""
    assert observation.truth is not None and observation.truth.depth_m is not None
    disparity_px = drive.camera.disparity_px(observation.truth.depth_m).astype(np.float32)
    return Disparity(disparity_px, np.full_like(disparity_px, TRUE_SIGMA_PX))


TRUE_SIGMA_PX = 0.05
"""Small against any matcher's, large enough that the sensor model stays smooth."""


def score_arms(drive: Recording, config: CorridorConfig, stage: Stage) -> dict[str, Outcome]:
    """Map the drive in every arm and score the maps against one visible set."""
    jobs: dict[str, Callable[[], Any]] = {
        "truth": partial(
            MapTruth.of_recording, drive, config.mapping.grid.cell_m, max_range_m=config.score_range_m
        ),
        **arms(drive, config),
    }
    with stage("mapping", len(jobs)) as step:
        results = in_parallel(jobs, step)
    truth: MapTruth = results.pop("truth")
    with stage("scoring", len(results)) as step:
        scores = in_parallel({name: partial(truth.score, mapped.grid) for name, mapped in results.items()}, step)
    return {name: Outcome(mapped, scores[name]) for name, mapped in results.items()}
