"""The main experiment: drive down a corridor, map it, and compare the map with the truth.

Arms, all of the same drive: a perfect rig with true poses; the default camera and odometry noise; and the
controls: true depth (the ceiling: what the grid could do with perfect matching) and shuffled poses, whose map
must be no better than chance away from the floor and the ceiling.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from sim.noise import NoisyImages, image_noise
from sim.rig import MINORU
from stereogrid.camera import StereoCamera
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig, save_config
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.figures import reliability_figure, save_figure
from stereogrid.mapping_run import Mapped, Track, build_map, draw_map
from stereogrid.motion import MotionError, NoisyOdometry, OdometryNoise
from stereogrid.observation import Disparity, Observation, Recording
from stereogrid.recording import ShuffledPoses, TruePoses, open_recording
from stereogrid.report import ReportFigure, write_metrics, write_report
from stereogrid.runs import finished_path, run_folder
from stereogrid.scoring import Score, scores_to_dict
from stereogrid.scoring.truth import MapTruth
from stereogrid.sensor_model import SensorModel

from .drives import HEADLINE, OBSTACLE_MEANINGS, OBSTACLES_M, DriveConfig, about, record, score
from .parallel import Stage, Step, counted, in_parallel

IDEAL, NOISY, TRUE_DEPTH, SHUFFLED = "ideal", "noisy", "true depth", "shuffled poses"
TRUE_SIGMA_PX = 0.05
"""Of the true disparity: small against any matcher's, large enough that the sensor model stays smooth."""


@dataclass(frozen=True)
class CorridorConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them.

    seed paints the world, noise_seed draws the noise of cameras and odometry. every_m: distance between two
    pairs [m]. distance_m: how much of the path is driven, 0 = all [m]. score_range_m: the visible set reaches so
    far [m]. image_noise: a preset of sim.noise. noisy_motion_error: eps of the noisy arm, in place of mapping's.
    """

    seed: int = 0
    noise_seed: int = 1
    every_m: float = 0.25
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
    noisy_motion_error: MotionError = field(default_factory=lambda: MotionError(a_m=1e-5))

    def __post_init__(self) -> None:
        image_noise(self.image_noise)
        self.mapping.build_mapper(MINORU)
        for name in ("every_m", "score_range_m"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InvalidInputError(f"{name} must be positive and finite, not {getattr(self, name)}")
        for name in ("seed", "noise_seed", "distance_m"):
            if not getattr(self, name) >= 0:
                raise InvalidInputError(f"{name} must be >= 0, not {getattr(self, name)}")

    @property
    def drive(self) -> DriveConfig:
        """The drive to be simulated."""
        return DriveConfig("corridor", self.seed, self.every_m, self.distance_m)


@dataclass(frozen=True)
class Outcome:
    """One arm's map and its scores."""

    mapped: Mapped
    scores: list[Score]

    def value(self, name: str) -> float:
        """The score of that name."""
        return next(score.value for score in self.scores if score.name == name)


def run(
    config: CorridorConfig, stage: Stage, *, runs: Path, command: str = "", recording: Path | None = None
) -> tuple[Path, dict[str, Outcome]]:
    """Record (or reuse) the drive, map it in every arm, score, draw, report; the run folder and the outcomes."""
    reused = open_recording(recording) if recording else None
    with run_folder(runs, "corridor") as folder:
        save_config(config, folder / "config.toml")
        drive = reused or open_recording(record(config.drive, folder / "drive.mcap", stage))
        truth, outcomes = score_arms(drive, config, stage)
        with stage("drawing", 5) as step:
            facts = {"command": command, "recording": str(recording or "drive.mcap"), **about(drive)}
            write_results(folder, drive, truth, outcomes, facts=facts, step=step)
    return finished_path(folder), outcomes


def arms(drive: Recording, config: CorridorConfig, track: Track) -> dict[str, Callable[[], Mapped]]:
    """How each arm makes its map; all read the same drive."""
    noisy = NoisyImages(
        NoisyOdometry(drive, config.odometry_noise, config.noise_seed),
        image_noise(config.image_noise),
        config.noise_seed,
    )
    true, shuffled = TruePoses(drive), ShuffledPoses(TruePoses(drive), config.noise_seed)
    perfect = partial(build_map, config=config.mapping, track=track)
    moving = replace(config.mapping, motion_error=config.noisy_motion_error)
    return {
        IDEAL: partial(perfect, true),
        NOISY: partial(build_map, noisy, moving, track),
        TRUE_DEPTH: partial(perfect, true, disparity_of=partial(true_disparity, drive.camera)),
        SHUFFLED: partial(perfect, shuffled),
    }


def true_disparity(camera: StereoCamera, observation: Observation) -> Disparity:
    """The disparity of the true depth (H, W)."""
    if observation.truth is None or observation.truth.depth_m is None:
        raise RecordingError("the recording carries no true depth, so the ceiling cannot be mapped")
    depth_m = observation.truth.depth_m
    disparity_px = camera.disparity_px(np.where(depth_m > 0, depth_m, np.nan)).astype(np.float32)
    disparity_px[disparity_px == 0] = np.nan  # infinitely far
    return Disparity(disparity_px, np.full_like(disparity_px, TRUE_SIGMA_PX))


def score_arms(drive: Recording, config: CorridorConfig, stage: Stage) -> tuple[MapTruth, dict[str, Outcome]]:
    """Map the drive in every arm and score the maps against one visible set."""
    with stage("mapping", 5 * len(drive)) as step:
        truth_of_drive = partial(
            MapTruth.of_recording,
            drive,
            config.mapping.grid.cell_m,
            max_range_m=config.score_range_m,
            progress=lambda _done, _total: step(),
        )
        results = in_parallel({"truth": truth_of_drive, **arms(drive, config, counted(step))})
    truth: MapTruth = results.pop("truth")
    obstacles = truth.between(*OBSTACLES_M)
    with stage("scoring", len(results)) as step:
        jobs = {name: partial(score, truth, obstacles, mapped) for name, mapped in results.items()}
        scores = in_parallel(jobs, step)
    return truth, {name: Outcome(mapped, scores[name]) for name, mapped in results.items()}


def write_results(
    folder: Path,
    drive: Recording,
    truth: MapTruth,
    outcomes: Mapping[str, Outcome],
    *,
    facts: Mapping[str, str],
    step: Step,
) -> None:
    """Maps, metrics, figures and the report of the run, into its folder."""
    for name, outcome in outcomes.items():
        outcome.mapped.grid.save(folder / f"map-{name.replace(' ', '-')}.sgrid")
    write_metrics(folder, {"facts": facts, "arms": {n: scores_to_dict(o.scores) for n, o in outcomes.items()}})
    write_report(
        folder,
        "The corridor experiment",
        summary="A simulated drive down a corridor, mapped by stereo and scored against the true mesh, on the cells "
        "that the cameras could see.",
        arms={name: outcome.scores for name, outcome in outcomes.items()},
        figures=draw(folder, drive, truth, outcomes, step=step),
        facts=facts,
        headline=HEADLINE,
        meanings=OBSTACLE_MEANINGS,
    )


def draw(
    folder: Path, drive: Recording, truth: MapTruth, outcomes: Mapping[str, Outcome], *, step: Step
) -> list[ReportFigure]:
    """The figures of the main arm, and its reliability beside the noisy one's; step after each of the five."""
    main = outcomes[IDEAL].mapped
    section_m = truth.section_m(float(np.median(main.path_m[:, 2])))
    figures = draw_map(main, drive, folder, counted(step), truth_segments_m=section_m)
    for name in (IDEAL, NOISY):
        figure = reliability_figure(truth.reliability(outcomes[name].mapped.grid), title=f"Reliability, {name}")
        path = save_figure(figure, folder / f"reliability-{name}.png")
        figures.append(ReportFigure(path, f"Are the probabilities of the {name} arm frequencies?"))
        step()
    return figures
