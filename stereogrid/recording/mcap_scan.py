"""Finds what an MCAP file holds, as far as it can be read."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, cast

from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from ..errors import InvalidInputError, RecordingError
from . import ros2_messages as ros2

MAX_CHUNK_BYTES = 2**28
"""No chunk of ours comes near; a damaged or hostile one may claim to unpack to anything."""

_HELD_IN_MEMORY = (ros2.TF_STATIC, ros2.LEFT_INFO, ros2.RIGHT_INFO, ros2.ODOMETRY, ros2.TRUE_POSE)


@dataclass(frozen=True)
class Location:
    """Where a message lies: the offset of its record or chunk in the file, and its number in the chunk."""

    offset: int
    number: int


@dataclass
class Contents:
    """What a scan found. messages: topic -> header stamp [ns] -> place; small: decoded, by the same keys.

    damage says what ended the reading early, None for a file that reads to its end.
    """

    messages: dict[str, dict[int, Location]] = field(default_factory=dict)
    small: dict[str, dict[int, Any]] = field(default_factory=dict)
    static_transforms: list[Any] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, int] = field(default_factory=dict)
    damage: str | None = None


def scan(path: Path) -> Contents:
    """Read the whole file once, keeping places and small messages, and stop at the first damage.

    Every chunk's checksum is checked here, so what was found can be read later.
    Raises RecordingError when the file cannot be opened or is no MCAP file.
    """
    with ClippedFile(path) as file:
        reader = _Scanner(file)
        try:
            reader.run()
        except Exception as error:
            # The mcap library raises whatever its parsers stumble on: struct, Unicode, zstd, memory errors.
            if not reader.started:
                raise RecordingError(f"{path}: not an MCAP file, or cut off in its first bytes") from error
            what = str(error) or type(error).__name__
            reader.contents.damage = f"damaged or cut off at byte {reader.offset}: {what}"
    return reader.contents


class _Scanner:
    def __init__(self, file: "ClippedFile") -> None:
        self.contents = Contents()
        self.started = False
        self.offset = 0
        self._file = file
        self._topics: dict[int, str] = {}
        self._schema_names: dict[int, str] = {}
        self._n_messages = 0
        self._stamp = ros2.decoder("std_msgs/msg/Header")
        self._decoders = {topic: ros2.decoder(ros2.TOPICS[topic]) for topic in _HELD_IN_MEMORY}

    def run(self) -> None:
        for record in _stream_reader(self._file).records:
            self.started = True
            self._take(record)
            self.offset = self._file.tell()

    def _take(self, record: McapRecord) -> None:
        contents = self.contents
        if isinstance(record, Chunk):
            for number, inner in enumerate(open_chunk(record)):
                self._take_data(inner, Location(self.offset, number))
        elif isinstance(record, Metadata):
            contents.metadata[record.name] = record.metadata
        elif isinstance(record, Attachment):
            contents.attachments[record.name] = self.offset
        elif isinstance(record, Statistics) and record.message_count != self._n_messages:
            raise InvalidInputError(f"{self._n_messages} messages found where {record.message_count} were written")
        else:
            self._take_data(record, Location(self.offset, 0))

    def _take_data(self, record: McapRecord, location: Location) -> None:
        if isinstance(record, Schema):
            self._schema_names[record.id] = record.name
        elif isinstance(record, Channel):
            schema_name = self._schema_names.get(record.schema_id)
            if record.message_encoding == "cdr" and ros2.TOPICS.get(record.topic) == schema_name:
                self._topics[record.id] = record.topic
        elif isinstance(record, Message):
            self._n_messages += 1
            if record.channel_id in self._topics:
                self._take_message(self._topics[record.channel_id], record.data, location)

    def _take_message(self, topic: str, data: bytes, location: Location) -> None:
        if topic == ros2.TF_STATIC:
            # It has no header of its own.
            self.contents.static_transforms.extend(self._decoders[topic](data).transforms)
            return
        if topic == ros2.TRUE_MOVERS:
            transforms = ros2.decoder(ros2.TOPICS[topic])(data).transforms
            if not transforms:
                return
            stamp_ns = ros2.header_stamp_ns(transforms[0].header)
        else:
            stamp_ns = ros2.header_stamp_ns(self._stamp(data))
        if topic in self._decoders:
            self.contents.small.setdefault(topic, {}).setdefault(stamp_ns, self._decoders[topic](data))
        self.contents.messages.setdefault(topic, {}).setdefault(stamp_ns, location)


class ClippedFile:
    """A file that never reads past its end, so that a damaged length cannot ask for gigabytes of memory."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("rb")
            self.size = path.stat().st_size
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error

    def read(self, n_bytes: int) -> bytes:
        """At most n_bytes bytes, fewer at the end of the file."""
        if n_bytes < 0:
            raise ValueError("a record of negative length")
        return self._file.read(min(n_bytes, self.size - self._file.tell()))

    def tell(self) -> int:
        """Offset of the next byte."""
        return self._file.tell()

    def records_at(self, offset: int) -> list[McapRecord]:
        """The record at an offset found by `scan`, or those in it when it is a chunk."""
        self._file.seek(offset)
        record = next(_stream_reader(self, skip_magic=True).records)
        return open_chunk(record) if isinstance(record, Chunk) else [record]

    def __enter__(self) -> "ClippedFile":
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._file.close()


def _stream_reader(file: ClippedFile, *, skip_magic: bool = False) -> StreamReader:
    # It needs only `read`, whatever its annotation says.
    stream = cast("IO[bytes]", file)
    return StreamReader(stream, skip_magic=skip_magic, emit_chunks=True, record_size_limit=file.size)


def open_chunk(chunk: Chunk) -> list[McapRecord]:
    """The records in a chunk, its checksum verified. Raises whatever the mcap library raises."""
    if chunk.uncompressed_size > MAX_CHUNK_BYTES:
        raise InvalidInputError(f"a chunk claims to unpack to {chunk.uncompressed_size} bytes")
    return breakup_chunk(chunk, validate_crc=True)


def is_mcap(path: Path) -> bool:
    """True for a file that is named *.mcap or begins as MCAP files do."""
    if not path.is_file():
        return False
    with ClippedFile(path) as file:
        return path.suffix.lower() == ".mcap" or file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
