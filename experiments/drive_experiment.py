"""One simulated drive, mapped in several arms and scored against the truth; corridor.py and outdoor.py say which drive.

Arms, all of the same drive: a perfect rig with true poses; the default camera and odometry noise; where it is wanted
the same with the true tilt, of which wheels know nothing; and the controls: true depth (the ceiling: what the grid
could do with perfect matching) and shuffled poses, whose map must be no better than chance away from the ground.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from sim.faults import FaultyCameras, camera_faults
from sim.rig import MINORU
from sim.robot.wheel_faults import FaultyWheels, wheel_faults
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig, save_config
from stereogrid.errors import InvalidInputError
from stereogrid.mapping_run import Mapped, Track, build_map
from stereogrid.motion import Growth, MotionError, NoisyOdometry, OdometryNoise
from stereogrid.observation import Recording
from stereogrid.recording import ShuffledPoses, TruePoses, TrueTilt
from stereogrid.runs import finished_path, run_folder
from stereogrid.scoring.truth import MapTruth
from stereogrid.sensor_model import SensorModel

from .drive_report import IDEAL, KNOWN_TILT, NOISY, SHUFFLED, TRUE_DEPTH, Outcome, Story, write_results
from .drives import OBSTACLES_M, DriveConfig, about, open_drive, record, score, true_disparity
from .parallel import Stage, counted, in_parallel


@dataclass(frozen=True)
class DriveExperimentConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them.

    seed makes the world, noise_seed draws the noise of cameras and odometry. every_m: distance between two
    pairs [m]. distance_m: how much of the path is driven, 0 = all [m]. score_range_m: the visible set reaches so
    far [m]. obstacles_m: the heights above the ground of the cells that are scored as obstacles [m]. people: so
    many walk about. camera_faults: a text for sim.faults.camera_faults. wheel_faults: a preset of
    sim.robot.wheel_faults, under odometry_noise. known_tilt: whether there is an arm that knows the true height,
    roll and pitch. noisy_motion_error: eps of the noisy arms, in place of mapping's.
    """

    world: str = "corridor"
    seed: int = 0
    noise_seed: int = 1
    every_m: float = 0.25
    distance_m: float = 0.0
    score_range_m: float = 5.0
    obstacles_m: tuple[float, float] = OBSTACLES_M
    people: int = 0
    camera_faults: str = "mild"
    wheel_faults: str = "none"
    known_tilt: bool = False
    odometry_noise: OdometryNoise = field(
        default_factory=lambda: OdometryNoise(
            rotation_per_rad=1e-4, rotation_per_m=1e-6, translation_per_m=1e-5, translation_per_rad=1e-5
        )
    )
    mapping: MappingConfig = field(default_factory=lambda: bm_mapping(range_m=5.0, cell_m=0.05))
    noisy_motion_error: MotionError = field(default_factory=lambda: MotionError(along=Growth(a=1e-5)))

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        wheel_faults(self.wheel_faults)
        self.mapping.build_mapper(MINORU)
        if not (np.isfinite(self.score_range_m) and self.score_range_m > 0):
            raise InvalidInputError(f"score_range_m must be positive and finite, not {self.score_range_m}")
        if not self.noise_seed >= 0:
            raise InvalidInputError(f"noise_seed must be >= 0, not {self.noise_seed}")
        if len(self.obstacles_m) != 2 or not self.obstacles_m[0] < self.obstacles_m[1]:
            raise InvalidInputError(f"obstacles_m must be two heights, the lower first, not {self.obstacles_m}")
        _ = self.drive

    @property
    def drive(self) -> DriveConfig:
        """The drive to be simulated."""
        return DriveConfig(self.world, self.seed, self.every_m, self.distance_m, self.people)


def bm_mapping(*, range_m: float, cell_m: float) -> MappingConfig:
    """Block matching as the experiments on drives use it: depths up to range_m in cells of cell_m [m]."""
    return MappingConfig(
        matcher=MatcherConfig("bm", num_disparities=80),
        model=SensorModel(max_range_m=range_m),
        grid=GridConfig(cell_m=cell_m),
    )


def run_story(
    story: Story,
    config: DriveExperimentConfig,
    stage: Stage,
    *,
    runs: Path,
    command: str = "",
    recording: Path | None = None,
) -> tuple[Path, dict[str, Outcome]]:
    """Record (or reuse) the drive, map it in every arm, score, draw, report; the run folder and the outcomes."""
    reused = open_drive(recording) if recording else None
    with run_folder(runs, story.name) as folder:
        save_config(config, folder / "config.toml")
        drive = reused or open_drive(record(config.drive, folder / "drive.mcap", stage))
        truth, outcomes = score_arms(drive, config, stage)
        with stage("drawing", 5) as step:
            facts = {"command": command, "recording": str(recording or "drive.mcap"), **about(drive)}
            write_results(folder, story, drive, truth, outcomes, facts=facts, heights_m=config.obstacles_m, step=step)
    return finished_path(folder), outcomes


def arms(drive: Recording, config: DriveExperimentConfig, track: Track) -> dict[str, Callable[[], Mapped]]:
    """How each arm makes its map; all read the same drive."""
    noisy = NoisyOdometry(_faulty(drive, config), config.odometry_noise, config.noise_seed)
    true, shuffled = TruePoses(drive), ShuffledPoses(TruePoses(drive), config.noise_seed)
    perfect = partial(build_map, config=config.mapping, track=track)
    moving = replace(config.mapping, motion_error=config.noisy_motion_error)
    tilted = {KNOWN_TILT: partial(build_map, TrueTilt(noisy), moving, track)} if config.known_tilt else {}
    return {
        IDEAL: partial(perfect, true),
        NOISY: partial(build_map, noisy, moving, track),
        **tilted,
        TRUE_DEPTH: partial(perfect, true, disparity_of=partial(true_disparity, drive.camera)),
        SHUFFLED: partial(perfect, shuffled),
    }


def _faulty(drive: Recording, config: DriveExperimentConfig) -> Recording:
    """The drive as its cameras and wheels would have it; without wheel faults it needs no ticks."""
    seen = FaultyCameras(drive, camera_faults(config.camera_faults), config.noise_seed)
    faults = wheel_faults(config.wheel_faults)
    return seen if faults == wheel_faults("none") else FaultyWheels(seen, faults, config.noise_seed)


def score_arms(drive: Recording, config: DriveExperimentConfig, stage: Stage) -> tuple[MapTruth, dict[str, Outcome]]:
    """Map the drive in every arm and score the maps against one visible set."""
    with stage("mapping", (5 + config.known_tilt) * len(drive)) as step:
        truth_of_drive = partial(
            MapTruth.of_recording,
            drive,
            config.mapping.grid.cell_m,
            max_range_m=config.score_range_m,
            progress=lambda _done, _total: step(),
        )
        results = in_parallel({"truth": truth_of_drive, **arms(drive, config, counted(step))})
    truth: MapTruth = results.pop("truth")
    obstacles = truth.above_ground(*config.obstacles_m)
    with stage("scoring", len(results)) as step:
        jobs = {name: partial(score, truth, obstacles, mapped) for name, mapped in results.items()}
        scores = in_parallel(jobs, step)
    return truth, {name: Outcome(mapped, scores[name]) for name, mapped in results.items()}
