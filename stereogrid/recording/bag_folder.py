"""A ROS bag as one thing, whatever files it is made of."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any

from ..errors import RecordingError
from ..places import is_file
from ..plainyaml import read_yaml
from .bag_bounds import unpack_file
from .bag_files import BagFile, DataAt, McapFile, Rosbag1File, SqliteFile
from .contents import Collector, Contents
from .mcap_file import is_mcap
from .raw_topics import BY_TYPE

METADATA_YAML = "metadata.yaml"
_ABOUT = "rosbag2_bagfile_information"
_MAX_YAML_BYTES = 2**22
_ROSBAG1_MAGIC = b"#ROSBAG V"
_PACKED = ".zstd"
_SHOWN = 80
"""Letters of a name, and names."""


def is_bag(path: Path) -> bool:
    """True for ROS 1's .bag, ROS 2's folder with its metadata.yaml or with .db3 files, and a lone .db3 file."""
    if path.is_dir():
        return _ABOUT in _start_of(path / METADATA_YAML).decode(errors="replace") or any(path.glob("*.db3*"))
    return path.suffix.lower() in (".bag", ".db3") or _start_of(path).startswith(_ROSBAG1_MAGIC)


def lone_mcap(path: Path) -> Path | None:
    """The one .mcap file of which a ROS 2 bag's folder consists; None when it has others, or another kind."""
    if not path.is_dir():
        return None
    files, packed_messages = _files_of(path)
    return files[0] if len(files) == 1 and files[0].suffix == ".mcap" and not packed_messages else None


class Bag:
    """The files of a bag, in order; those that are compressed as a whole are unpacked for as long as this lives.

    n_wrong: messages that could not be decoded.
    Raises RecordingError when there are none, or what is said of them cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        if path.is_dir():
            paths, packed_messages = _files_of(path)
        else:
            paths, packed_messages = [path], False
        self._missing = [each.name[:_SHOWN] for each in paths if not is_file(each)]
        paths = [each for each in paths if is_file(each)]
        if not paths:
            names = ", ".join(self._missing[:_SHOWN]) or "it names none"
            raise RecordingError(f"{path}: none of its files is here: {names}")
        self._unpacked = TemporaryDirectory(prefix="stereogrid-bag-") if any(map(_is_packed, paths)) else None
        self._files = [self._file(each, number, packed_messages) for number, each in enumerate(paths)]

    @property
    def n_wrong(self) -> int:
        """Of all files."""
        return sum(each.n_wrong for each in self._files)

    def scan(self, known: Contents | None = None) -> Contents:
        """What the bag holds, read through once; known: of a scan that was made of its only file, an .mcap."""
        if known is not None:
            places = {topic: {at: (0, place) for at, place in each.items()} for topic, each in known.messages.items()}
            return replace(known, messages=places)
        collector = Collector({}, BY_TYPE)
        damages = [f"{name} is missing" for name in self._missing]
        for file in self._files:
            damage = file.scan_into(collector)
            damages += [] if damage is None else [damage]
        collector.finish()
        collector.contents.damage = "; ".join(damages) or None
        return collector.contents

    @contextmanager
    def opened(self) -> Iterator[DataAt]:
        """Open the files, each when it is needed, to read messages by the places that `scan` gave them."""
        with ExitStack() as stack:
            opened: dict[int, Callable[[Any], bytes]] = {}

            def data_at(place: tuple[int, Any]) -> bytes:
                number, inner = place
                if number not in opened:
                    opened[number] = stack.enter_context(self._files[number].opened())
                return opened[number](inner)

            yield data_at

    def _file(self, path: Path, number: int, packed_messages: bool) -> BagFile:
        if _is_packed(path):
            assert self._unpacked is not None
            packed, path = path, Path(self._unpacked.name) / path.stem
            unpack_file(packed, path)
        if path.suffix == ".db3":
            return SqliteFile(path, number, packed=packed_messages)
        if self._path.is_dir() or is_mcap(path):
            return McapFile(path, number, packed=packed_messages)
        return Rosbag1File(path)


def _is_packed(path: Path) -> bool:
    return path.suffix == _PACKED


def _files_of(folder: Path) -> tuple[list[Path], bool]:
    """The files of a folder, in order, and whether their messages are compressed one by one."""
    said = _about(folder / METADATA_YAML)
    if said is None:
        # Whoever recorded it was cut off; bag_2 comes before bag_10.
        found = sorted(folder.glob("*.db3*"), key=lambda path: (len(path.name), path.name))
        return [path for path in found if path.suffix in (".db3", _PACKED)], False
    try:
        # Their names alone: no file outside of the folder is read.
        paths = [folder / PurePath(name).name for name in said["relative_file_paths"]]
        mode = str(said.get("compression_mode") or "").lower()
        if mode not in ("", "none") and said.get("compression_format") != "zstd":
            raise RecordingError(f"{folder}: compressed by {said.get('compression_format')!r}; only zstd is known")
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{folder / METADATA_YAML}: says nothing of the bag's files") from error
    return paths, mode == "message"


def _about(yaml: Path) -> dict[str, Any] | None:
    """What a metadata.yaml says; None where there is none. Raises RecordingError when it cannot be read."""
    if not is_file(yaml):
        return None
    said = read_yaml(yaml, most_bytes=_MAX_YAML_BYTES).get(_ABOUT)
    if not isinstance(said, dict):
        raise RecordingError(f"{yaml}: cannot be read: no {_ABOUT} with keys and values")
    return said


def _start_of(path: Path) -> bytes:
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        return file.read(2**12)
