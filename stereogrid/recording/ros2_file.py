"""An MCAP file of ROS 2 messages that stays readable when the run is killed or the disk is full."""

import errno
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Literal, cast

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer
from mcap_ros2._dynamic import serialize_dynamic

from ..errors import InvalidInputError, RecordingError
from .ros2_qos import offered_qos
from .ros2_schemas import SCHEMAS

FORMAT_VERSION = "1"
METADATA_NAME = "stereogrid"
NOTE_NAME = "stereogrid/note"
OWN_METADATA = ("format_version", "stereogrid_version")
"""What every file says of itself."""


class Ros2File:
    """Messages on topics, metadata and attachments, written to `path`; use it in a `with` block, which finishes it.

    topics: message type by topic. Each `flush` writes all that came since the last one in one piece; what a full disk
    leaves of a piece is cut off again. grouped: a piece is one chunk, as files of many small messages need it, rather
    than one a message.
    metadata: text kept in the file. Raises RecordingError when the file exists (unless overwrite) or cannot be written,
    InvalidInputError when the metadata are wrong.
    """

    def __init__(
        self,
        path: str | Path,
        topics: Mapping[str, str],
        *,
        metadata: Mapping[str, str],
        grouped: bool = False,
        overwrite: bool = False,
    ) -> None:
        self.path = Path(path)
        self._topics = topics
        self._grouped = grouped
        own = dict(zip(OWN_METADATA, (FORMAT_VERSION, _library_version()), strict=True))
        checked = _checked_metadata(metadata, own)
        self._pieces = _Pieces(self.path, "wb" if overwrite else "xb")
        try:
            with self._reporting():
                self._begin(checked)
        except RecordingError:
            self._pieces.close()
            if not overwrite:
                self.path.unlink(missing_ok=True)
            raise

    def _begin(self, metadata: dict[str, str]) -> None:
        self._mcap = Writer(
            cast("IO[bytes]", self._pieces),
            # A limit of zero bytes closes a chunk after every message.
            chunk_size=2**40 if self._grouped else 0,
            compression=CompressionType.ZSTD,
        )
        self._mcap.start(Profile.ROS2, f"stereogrid {_library_version()}")
        self._schema_ids = {
            name: self._mcap.register_schema(name, SchemaEncoding.ROS2, SCHEMAS[name].encode())
            for name in sorted(set(self._topics.values()))
        }
        self._channel_ids: dict[str, int] = {}
        self._mcap.add_metadata(METADATA_NAME, metadata)
        self._pieces.flush()

    @property
    def n_bytes(self) -> int:
        """Bytes in the file."""
        return self._pieces.written

    def write(self, topic: str, stamp_ns: int, message: Mapping[str, Any]) -> None:
        """Append a message, which is in the file after the next `flush`."""
        self.write_encoded(topic, stamp_ns, _encoder(self._topics[topic])(message))

    def write_encoded(self, topic: str, stamp_ns: int, cdr: bytes) -> None:
        """Append a message in CDR, by our own definition of its type."""
        with self._reporting():
            self._mcap.add_message(self._channel(topic), log_time=stamp_ns, data=cdr, publish_time=stamp_ns)

    def _channel(self, topic: str) -> int:
        if topic not in self._channel_ids:
            self._channel_ids[topic] = self._mcap.register_channel(
                topic,
                MessageEncoding.CDR,
                self._schema_ids[self._topics[topic]],
                {"offered_qos_profiles": offered_qos(topic)},
            )
        return self._channel_ids[topic]

    def note(self, key: str, text: str) -> None:
        """Add to the metadata what became known while recording; the notes of a file have different keys."""
        self.flush()
        with self._reporting():
            self._mcap.add_metadata(NOTE_NAME, _checked_metadata({key: text}, own={}))
            self._pieces.flush()

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment."""
        with self._reporting():
            self._mcap.add_attachment(0, 0, name, media_type, data)

    def flush(self) -> None:
        """Write all that came to the file."""
        with self._reporting():
            if self._grouped:
                self._mcap.flush()  # type: ignore[no-untyped-call]
            self._pieces.flush()

    def sync(self) -> None:
        """As flush, and wait until the disk itself has it: from then on a power cut takes nothing of it."""
        self.flush()
        with self._reporting():
            self._pieces.sync()

    def close(self) -> None:
        """Write the index and close the file; closing again does nothing.

        A file that a full disk has cut off stays without an index, which its readers can do without.
        """
        if self._pieces.closed:
            return
        with self._reporting():
            try:
                if self._pieces.failed is None:
                    self._mcap.finish()  # type: ignore[no-untyped-call]
                    self._pieces.flush()
            finally:
                self._pieces.close()

    def __enter__(self) -> "Ros2File":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}") from error


class _Pieces:
    """A file to which whole pieces are appended: all that was written since the last flush, or nothing of it.

    failed: why it could not be written. It then ends with its last whole piece, and every further flush fails likewise.
    """

    def __init__(self, path: Path, mode: Literal["wb", "xb"]) -> None:
        try:
            # Without a buffer of Python's, whose lock a thread that waits for a slow disk would hold for ever.
            self._file = path.open(mode, buffering=0)
        except FileExistsError:
            raise RecordingError(
                f"{path}: exists already; choose another path (in Python: or overwrite=True)"
            ) from None
        except OSError as error:
            raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error
        self._held: list[bytes] = []
        self._place = 0
        self._torn = False
        self.written = 0
        self.failed: OSError | None = None

    @property
    def closed(self) -> bool:
        return self._file.closed

    def write(self, data: bytes) -> int:
        self._held.append(bytes(data))
        self._place += len(data)
        return len(data)

    def tell(self) -> int:
        return self._place

    def flush(self) -> None:
        if self.failed is not None:
            # Even where there is room again: a reader would take what is missing for the robot's silence.
            self._held = []
            raise OSError(self.failed.errno, self.failed.strerror)
        piece = memoryview(b"".join(self._held))
        if self._torn:
            self._file.seek(self.written)
        try:
            start = 0
            while start < len(piece):
                start += self._file.write(piece[start:]) or 0
        except OSError as error:
            self.failed, self._held = error, []
            with suppress(OSError):
                self._file.truncate(self.written)
            raise
        except BaseException:
            # An interrupt: the piece is written again.
            self._torn = True
            raise
        self._torn = False
        self.written, self._held = self.written + len(piece), []

    def sync(self) -> None:
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            # A pipe, or a device, has no disk to wait for.
            if error.errno != errno.EINVAL:
                self.failed = error
                raise

    def close(self) -> None:
        self._file.close()


@cache
def _encoder(type_name: str) -> Callable[[Mapping[str, Any]], bytes]:
    encode: Callable[[Mapping[str, Any]], bytes] = serialize_dynamic(type_name, SCHEMAS[type_name])[type_name]
    return encode


def _checked_metadata(metadata: Mapping[str, str], own: dict[str, str]) -> dict[str, str]:
    for key, value in metadata.items():
        if not isinstance(key, str) or not isinstance(value, str):
            raise InvalidInputError(f"metadata must be text: {key!r} is {value!r}")
        if key in own:
            raise InvalidInputError(f"metadata {key!r} is written by the recording itself")
    return {**own, **metadata}


def _library_version() -> str:
    try:
        return version("stereogrid")
    except PackageNotFoundError:
        return "unknown"
