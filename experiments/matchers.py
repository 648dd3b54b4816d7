"""The comparison of matchers: on pairs whose disparity is known, and by the map that each makes of one drive.

Every matcher sees the same pairs, and the same drive with the same true poses and the same image noise, seed by
seed; so a difference between two maps is one between their matchers.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from sim.faults import camera_faults
from sim.rig import MINORU
from stereogrid.config import GridConfig, MappingConfig
from stereogrid.described import Doc, check_fields
from stereogrid.errors import unknown_name
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path
from stereogrid.sensor_model import SensorModel

from .contenders import Contender, default_table, read_contenders
from .drives import CAMERA_FAULTS, N_SEEDS, NUM_DISPARITIES, DriveConfig, about, open_drive, record
from .matched_maps import Seeing, map_drive, truth_of
from .matched_pairs import PairResult, at_most, match_pairs
from .matchers_report import write_results
from .pairs import Pair, open_pairs
from .parallel import Stage


@dataclass(frozen=True)
class MatchersConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them."""

    reference: Annotated[str, Doc("The contender that the others are compared with.")] = "bm"
    most_pixels: Annotated[int, Doc("Larger pairs are shrunk.", "pixels", above=0)] = 400_000
    n_seeds: Annotated[int, N_SEEDS] = 5
    camera_faults: Annotated[str, CAMERA_FAULTS] = "mild"
    num_disparities: Annotated[int, NUM_DISPARITIES] = 80
    drive: Annotated[DriveConfig, Doc("The drive that each maps.")] = field(
        default_factory=lambda: DriveConfig(every_m=0.5, distance_m=6.0)
    )
    model: Annotated[SensorModel, Doc("Of every map.")] = field(default_factory=lambda: SensorModel(max_range_m=5.0))
    grid: Annotated[GridConfig, Doc("Of every map.")] = field(default_factory=lambda: GridConfig(cell_m=0.05))
    contenders: Annotated[
        dict,
        Doc(
            "A section for each matcher that takes part: matcher, its name; colour, whether it sees pairs in colour; "
            "labels_step, num_disparities is rounded up to a multiple of it [px], 0: it takes none; options, what else "
            "it is made with."
        ),
    ] = field(default_factory=default_table)

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        check_fields(self)
        if self.reference not in self.contenders:
            raise unknown_name("contender", self.reference, self.contenders)
        for contender in self.contending.values():
            contender.make(self.num_disparities)
        self.seeing.mapping.build_mapper(MINORU)

    @property
    def contending(self) -> dict[str, Contender]:
        """The contenders by name."""
        return read_contenders(self.contenders)

    @property
    def seeing(self) -> Seeing:
        """How the drive is seen and mapped."""
        mapping = MappingConfig(model=self.model, grid=self.grid)
        return Seeing(mapping, self.camera_faults, tuple(range(1, self.n_seeds + 1)), self.num_disparities)


def run(
    config: MatchersConfig,
    stage: Stage,
    *,
    runs: Path,
    pairs: Path | None = None,
    recording: Path | None = None,
    command: str = "",
) -> tuple[Path, list[ReportTable]]:
    """Compare the contenders on the pairs and by the map; the run folder and the tables for the screen.

    pairs: a folder of pairs, none: default_pairs(). recording: a drive to be used instead of a new one.
    """
    place = pairs or default_pairs()
    known = [at_most(pair, config.most_pixels) for pair in open_pairs(place)] if place else []
    reused = open_drive(recording) if recording else None
    run_of = RunRecord.of("experiments matchers", command, recording, made="drive.mcap")
    files = [each for contender in config.contending.values() for each in contender.files()]
    with recorded_run(runs, "matchers", run_of.reading(("pairs", place), *files), config) as folder:
        drive = reused or open_drive(record(config.drive, folder / "drive.mcap", stage))
        truth = truth_of(drive, config.seeing, stage)  # first: a drive without a truth is refused at once
        on_pairs = compare_on_pairs(known, config, stage)
        by_map = map_drive(drive, truth, config.contending, seeing=config.seeing, stage=stage)
        facts = {"command": command, "recording": str(recording or "drive.mcap"), **about(drive)}
        with stage("drawing", 1):
            tables = write_results(folder, on_pairs, by_map, config.reference, facts=facts, config=config)
    return finished_path(folder), tables


def default_pairs() -> Path | None:
    """$STEREOGRID_DATA/stereo, where that is a folder."""
    root = os.environ.get("STEREOGRID_DATA")
    return Path(root, "stereo") if root and Path(root, "stereo").is_dir() else None


def compare_on_pairs(pairs: Sequence[Pair], config: MatchersConfig, stage: Stage) -> list[PairResult]:
    """Every contender on every pair."""
    contenders = config.contending
    with stage("matching pairs", len(pairs) * len(contenders)) as step:
        return match_pairs(pairs, contenders, step)
