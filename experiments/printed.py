"""The chapter's equations as printed against as corrected, on one drive: what goes wrong, in numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import Event
from typing import Annotated

import numpy as np

from sim.faults import camera_faults
from sim.rig import MINORU
from stereogrid.config import MappingConfig
from stereogrid.described import Doc, check_fields
from stereogrid.errors import InvalidInputError
from stereogrid.grid import OccupancyGrid
from stereogrid.mapping_run import Track
from stereogrid.observation import Recording
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path
from stereogrid.scoring import Score
from stereogrid.scoring.map_scores import ScoredMap
from stereogrid.scoring.truth import MapTruth

from .budget import budget_mapping
from .drives import CAMERA_FAULTS, N_SEEDS, OBSTACLES, OBSTACLES_M, DriveConfig, about, open_drive, record
from .faulty_drive import FaultyDrive
from .parallel import Stage, counted, in_parallel, until
from .printed_arms import CORRECTED, CUT_OFF, FORMS, CutOff, Peaks, clamp_scores, eq11_peaks
from .printed_report import Findings, write_results

BIN_M = 1.0
"""Ranges are told apart so finely where Eq. 11's peak is."""


@dataclass(frozen=True)
class PrintedConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them."""

    drive: Annotated[DriveConfig, Doc("The drive that is mapped.")] = field(
        default_factory=lambda: DriveConfig(distance_m=15.0)
    )
    n_seeds: Annotated[int, N_SEEDS] = 3
    camera_faults: Annotated[str, CAMERA_FAULTS] = "mild"
    mapping: Annotated[
        MappingConfig, Doc("Of every map; its motion_error is how odometry errs, and what the maps are told.")
    ] = field(default_factory=budget_mapping)
    obstacles_m: Annotated[tuple[float, ...], OBSTACLES] = OBSTACLES_M

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        check_fields(self)
        if len(self.obstacles_m) != 2 or not self.obstacles_m[0] < self.obstacles_m[1]:
            raise InvalidInputError(f"obstacles_m must be two heights, the lower first, not {self.obstacles_m}")
        for form in FORMS.values():
            form.mapping(self.mapping).build_mapper(MINORU)


@dataclass(frozen=True)
class Seen:
    """What one seed gave: the scores by arm, its maps, and Eq. 11's peaks."""

    scores: Mapping[str, list[Score]]
    grids: Mapping[str, OccupancyGrid]
    peaks: Peaks


def run(
    config: PrintedConfig, stage: Stage, *, runs: Path, recording: Path | None = None, command: str = ""
) -> tuple[Path, list[ReportTable]]:
    """Map the drive in every form with every seed; the run folder and the tables for the screen."""
    reused = open_drive(recording) if recording else None
    run_of = RunRecord.of("experiments printed", command, recording, made="drive.mcap")
    with recorded_run(runs, "printed", run_of.reading(*config.mapping.matcher.files()), config) as folder:
        drive = reused or open_drive(record(config.drive, folder / "drive.mcap", stage))
        findings = measure(drive, config, stage)
        facts = {"command": command, "recording": str(recording or "drive.mcap"), **about(drive)}
        with stage("drawing", 1):
            tables = write_results(folder, findings, facts=facts, config=config)
    return finished_path(folder), tables


def measure(drive: Recording, config: PrintedConfig, stage: Stage) -> Findings:
    """The scores of every arm with every seed; maps and peaks of the first."""
    mapping = config.mapping
    with stage("finding what the cameras could see", len(drive)) as step:
        truth = MapTruth.of_recording(
            drive,
            mapping.grid.cell_m,
            max_range_m=mapping.model.max_range_m,
            around_path=True,
            progress=lambda _done, _total: step(),
        )
    obstacles, seeds, stop = truth.above_ground(*config.obstacles_m), range(1, config.n_seeds + 1), Event()
    with stage("mapping", len(seeds) * len(drive)) as step:
        track = until(stop, counted(step))
        jobs = {seed: partial(one_seed, drive, truth, obstacles, config, seed=seed, track=track) for seed in seeds}
        found: dict[int, Seen] = in_parallel(jobs, stop=stop)
    scores = {arm: {seed: found[seed].scores[arm] for seed in seeds} for arm in found[1].scores}
    return Findings(scores, found[1].grids, found[1].peaks, truth)


def one_seed(
    drive: Recording, truth: MapTruth, obstacles: MapTruth, config: PrintedConfig, *, seed: int, track: Track
) -> Seen:
    """The drive with one seed's faults: each pair is matched once, and read by the maps of all forms."""
    mapping = config.mapping
    faulty = FaultyDrive(drive, camera_faults(config.camera_faults), mapping.motion_error, seed)
    mappers = {name: form.mapping(mapping).build_mapper(drive.camera) for name, form in FORMS.items()}
    claimed, disparities = faulty.poses(true=False), []
    readings = faulty.readings(mapping.matcher, images=True, calibration=True)
    for observation, disparity in track(readings, "mapping", len(drive)):
        for mapper in mappers.values():
            mapper.fuse(claimed(observation), disparity)
        disparities.append(disparity)
    for mapper in mappers.values():
        mapper.finish()
    grids = {name: mapper.grid for name, mapper in mappers.items()}
    judged = {**grids, CUT_OFF: CutOff(grids[CORRECTED])}
    scores = {
        name: score_form(truth, obstacles, each, grids.get(name, grids[CORRECTED])) for name, each in judged.items()
    }
    edges_m = np.arange(0, mapping.model.max_range_m + BIN_M, BIN_M)
    peaks = eq11_peaks(drive.camera, disparities, cell_m=mapping.grid.cell_m, edges_m=edges_m)
    return Seen(scores, grids, peaks)


def score_form(truth: MapTruth, obstacles: MapTruth, judged: ScoredMap, grid: OccupancyGrid) -> list[Score]:
    """Every score of what a map says, of the obstacles as well, and how many of its cells stand at the clamps."""
    prior = grid.model.prior
    among = obstacles.score(judged, prior=prior, surface=False)
    of_obstacles = (replace(each, name=f"obstacle_{each.name}") for each in among)
    clamps = clamp_scores(grid, truth.labels, truth.visible.mask)
    return [*truth.score(judged, prior=prior), *of_obstacles, *clamps]
