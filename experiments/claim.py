"""Does the motion error in the sensor model make better maps, and is the error bounded? The paper's claim, tested.

The same recorded drives, the same matched images, and in every arm the same noise of the poses, seed by seed: true
poses with an error of known size, of which each arm's mapper is told and makes what it will (stereogrid.motion.WAYS).
A unit that is finished is kept: stopped and started again, the experiment goes on where it was.
"""

import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import Event

from stereogrid.config import MappingConfig
from stereogrid.errors import InvalidInputError
from stereogrid.mapping_run import untracked
from stereogrid.motion import MotionError
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path
from stereogrid.scoring import Score

from .claim_config import Arm, ClaimConfig, NoiseConfig, TuneConfig, telling
from .claim_report import check_place, publish_results, write_claim, write_tuning
from .claim_units import (
    ANY,
    BOUND,
    CODE,
    CONTROLS,
    MAP,
    PRIOR,
    SHUFFLED,
    TRUE_DEPTH,
    Scene,
    Sight,
    Task,
    Unit,
    scores_of,
)
from .kept import NO_SCORE_DEPENDS_ON, KeptScores, code_key, key_of
from .kept_drives import kept_drive
from .parallel import Stage, in_parallel, until

TOLD_ZERO = "told zero: "
Results = Mapping[Unit, list[Score]]


def run(
    config: ClaimConfig, stage: Stage, *, runs: Path, work: Path, publish: Path | None = None, command: str = ""
) -> tuple[Path, list[ReportTable]]:
    """Test the claim; the run folder and the tables for the screen. work: where finished units are kept."""
    if publish is not None:
        check_place(publish)  # not after hours
    run_of = RunRecord.of("experiments claim", command)
    found, failed = compute(config, stage, work)
    with recorded_run(runs, "claim", run_of, config) as folder:
        tables = write_claim(folder, config, found, failed=failed, facts={"command": command}, stage=stage)
    if publish is not None:
        publish_results(finished_path(folder), found, publish)
    return finished_path(folder), tables


def tune(
    config: TuneConfig, stage: Stage, *, runs: Path, work: Path, command: str = ""
) -> tuple[Path, list[ReportTable]]:
    """Try candidates on worlds that are not scored; the run folder and the table for the screen."""
    run_of = RunRecord.of("experiments claim-tune", command)
    found, _ = compute(config, stage, work)
    with recorded_run(runs, "claim-tune", run_of, config) as folder:
        tables = write_tuning(folder, config, found, command=command)
    return finished_path(folder), tables


@dataclass(frozen=True)
class Job:
    """A unit that is to be made, and the key that it is kept under."""

    unit: Unit
    task: Task
    key: str


def compute(config: ClaimConfig, stage: Stage, work: Path) -> tuple[dict[Unit, list[Score]], dict[Unit, str]]:
    """The scores of every unit, made or kept; and why units failed, which are left out.

    Raises InvalidInputError when all failed.
    """
    kept = KeptScores(work / "units")
    scenes = open_scenes(config, stage, work)
    code = code_key(CODE, but=NO_SCORE_DEPENDS_ON)
    jobs = [Job(unit, task, key_of(code, scenes[unit.world].key, task)) for unit, task in tasks(config)]
    failed = make(jobs, scenes, kept, stage)
    # Read back even where they were made just now: what is kept is what counts.
    found = {job.unit: scores for job in jobs if (scores := kept.get(job.key)) is not None}
    if not found:
        unit, why = next(iter(failed.items()))
        raise InvalidInputError(f"no unit could be made; the first, {name_of(unit)}: {why}")
    return found, failed


def make(jobs: list[Job], scenes: Mapping[str, Scene], kept: KeptScores, stage: Stage) -> dict[Unit, str]:
    """Make and keep what is not kept yet, two units at a time; why units failed."""
    stop, failed = Event(), {}
    with stage("mapping", len(jobs)) as step:
        missing = []
        for job in jobs:
            if kept.get(job.key) is None:
                missing.append(job)
            else:
                step()

        def attempt(job: Job) -> None:
            try:
                scores = scores_of(scenes[job.unit.world], job.task, until(stop, untracked))
                kept.keep(job.key, scores, job.unit)
            except CancelledError:
                raise
            except Exception as error:
                failed[job.unit] = f"{type(error).__name__}: {error}"

        in_parallel({job.key: partial(attempt, job) for job in missing}, step, stop)
    for unit, why in failed.items():
        print(f"failed: {name_of(unit)}: {why}", file=sys.stderr)
    return failed


def name_of(unit: Unit) -> str:
    """A unit, for a person."""
    return f"{unit.world}, {unit.noise}, seed {unit.seed}, {unit.fusion}, {unit.way}"


def open_scenes(config: ClaimConfig, stage: Stage, work: Path) -> dict[str, Scene]:
    """The drive through each world, recorded unless it was, and its truth."""
    paths = {world: kept_drive(config.drive(world), work / "drives", stage) for world in config.worlds}
    cell_m, range_m = config.mapping.grid.cell_m, config.mapping.model.max_range_m
    with stage("finding what the cameras could see", len(paths)) as step:
        jobs = {world: partial(Scene, path, cell_m=cell_m, range_m=range_m) for world, path in paths.items()}
        return in_parallel(jobs, step)


def tasks(config: ClaimConfig) -> Iterator[tuple[Unit, Task]]:
    """Every unit and what makes it, seed by seed: what is there when time is up is whole."""
    for seed in range(1, max(config.n_seeds, config.bound_seeds) + 1):
        for world in config.worlds:
            for noise in config.noises:
                for arm in config.arms:
                    yield from _of_arm(config, Unit(world, noise.name, seed, ANY, arm.name), noise, arm)
    for seed in range(1, config.control_seeds + 1):
        for world in config.worlds:
            for fusion in config.fusions:
                yield from _controls(config, Unit(world, CONTROLS, seed, fusion, ""))


def _of_arm(config: ClaimConfig, unit: Unit, noise: NoiseConfig, arm: Arm) -> Iterator[tuple[Unit, Task]]:
    """The maps by each rule of fusion, and the test of the bound, which no fusion has a part in."""
    # Poses without noise leave a seed nothing else to draw than the cameras' noise.
    camera_seed = unit.seed if noise.error.is_zero else config.camera_seed
    for fusion in config.fusions_of(arm):
        if unit.seed not in config.seeds_of(arm, noise, fusion):
            continue
        told = config.told(arm, noise, fusion)
        yield replace(unit, fusion=fusion), _task(config, MAP, told, noise.error, (unit.seed, camera_seed))
    if unit.seed in config.bounded(noise):
        told = config.told(arm, noise, config.fusions[0])
        yield unit, _task(config, BOUND, told, noise.error, (unit.seed, camera_seed))


def _controls(config: ClaimConfig, unit: Unit) -> Iterator[tuple[Unit, Task]]:
    """True depth: the ceiling. Shuffled poses must collapse, nothing seen is chance, an error of zero is none.

    Poses are exact and the cameras' noise is one: but for shuffling a seed has nothing to draw, and the first is all.
    """
    exact, seeds = MotionError(), (unit.seed, config.camera_seed)
    reference = telling(config.of_arm(config.by_arm[config.reference], unit.fusion), exact)
    for kind in (TRUE_DEPTH, SHUFFLED, PRIOR) if unit.seed == 1 else (SHUFFLED,):
        yield replace(unit, way=kind), _task(config, kind, reference, exact, seeds)
    for arm in config.arms if unit.seed == 1 else ():
        if unit.fusion not in config.fusions_of(arm):
            continue
        told = telling(config.of_arm(arm, unit.fusion), exact)
        yield replace(unit, way=TOLD_ZERO + arm.name), _task(config, MAP, told, exact, seeds)


def _task(config: ClaimConfig, kind: str, mapping: MappingConfig, error: MotionError, seeds: tuple[int, int]) -> Task:
    seed, camera_seed = seeds
    return Task(kind, Sight(mapping.matcher, config.camera_faults, camera_seed), error, seed, mapping, config.surface)
