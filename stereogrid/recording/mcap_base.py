"""What all recordings in MCAP files share: a scan of the file, and messages that are read as they are asked for."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from mcap.records import McapRecord, Message

from ..errors import InvalidInputError, RecordingError, StereogridError
from ..geometry import FloatArray
from . import ros2_messages as ros2
from .mcap_scan import ClippedFile, Contents, Wanted, scan
from .ros2_file import FORMAT_VERSION, METADATA_NAME, NOTE_NAME

RecordsAt = Callable[[int], list[McapRecord]]


@dataclass(frozen=True)
class ToldPose:
    """The pose in an Odometry or a PoseStamped, still as it was decoded, and the frame it is in."""

    frame: str
    pose: Any


def told_pose(message: Any) -> ToldPose:
    """Of a decoded message; its covariances, most of it, are let go."""
    # A PoseStamped holds its pose, an Odometry a pose with covariance.
    return ToldPose(message.header.frame_id, getattr(message.pose, "pose", message.pose))


def whole(message: Any) -> Any:
    """All of a decoded message."""
    return message


class McapBase:
    """A scanned file. metadata: the text in it; damage: what ended the reading early, or None.

    Raises RecordingError when the file is missing, is no MCAP file or of a version that is not known.
    """

    def __init__(self, path: str | Path, wanted: Mapping[str, Wanted], contents: Contents | None = None) -> None:
        self.path = Path(path)
        self._contents = scan(self.path, wanted) if contents is None else contents
        self.damage = self._contents.damage
        texts = self._contents.metadata
        self.metadata = {**texts.get(METADATA_NAME, {}), **texts.get(NOTE_NAME, {})}

    @property
    def is_complete(self) -> bool:
        """False when the file is damaged or was cut off: some observations are then missing."""
        return self.damage is None

    @contextmanager
    def _opened(self) -> Iterator[RecordsAt]:
        with ClippedFile(self.path) as file:
            # Many messages may lie in one chunk: unpack it once for all that are near.
            yield lru_cache(maxsize=4)(file.records_at)

    @contextmanager
    def _naming(self, what: str) -> Iterator[None]:
        """Turn whatever goes wrong into a RecordingError that names the file and what was read."""
        try:
            yield
        except Exception as error:
            # The mcap library raises whatever its parsers stumble on.
            fault = str(error) if isinstance(error, StereogridError) else f"cannot be decoded: {error!r}"
            raise RecordingError(f"{self.path}: {what}: {fault}") from error

    @contextmanager
    def _opening(self) -> Iterator[None]:
        """Turn what is wrong with the contents into a RecordingError that names the file, and its damage."""
        try:
            version = self.metadata.get("format_version", FORMAT_VERSION)
            if version != FORMAT_VERSION:
                raise InvalidInputError(f"recording format {version!r} is not known, only {FORMAT_VERSION!r}")
            yield
        except InvalidInputError as error:
            raise RecordingError(f"{self.path}: {error}" + (f" ({self.damage})" if self.damage else "")) from error

    def _require(self, *topics: str) -> None:
        missing = [topic for topic in topics if topic not in self._contents.messages]
        if missing:
            raise InvalidInputError(f"no messages on {', '.join(missing)}")

    def _message(self, topic: str, stamp_ns: int, records_at: RecordsAt) -> Any:
        place = self._contents.messages[topic][stamp_ns]
        record = records_at(place.offset)[place.number]
        if not isinstance(record, Message):
            raise InvalidInputError("the file changed since it was opened")
        return ros2.decoder(self._contents.types[topic])(record.data)

    def _first(self, topic: str) -> Any:
        return next(iter(self._contents.small[topic].values()))

    def _pose(self, topic: str, stamp_ns: int) -> FloatArray:
        return ros2.read_pose(self._contents.small[topic][stamp_ns].pose, f"{topic} at {stamp_ns / 10**9:.9f} s")
