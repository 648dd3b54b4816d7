"""How many looks is a footprint worth? The grid told of different correlation lengths, on worlds of several kinds.

Everything else is the same in every arm, pair by pair: poses, images, noise, and the disparities themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sim.faults import camera_faults
from sim.rig import MINORU
from stereogrid.config import GridConfig, MappingConfig, save_config
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.matching import MATCHERS, matcher
from stereogrid.observation import Recording
from stereogrid.recording import open_recording
from stereogrid.report import ReportTable
from stereogrid.runs import finished_path, run_folder
from stereogrid.sensor_model import SensorModel

from .compared import Compared
from .drives import DriveConfig, about, open_drive, record
from .frames import FramesConfig
from .fusion_drive import Drive, compare_on_drive, compare_on_frames
from .fusion_report import CLAMPS, REAL, SIMULATED, Worlds, write_results
from .fusion_room import ROOM, RoomConfig, compare_in_room
from .fusion_street import STREET, StreetConfig, compare_on_street
from .matched_maps import Seeing, truth_of
from .parallel import Stage


@dataclass(frozen=True)
class FusionConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them.

    matchers: seen on the drive; kz2 takes 18 s a pair. n_seeds: image noise is drawn with the seeds 1, 2, ... n_seeds.
    camera_faults: see sim.faults.camera_faults. num_disparities: searched on the drive. clamps_of: the matcher whose
    maps show what clamps do, "" for none. frame_seeds: worlds of frames with independent noise, 0 for none.
    frame_cells_m: the cells that these are mapped with [m]. street, room: the real sequences, where there are any.
    """

    matchers: tuple[str, ...] = ("bm", "sgbm", "gc")
    n_seeds: int = 5
    camera_faults: str = "mild"
    num_disparities: int = 80
    clamps_of: str = "bm"
    drive: DriveConfig = field(default_factory=lambda: DriveConfig(every_m=0.5, distance_m=6.0))
    model: SensorModel = field(default_factory=lambda: SensorModel(max_range_m=5.0))
    grid: GridConfig = field(default_factory=lambda: GridConfig(cell_m=0.05))
    frames: FramesConfig = field(default_factory=lambda: FramesConfig(n=100))
    frame_seeds: int = 3
    frame_cells_m: tuple[float, ...] = (0.05, 0.1)
    street: StreetConfig = field(default_factory=StreetConfig)
    room: RoomConfig = field(default_factory=RoomConfig)

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        for name in ("n_seeds", "num_disparities"):
            if not getattr(self, name) > 0:
                raise InvalidInputError(f"{name} must be positive, not {getattr(self, name)}")
        if self.frame_seeds < 0:
            raise InvalidInputError(f"frame_seeds must be >= 0, not {self.frame_seeds}")
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
    with run_folder(runs, "fusion") as folder:
        save_config(config, folder / "config.toml")
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
            tables = write_results(folder, worlds, skipped=skipped, facts=facts)
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
