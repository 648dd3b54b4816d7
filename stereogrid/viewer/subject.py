"""What a page is about: the maps, recording, poses and parameters that a run folder, a map or a recording gives."""

from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InvalidInputError, StereogridError
from ..geometry import FloatArray
from ..run_record import NAME, RunRecord
from ..tomlfile import CONFIG_TOML, config_from_table, read_table

if TYPE_CHECKING:
    from ..config import MappingConfig
    from ..observation import Recording
    from ..recording import FileRecording

MAP_SUFFIXES = (".sgrid", ".bt", ".ot")
NO_RECORDING = "path, cameras, replay, age and true mesh: {}"


@dataclass(frozen=True)
class Subject:
    """What there is to see.

    maps: files by their names, empty where the map is yet to be made; recording and poses (M, 4, 4): where the cameras
    were taken to be; source: the recording as it was mapped, with these poses; config: how; replays: whether that
    makes the map; missing: what cannot be shown, and why.
    """

    title: str
    maps: dict[str, Path]
    recording: "FileRecording | None" = None
    source: "Recording | None" = None
    poses: FloatArray = field(default_factory=lambda: np.zeros((0, 4, 4)))
    config: "MappingConfig | None" = None
    replays: bool = False
    missing: tuple[str, ...] = ()

    @property
    def knows_truth(self) -> bool:
        """Whether there is a true mesh."""
        return self.recording is not None and self.recording.truth_mesh_ply() is not None

    @property
    def judges(self) -> bool:
        """Whether maps can be held against it."""
        return self.knows_truth and self._true_poses and find_spec("embreex") is not None

    @property
    def _true_poses(self) -> bool:
        return self.recording is not None and self.recording.true_poses() is not None

    def all_missing(self) -> tuple[str, ...]:
        """missing, and what the recording lacks."""
        if self.recording is None:
            return self.missing
        if not self.knows_truth:
            return (*self.missing, "true mesh and error colours: the recording carries no truth")
        if not self._true_poses:
            return (*self.missing, "error colours: the recording carries no true poses")
        if not self.judges:
            return (*self.missing, 'error colours: they need the extra score: pip install "stereogrid[score]"')
        return self.missing


def is_run(path: Path) -> bool:
    """Whether a path is a run folder: a folder with maps or with a run.toml."""
    return path.is_dir() and bool(_maps(path) or (path / NAME).is_file())


def subject_of_map(path: Path) -> Subject:
    """Of a map file alone."""
    return Subject(path.name, {path.stem: path}, missing=(NO_RECORDING.format("a map file has no recording"),))


def subject_of_run(run: Path) -> Subject:
    """Of a run folder. Raises InvalidInputError when it holds no map; what else is missing is said on the page."""
    maps, title = _maps(run), run.resolve().name
    if not maps:
        raise InvalidInputError(f"{run}: holds no map (map.sgrid or map-<arm>.sgrid)")
    if not (run / NAME).is_file():
        return Subject(title, maps, missing=(NO_RECORDING.format(f"the run folder has no {NAME}, so only its map"),))
    record = RunRecord.load(run)
    if not record.recording:
        return Subject(title, maps, missing=(NO_RECORDING.format(f"{NAME} names no recording, so only the map"),))
    try:
        recording, source, poses = _as_mapped(record.open_recording(run), record.poses)
    except StereogridError as error:
        return Subject(title, maps, missing=(NO_RECORDING.format(f"{error}; so only the map"),))
    config, missing = _config_of(run, record)
    replays = config is not None and record.program == "map"
    return Subject(title, maps, recording, source, poses, config, replays, missing)


def subject_of_recording(recording: "FileRecording", config: "MappingConfig", pose_source: str = "odometry") -> Subject:
    """Of a recording that is mapped while one looks on."""
    title = recording.path.resolve().name
    return Subject(title, {}, *_as_mapped(recording, pose_source), config, replays=True)


def _maps(run: Path) -> dict[str, Path]:
    """map.sgrid, or map-<arm>.sgrid by the arm, as the run wrote them: the first in time first."""
    found = sorted(run.glob("map*.sgrid"), key=lambda path: (path.stat().st_mtime_ns, path.name))
    return {path.stem.removeprefix("map-"): path for path in found}


def _as_mapped(recording: "FileRecording", pose_source: str) -> "tuple[FileRecording, Recording, FloatArray]":
    """The recording, the same with the poses that are taken (odometry, truth or standing), and these."""
    from ..recording import TruePoses

    true = recording.true_poses() if pose_source == "truth" else None
    if true is None:
        return recording, recording, recording.poses
    return recording, TruePoses(recording), true


def _config_of(run: Path, record: RunRecord) -> "tuple[MappingConfig | None, tuple[str, ...]]":
    """How the run mapped, as far as its config.toml says, and what is missing for a replay."""
    from ..config import MappingConfig

    if record.program != "map":
        words = f"replay and age: the maps of `{record.program}` are made by it alone, so they are shown as they ended"
        try:
            table = read_table(run / CONFIG_TOML).get("mapping", {})
            return config_from_table(MappingConfig, table), (words,)
        except StereogridError:
            return None, (words, "disparities: config.toml has no section [mapping]")
    try:
        return config_from_table(MappingConfig, read_table(run / CONFIG_TOML)), ()
    except StereogridError as error:
        return None, (f"replay, age and disparities: {error}",)
