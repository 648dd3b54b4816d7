"""Where does a map's error come from? Causes of error made true, or real, one at a time, on the same drives.

Everything else is the same in every arm, unit by unit: the world, the way, the cameras' faults, the odometry's noise.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import Event
from typing import Annotated

from sim.faults import camera_faults
from sim.rig import MINORU
from stereogrid.config import GridConfig, MappingConfig
from stereogrid.described import Doc, check_fields
from stereogrid.errors import InvalidInputError
from stereogrid.grid import OccupancyGrid
from stereogrid.mapper import Mapper
from stereogrid.mapping_run import Track
from stereogrid.motion import Growth, MotionError
from stereogrid.observation import Recording
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path
from stereogrid.scoring import Score
from stereogrid.scoring.map_scores import ScoredMap
from stereogrid.scoring.truth import MapTruth

from .budget_arms import FUSION, Arm, MapMade, budget_arms
from .budget_oracles import Labelled, Recalibrated
from .budget_report import Budget, Unit, write_results
from .drive_experiment import bm_mapping
from .drives import (
    CAMERA_FAULTS,
    DISTANCE,
    EVERY,
    N_SEEDS,
    OBSTACLES,
    OBSTACLES_M,
    DriveConfig,
    about,
    open_drive,
    record,
    world_of,
)
from .faulty_drive import FaultyDrive
from .parallel import Stage, counted, in_parallel, until

WAY_15_M = MotionError(
    along=Growth(a=1e-4, b=0.005),
    across=Growth(a=2e-5),
    heading=Growth(a=2e-5, b=5e-4),
    turn=Growth(a=2e-4),
)
"""Of wheels on a smooth floor, calibrated: after 15 m some 8 cm along the way, and 1.1 degrees of heading."""


def budget_mapping() -> MappingConfig:
    """Block matching up to 4 m in cells of 5 cm; odometry that errs, and a map that is told so."""
    return replace(bm_mapping(range_m=4.0, cell_m=0.05), motion_error=WAY_15_M)


@dataclass(frozen=True)
class BudgetConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them."""

    worlds: Annotated[tuple[str, ...], Doc("One drive each.")] = ("corridor", "office", "entrance")
    world_seed: Annotated[int, Doc("Paints and furnishes the worlds.", least=0)] = 0
    every_m: Annotated[float, EVERY] = 0.25
    distance_m: Annotated[float, DISTANCE] = 15.0
    n_seeds: Annotated[int, N_SEEDS] = 3
    camera_faults: Annotated[str, CAMERA_FAULTS] = "minoru"
    mapping: Annotated[
        MappingConfig, Doc("How every arm maps; its motion_error is how odometry errs, and what the map is told.")
    ] = field(default_factory=budget_mapping)
    finer: Annotated[
        int, Doc("Cells made true are divided so often, and their map laid back into cells of the usual size.", least=2)
    ] = 2
    finest: Annotated[int, Doc("The same once more, in an arm of its own: beyond finer, or 0 for none.")] = 4
    obstacles_m: Annotated[tuple[float, ...], OBSTACLES] = OBSTACLES_M

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        self.mapping.build_mapper(MINORU)
        if not self.worlds or len(set(self.worlds)) < len(self.worlds):
            raise InvalidInputError("worlds must name at least one world, and none twice")
        check_fields(self, but=("finer",))
        if self.finer < 2 or (self.finest and self.finest <= self.finer):
            raise InvalidInputError(
                f"finer must be 2 or more, and finest beyond it or 0, not {self.finer} and {self.finest}"
            )
        if len(self.obstacles_m) != 2 or not self.obstacles_m[0] < self.obstacles_m[1]:
            raise InvalidInputError(f"obstacles_m must be two heights, the lower first, not {self.obstacles_m}")
        _ = self.drives

    @property
    def drives(self) -> list[DriveConfig]:
        """The drives to be simulated."""
        return [DriveConfig(world, self.world_seed, self.every_m, self.distance_m) for world in self.worlds]

    @property
    def arms(self) -> dict[str, Arm]:
        """Every arm by name."""
        return budget_arms(self.finer, self.finest)


@dataclass(frozen=True)
class TrueDrive:
    """A recorded drive and what its maps are scored against: all that was in view, and of it the obstacles."""

    recording: Recording
    truth: MapTruth
    obstacles: MapTruth

    @classmethod
    def of(cls, recording: Recording, config: BudgetConfig) -> "TrueDrive":
        """Scored in the usual cells, within the range that is mapped."""
        mapping = config.mapping
        truth = MapTruth.of_recording(
            recording, mapping.grid.cell_m, max_range_m=mapping.model.max_range_m, around_path=True
        )
        return cls(recording, truth, truth.above_ground(*config.obstacles_m))


def run(
    config: BudgetConfig, stage: Stage, *, runs: Path, recordings: Sequence[Path] = (), command: str = ""
) -> tuple[Path, list[ReportTable]]:
    """Map every drive with every seed in every arm; the run folder and the tables for the screen.

    recordings: drives to be used instead of new ones.
    """
    reused = [open_drive(path) for path in recordings]
    first, *others = recordings or [None]
    run_of = RunRecord.of("experiments budget", command, first, made=f"drive-{config.worlds[0]}.mcap")
    with recorded_run(runs, "budget", run_of.reading(*(("recording", each) for each in others)), config) as folder:
        drives = reused or [
            open_drive(record(drive, folder / f"drive-{drive.world}.mcap", stage)) for drive in config.drives
        ]
        budget = Budget(measure(drives, config, stage), config.arms, config.finest)
        with stage("drawing", 1):
            tables = write_results(folder, budget, facts=_facts(drives, command), config=config)
    return finished_path(folder), tables


def measure(drives: Sequence[Recording], config: BudgetConfig, stage: Stage) -> dict[str, dict[Unit, list[Score]]]:
    """scores[arm][world, seed]. Raises InvalidInputError for two drives of one world."""
    worlds = [world_of(drive) for drive in drives]
    if len(set(worlds)) < len(worlds):
        raise InvalidInputError(f"the drives must be of different worlds, not of {', '.join(worlds)}")
    with stage("finding what the cameras could see", len(drives)) as step:
        truths = in_parallel({w: partial(TrueDrive.of, d, config) for w, d in zip(worlds, drives, strict=True)}, step)
    seeds, stop = range(1, config.n_seeds + 1), Event()
    passes = len({arm.map_made.seen for arm in config.arms.values()})
    with stage("mapping", len(seeds) * passes * sum(len(drive) for drive in drives)) as step:
        track = until(stop, counted(step))
        jobs = {
            (world, seed): partial(one_unit, truths[world], config, seed, track) for world in worlds for seed in seeds
        }
        found = in_parallel(jobs, stop=stop)
    units = [(world, seed) for world in worlds for seed in seeds]
    return {arm: {unit: found[unit][arm] for unit in units} for arm in config.arms}


def one_unit(drive: TrueDrive, config: BudgetConfig, seed: int, track: Track) -> dict[str, list[Score]]:
    """The scores of every arm on one drive with one seed."""
    arms = config.arms
    faulty = FaultyDrive(drive.recording, camera_faults(config.camera_faults), config.mapping.motion_error, seed)
    maps = make_maps(faulty, {arm.map_made for arm in arms.values()}, config.mapping, track)
    return {name: score_arm(drive, arm, maps[arm.map_made]) for name, arm in arms.items()}


def make_maps(
    faulty: FaultyDrive, wanted: Iterable[MapMade], mapping: MappingConfig, track: Track
) -> dict[MapMade, OccupancyGrid]:
    """The maps, all in the mapping's cells. Each pair is matched once, and read by all maps that see it alike."""
    claimed = {odometry: faulty.poses(true=not odometry) for odometry in (False, True)}
    wanted, found = sorted(wanted, key=repr), {}
    for seen in sorted({made.seen for made in wanted}):
        images, matcher, calibration = seen
        mappers = {made: _mapper(faulty, made, mapping) for made in wanted if made.seen == seen}
        readings = faulty.readings(mapping.matcher if matcher else None, images=images, calibration=calibration)
        for observation, disparity in track(readings, "mapping", len(faulty.drive)):
            for made, mapper in mappers.items():
                mapper.fuse(claimed[made.odometry](observation), disparity)
        for mapper in mappers.values():
            mapper.finish()
        found |= {made: _in_usual_cells(mapper.grid, made) for made, mapper in mappers.items()}
    return found


def _mapper(faulty: FaultyDrive, made: MapMade, mapping: MappingConfig) -> Mapper:
    """An empty map in cells as fine as wanted, which is told the odometry's error where there is one."""
    grid: GridConfig = replace(mapping.grid, cell_m=mapping.grid.cell_m / made.finer)
    error = mapping.motion_error if made.odometry else MotionError()
    return replace(mapping, grid=grid, motion_error=error).build_mapper(faulty.drive.camera)


def _in_usual_cells(grid: OccupancyGrid, made: MapMade) -> OccupancyGrid:
    """A cell is as occupied as the likeliest of its parts: as the labels have it, which any touch makes occupied."""
    return grid.coarsened(made.finer) if made.finer > 1 else grid


def score_arm(drive: TrueDrive, arm: Arm, grid: OccupancyGrid) -> list[Score]:
    """Every score but those of the surface, of all that was in view and of the obstacles."""
    judged: ScoredMap = grid
    if arm.labels:
        judged = Labelled(grid, drive.truth.labels)
    elif FUSION not in arm.real:
        judged = Recalibrated.by(drive.truth, grid)
    prior = grid.model.prior
    among = drive.obstacles.score(judged, prior=prior, surface=False)
    of_obstacles = (replace(each, name=f"obstacle_{each.name}") for each in among)
    return [*drive.truth.score(judged, prior=prior, surface=False), *of_obstacles]


def _facts(drives: Sequence[Recording], command: str) -> Mapping[str, str]:
    return {"command": command} | {
        f"drive {world_of(drive)}": ", ".join(f"{k} {v}" for k, v in about(drive).items()) for drive in drives
    }
