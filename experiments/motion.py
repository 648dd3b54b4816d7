"""How does the robot's motion err? Repeated runs over marked lines and turns on each surface, and the fit to them.

Twice: with errors that have causes (wheels, slip, encoders), to see what the fit makes of each surface; and with errors
of known growth on the same true runs, to see whether the fit finds it again, within its intervals.
"""

from dataclasses import dataclass, field
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from typing import Annotated

import numpy as np

from sim.robot.ground import SURFACES, find_surface
from sim.robot.wheel_faults import wheel_faults
from stereogrid.described import Doc, check_fields
from stereogrid.errors import InvalidInputError
from stereogrid.motion import FitOptions, Growth, MotionError, Runs, fit_motion
from stereogrid.motion.fit import BOOTSTRAPS, FEWEST
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path

from .motion_course import WAYS, Course, bumpy, drive, faulty_runs, noisy_runs
from .motion_report import Caused, Recovered, write_results
from .parallel import Stage, in_parallel

INJECTED = MotionError(
    along=Growth(2e-4, 0.01), across=Growth(1e-4, 0.004), heading=Growth(2e-4, 0.01), turn=Growth(1e-3, 0.03)
)


@dataclass(frozen=True)
class MotionConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them."""

    surfaces: Annotated[tuple[str, ...], Doc("Driven over.")] = tuple(SURFACES)
    bumpy: Annotated[tuple[str, ...], Doc("Of these also with bumps, each run over others.")] = ("grass",)
    faults: Annotated[tuple[str, ...], Doc("Presets whose causes are drawn run by run.")] = ("none", "good", "worn")
    injected: Annotated[MotionError, Doc("What is to be found again.")] = field(default_factory=lambda: INJECTED)
    count: Annotated[int, Doc("So many straight runs, and as many turns, in a set.", least=FEWEST)] = 12
    sets: Annotated[int, Doc("So many sets a surface with the injected error.", least=1)] = 10
    resamples: Annotated[int, Doc("Of each bootstrap.", least=100)] = 500
    seed: Annotated[int, Doc("Of all that is drawn.", least=0)] = 0

    def __post_init__(self) -> None:
        if not self.surfaces:
            raise InvalidInputError(f"surfaces names none; choose from: {', '.join(SURFACES)}")
        for surface in (*self.surfaces, *self.bumpy):
            find_surface(surface)
        for faults in self.faults:
            wheel_faults(faults)
        check_fields(self)
        FitOptions(resamples=self.resamples)


def run(config: MotionConfig, stage: Stage, *, runs: Path, command: str = "") -> tuple[Path, list[ReportTable]]:
    """Drive, draw errors, fit; the run folder and the tables for the screen."""
    run_of = RunRecord.of("experiments motion", command)
    with recorded_run(runs, "motion", run_of, config) as folder:
        courses = drive_all(config, stage)
        grounds = {**courses, **drive_over_bumps(config, stage)}
        with stage("errors with causes", len(config.faults) * len(grounds)) as step:
            caused = []
            for n, faults in enumerate(config.faults):
                for ground in grounds.values():
                    caused.append(_caused(config, ground, faults, n))
                    step()
        with stage("known errors", len(config.surfaces) * config.sets) as step:
            recovered = []
            for n, surface in enumerate(config.surfaces):
                for number in range(config.sets):
                    rng = np.random.default_rng([config.seed, 1, n, number])
                    recovered.append(_recovered(config, courses[surface], rng))
                    step()
        with stage("drawing", 1):
            tables = write_results(
                folder, caused, recovered, config.injected, facts={"command": command}, config=config
            )
    return finished_path(folder), tables


def drive_all(config: MotionConfig, stage: Stage) -> dict[str, list[Course]]:
    """The courses on each surface. Each is driven once: it would be the same again."""
    jobs = {(surface, way): partial(drive, surface, way) for surface in config.surfaces for way in WAYS}
    with stage("driving over the marks", len(jobs)) as step:
        driven = in_parallel(jobs, step)
    return {surface: [driven[surface, way] for way in WAYS] for surface in config.surfaces}


def drive_over_bumps(config: MotionConfig, stage: Stage) -> dict[str, list[Course]]:
    """As many courses as there are runs on each bumpy surface, over other bumps each."""
    jobs = {
        (surface, number): partial(drive, surface, way, bumps=config.seed + number)
        for surface in config.bumpy
        for number, way in enumerate(islice(cycle(WAYS), 2 * config.count))
    }
    with stage("driving over bumps", max(len(jobs), 1)) as step:
        driven = in_parallel(jobs, step)
    numbers = range(2 * config.count)
    return {bumpy(surface): [driven[surface, number] for number in numbers] for surface in config.bumpy}


def _caused(config: MotionConfig, courses: list[Course], faults: str, number: int) -> Caused:
    """The fit to the runs of a robot with faults. The same draws on every surface, so that they can be compared."""
    rng = np.random.default_rng([config.seed, 0, number])
    runs = Runs(tuple(faulty_runs(courses, wheel_faults(faults), config.count, rng)))
    return Caused(courses[0].surface, faults, runs, fit_motion(runs, rng))


def _recovered(config: MotionConfig, courses: list[Course], rng: np.random.Generator) -> Recovered:
    """The fits to one set of runs with known errors, by either bootstrap."""
    runs = Runs(tuple(noisy_runs(courses, config.injected, config.count, rng)))
    options = {name: FitOptions(bootstrap=name, resamples=config.resamples) for name in BOOTSTRAPS}
    return Recovered(courses[0].surface, {name: fit_motion(runs, rng, each) for name, each in options.items()})
