"""How many looks is a footprint worth? The grid told of different correlation lengths, on worlds of several kinds.

Everything else is the same in every arm, pair by pair: poses, images, noise, and the disparities themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from sim.faults import camera_faults
from sim.rig import MINORU
from stereogrid.config import GridConfig, MappingConfig
from stereogrid.described import Doc, check_fields
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.matching import MATCHERS, matcher
from stereogrid.observation import Recording
from stereogrid.recorded_run import recorded_run
from stereogrid.recording import open_recording
from stereogrid.report import ReportTable
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path
from stereogrid.sensor_model import SensorModel

from .compared import Compared
from .drives import CAMERA_FAULTS, N_SEEDS, NUM_DISPARITIES, DriveConfig, about, open_drive, record
from .frames import FramesConfig
from .fusion_drive import Drive, compare_on_drive, compare_on_frames
from .fusion_report import CLAMPS, REAL, SIMULATED, Worlds, write_results
from .fusion_room import ROOM, RoomConfig, compare_in_room
from .fusion_street import STREET, StreetConfig, compare_on_street
from .matched_maps import Seeing, truth_of
from .parallel import Stage


@dataclass(frozen=True)
class FusionConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them."""

    matchers: Annotated[tuple[str, ...], Doc("Seen on the drive; kz2 takes 18 s a pair.")] = ("bm", "sgbm", "gc")
    n_seeds: Annotated[int, N_SEEDS] = 5
    camera_faults: Annotated[str, CAMERA_FAULTS] = "mild"
    num_disparities: Annotated[int, NUM_DISPARITIES] = 80
    clamps_of: Annotated[str, Doc("The matcher whose maps show what clamps do; empty: none.")] = "bm"
    drive: Annotated[DriveConfig, Doc("The drive that is mapped.")] = field(
        default_factory=lambda: DriveConfig(every_m=0.5, distance_m=6.0)
    )
    model: Annotated[SensorModel, Doc("Of the maps of the drive.")] = field(
        default_factory=lambda: SensorModel(max_range_m=5.0)
    )
    grid: Annotated[GridConfig, Doc("Of the maps of the drive.")] = field(
        default_factory=lambda: GridConfig(cell_m=0.05)
    )
    frames: Annotated[FramesConfig, Doc("Frames whose noise is independent from pixel to pixel.")] = field(
        default_factory=lambda: FramesConfig(n=100)
    )
    frame_seeds: Annotated[int, Doc("So many worlds of such frames; 0: none.", least=0)] = 3
    frame_cells_m: Annotated[tuple[float, ...], Doc("The cells that these are mapped with.", "m", above=0)] = (
        0.05,
        0.1,
    )
    street: Annotated[StreetConfig, Doc("A real street, where there is one: every other pair is held out.")] = field(
        default_factory=StreetConfig
    )
    room: Annotated[
        RoomConfig, Doc("A real room, where there is one: measured depths as the disparities of a virtual rig.")
    ] = field(default_factory=RoomConfig)

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        check_fields(self)
        if not self.matchers:
            raise InvalidInputError(f"matchers names none; choose from: {', '.join(sorted(MATCHERS))}")
        for name in self.matchers:
            matcher(name, num_disparities=self.num_disparities)
        if self.clamps_of and self.clamps_of not in self.matchers:
            raise unknown_name("matcher on the drive", self.clamps_of, self.matchers)
        self.seeing.mapping.build_mapper(MINORU)

    @property
    def seeing(self) -> Seeing:
        """How the drive is seen and mapped."""
        mapping = MappingConfig(model=self.model, grid=self.grid)
        return Seeing(mapping, self.camera_faults, tuple(range(1, self.n_seeds + 1)), self.num_disparities)


def run(
    config: FusionConfig,
    stage: Stage,
    *,
    runs: Path,
    data: Path | None = None,
    recording: Path | None = None,
    command: str = "",
) -> tuple[Path, list[ReportTable]]:
    """Compare the arms on every world that there is; the run folder and the tables for the screen.

    data: the folder of real data, none: simulated worlds alone. recording: a drive to be used instead of a new one.
    """
    if data is not None and not data.is_dir():
        raise InvalidInputError(f"{data}: no such folder of data")
    reused = open_drive(recording) if recording else None
    run_of = RunRecord.of("experiments fusion", command, recording, made="drive.mcap").reading(("data", data))
    with recorded_run(runs, "fusion", run_of, config) as folder:
        drive = reused or open_drive(record(config.drive, folder / "drive.mcap", stage))
        real, skipped = compare_real(data, config, stage)  # first: damaged data are refused early
        on_drive = compare_drive(drive, config, stage)
        worlds: Worlds = {
            SIMULATED: [*on_drive[: len(config.matchers)], *compare_frames(config, stage)],
            REAL: real,
            CLAMPS: on_drive[len(config.matchers) :],
        }
        facts = {"command": command, "recording": str(recording or "drive.mcap"), **about(drive)}
        with stage("drawing", 1):
            tables = write_results(folder, worlds, skipped=skipped, facts=facts, config=config)
    return finished_path(folder), tables


def compare_drive(recording: Recording, config: FusionConfig, stage: Stage) -> list[Compared]:
    """The arms of each matcher on the drive, in their order, then the clamps where they are wanted."""
    truth = truth_of(recording, config.seeing, stage)
    return compare_on_drive(
        Drive(recording, truth, config.seeing), config.matchers, clamps_of=config.clamps_of, stage=stage
    )


def compare_frames(config: FusionConfig, stage: Stage) -> list[Compared]:
    """The arms on frames of independent noise, a comparison for each size of cells."""
    seeds = range(1, config.frame_seeds + 1)
    return compare_on_frames(config.frames, config.frame_cells_m, seeds=seeds, stage=stage) if seeds else []


def compare_real(data: Path | None, config: FusionConfig, stage: Stage) -> tuple[list[Compared], Sequence[str]]:
    """The arms on the real sequences under data, and a sentence for each that is missing."""
    compared, skipped = [], []
    if data is not None and (data / STREET).is_dir():
        compared += compare_on_street(open_recording(data / STREET), config.street, stage)
    else:
        skipped.append(f"The street ({STREET} under --data) was not there, and is left out.")
    if data is not None and (data / ROOM).is_dir():
        compared.append(compare_in_room(data / ROOM, config.room, stage))
    else:
        skipped.append(f"The room ({ROOM} under --data) was not there, and is left out.")
    return compared, skipped
