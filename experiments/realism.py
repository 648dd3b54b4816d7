"""How real is it? Matching and image statistics of simulated pairs, preset by preset, beside those of real pairs.

A simulated image is good for this project when a matcher fares on it as it does on photographs: as many pixels matched,
as many of them wrong. Statistics of the image say why it does or does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

from sim.faults import PRESETS, camera_faults
from sim.worlds.world import WORLDS
from stereogrid.described import Doc, check_fields
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path

from .drives import DISTANCE
from .parallel import Stage, in_parallel
from .realism_measures import measures
from .realism_report import Measured, write_results
from .realism_scenes import Scene, real_scenes, simulated_scenes


@dataclass(frozen=True)
class RealismConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them."""

    worlds: Annotated[tuple[str, ...], Doc("Of the simulation.", choices=tuple(WORLDS))] = field(
        default_factory=lambda: tuple(WORLDS)
    )
    presets: Annotated[tuple[str, ...], Doc("Of the cameras' faults.")] = tuple(PRESETS)
    seed: Annotated[int, Doc("Makes the worlds.", least=0)] = 0
    noise_seed: Annotated[int, Doc("Draws the cameras' noise.", least=0)] = 1
    places: Annotated[int, Doc("So many views of each drive, and at most so many of each real sequence.", least=2)] = 10
    distance_m: Annotated[float, DISTANCE] = 0.0

    def __post_init__(self) -> None:
        for world in self.worlds:
            if world not in WORLDS:
                raise unknown_name("world", world, WORLDS)
        for preset in self.presets:
            camera_faults(preset)
        if not (self.worlds and self.presets):
            raise InvalidInputError(
                f"worlds or presets names none; choose from: {', '.join(WORLDS)} and {', '.join(PRESETS)}"
            )
        check_fields(self)


def run(
    config: RealismConfig, stage: Stage, *, runs: Path, data: Path | None = None, command: str = ""
) -> tuple[Path, list[ReportTable]]:
    """Measure every scene that there is; the run folder and the tables for the screen. data: none: simulated alone."""
    if data is not None and not data.is_dir():
        raise InvalidInputError(f"{data}: no such folder of data")
    run_of = RunRecord.of("experiments realism", command).reading(("data", data))
    with recorded_run(runs, "realism", run_of, config) as folder:
        real, skipped = real_scenes(data, config.places)  # first: damaged data are refused early
        measured = measure([*real, *drive_through(config, stage)], stage)
        with stage("drawing", 1):
            facts = {"command": command, "worlds": ", ".join(config.worlds), "seed": str(config.seed)}
            tables = write_results(folder, measured, skipped=skipped, facts=facts, config=config)
    return finished_path(folder), tables


def drive_through(config: RealismConfig, stage: Stage) -> list[Scene]:
    """The scenes of every world with every preset."""
    given = {"seed": config.seed, "noise_seed": config.noise_seed, "places": config.places}
    make = partial(simulated_scenes, presets=config.presets, distance_m=config.distance_m, **given)
    with stage("driving through the worlds", len(config.worlds)) as step:
        found = in_parallel({world: partial(make, world) for world in config.worlds}, step)
    return [scene for scenes in found.values() for scene in scenes]


def measure(scenes: Sequence[Scene], stage: Stage) -> list[Measured]:
    """Each scene with its numbers, in order."""
    with stage("measuring", len(scenes)) as step:
        found = in_parallel({k: partial(_measure, each) for k, each in enumerate(scenes)}, step)
    return [Measured(each, found[k]) for k, each in enumerate(scenes)]


def _measure(scene: Scene) -> dict[str, float]:
    return measures(
        scene.left,
        scene.right,
        num_disparities=scene.num_disparities,
        truth_px=scene.truth_px,
        visible=scene.visible,
    )
