"""One simulated drive, mapped in several arms and scored against the truth; corridor.py and outdoor.py say which drive.

Arms, all of the same drive: a perfect rig with true poses; the default camera and odometry noise; where it is wanted
the same with the true tilt, of which wheels know nothing; and the controls: true depth (the ceiling: what the grid
could do with perfect matching) and shuffled poses, whose map must be no better than chance away from the ground.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated

from sim.faults import FaultyCameras, camera_faults
from sim.rig import MINORU
from sim.robot.wheel_faults import WHEEL_FAULTS, FaultyWheels, wheel_faults
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig
from stereogrid.described import Doc, check_fields
from stereogrid.errors import InvalidInputError
from stereogrid.mapping_run import Mapped, Track, build_map
from stereogrid.motion import Growth, MotionError, NoisyOdometry, OdometryNoise
from stereogrid.observation import Recording
from stereogrid.recorded_run import recorded_run
from stereogrid.recording import ShuffledPoses, TruePoses, TrueTilt
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path
from stereogrid.scoring.truth import MapTruth
from stereogrid.sensor_model import SensorModel

from .drive_report import IDEAL, KNOWN_TILT, NOISY, SHUFFLED, TRUE_DEPTH, Outcome, Story, write_results
from .drives import (
    CAMERA_FAULTS,
    DISTANCE,
    EVERY,
    OBSTACLES,
    OBSTACLES_M,
    WORLD,
    DriveConfig,
    about,
    open_drive,
    record,
    score,
    true_disparity,
)
from .parallel import Stage, counted, in_parallel


@dataclass(frozen=True)
class DriveExperimentConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them."""

    world: Annotated[str, WORLD] = "corridor"
    seed: Annotated[int, Doc("Paints and furnishes the world.", least=0)] = 0
    noise_seed: Annotated[int, Doc("Draws the noise of cameras and odometry.", least=0)] = 1
    every_m: Annotated[float, EVERY] = 0.25
    distance_m: Annotated[float, DISTANCE] = 0.0
    score_range_m: Annotated[float, Doc("Cells seen within this range are scored.", "m", above=0)] = 5.0
    obstacles_m: Annotated[tuple[float, float], OBSTACLES] = OBSTACLES_M
    people: Annotated[int, Doc("So many walk about.", least=0)] = 0
    camera_faults: Annotated[str, CAMERA_FAULTS] = "mild"
    wheel_faults: Annotated[str, Doc("Of the robot, before odometry_noise is added.", choices=tuple(WHEEL_FAULTS))] = (
        "none"
    )
    known_tilt: Annotated[bool, Doc("Whether there is an arm that knows the true height, roll and pitch.")] = False
    width_px: Annotated[int, Doc("Width of the images; the cameras stay 42 degrees wide.", "px", above=0)] = (
        MINORU.width_px
    )
    height_px: Annotated[int, Doc("Height of the images.", "px", above=0)] = MINORU.height_px
    odometry_noise: Annotated[OdometryNoise, Doc("Noise of the noisy arms' odometry.")] = field(
        default_factory=lambda: OdometryNoise(
            rotation_per_rad=1e-4, rotation_per_m=1e-6, translation_per_m=1e-5, translation_per_rad=1e-5
        )
    )
    mapping: Annotated[MappingConfig, Doc("How every arm maps.")] = field(
        default_factory=lambda: bm_mapping(range_m=5.0, cell_m=0.05)
    )
    noisy_motion_error: Annotated[
        MotionError, Doc("What the noisy arms are told of their poses' error, in place of mapping.motion_error.")
    ] = field(default_factory=lambda: MotionError(along=Growth(a=1e-5)))

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        wheel_faults(self.wheel_faults)
        self.mapping.build_mapper(self.drive.rig.camera)
        check_fields(self, but=("world",))
        if len(self.obstacles_m) != 2 or not self.obstacles_m[0] < self.obstacles_m[1]:
            raise InvalidInputError(f"obstacles_m must be two heights, the lower first, not {self.obstacles_m}")

    @property
    def drive(self) -> DriveConfig:
        """The drive to be simulated."""
        size = {"width_px": self.width_px, "height_px": self.height_px}
        return DriveConfig(self.world, self.seed, self.every_m, self.distance_m, self.people, **size)


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
    run_of = RunRecord.of(f"experiments {story.name}", command, recording, made="drive.mcap")
    with recorded_run(runs, story.name, run_of.reading(*config.mapping.matcher.files()), config) as folder:
        drive = reused or open_drive(record(config.drive, folder / "drive.mcap", stage))
        truth, outcomes = score_arms(drive, config, stage)
        with stage("drawing", 6) as step:
            facts = {"command": command, "recording": str(recording or "drive.mcap"), **about(drive)}
            write_results(
                folder,
                story,
                drive,
                truth,
                outcomes,
                facts=facts,
                config=config,
                heights_m=config.obstacles_m,
                step=step,
            )
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
        jobs = {name: partial(score, truth, obstacles, mapped, intervals=True) for name, mapped in results.items()}
        scores = in_parallel(jobs, step)
    return truth, {name: Outcome(mapped, scores[name]) for name, mapped in results.items()}
