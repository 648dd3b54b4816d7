"""Finds what an MCAP file holds, as far as it can be read."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, cast

from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from ..errors import InvalidInputError, RecordingError
from . import ros2_messages as ros2

UNSTAMPED = 3
"""So many messages of one topic with one header stamp, written at different times, have a driver that sets none."""
TRANSFORMS = "tf2_msgs/msg/TFMessage"
LAST_STAMP_NS = 2**63 - 1
MAX_CHUNK_BYTES = 2**28
"""No chunk of ours comes near; a damaged or hostile one may claim to unpack to anything."""


@dataclass(frozen=True)
class Wanted:
    """What is wanted of a topic: messages of one of these types; `keep` makes of one, decoded, what is held in memory.

    once: only of the first one. Without `keep` no more is kept than where each message lies.
    """

    types: tuple[str, ...]
    keep: Callable[[Any], Any] | None = None
    once: bool = False


@dataclass(frozen=True)
class Location:
    """Where a message lies: the offset of its record or chunk in the file, and its number in the chunk."""

    offset: int
    number: int


@dataclass
class Contents:
    """What a scan found of what was wanted. messages: topic -> header stamp [ns] -> place; small: what was kept of
    them, by the same keys; types: the type of each topic's messages, whether wanted or not.

    unstamped: topics all of whose messages have one and the same header stamp; the keys are then the times at which
    they were written to the file (log_time). repeats: by topic, how many messages have the stamp of an earlier one, and
    are not here. damage says what ended the reading early, None for a file that reads to its end.
    """

    messages: dict[str, dict[int, Location]] = field(default_factory=dict)
    small: dict[str, dict[int, Any]] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    static_transforms: list[Any] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, int] = field(default_factory=dict)
    unstamped: set[str] = field(default_factory=set)
    repeats: dict[str, int] = field(default_factory=dict)
    damage: str | None = None


def scan(path: Path, wanted: Mapping[str, Wanted]) -> Contents:
    """Read the whole file once, keeping places and small messages of the topics wanted; stop at the first damage.

    Every chunk's checksum is checked here, so what was found can be read later.
    Raises RecordingError when the file cannot be opened or is no MCAP file.
    """
    with ClippedFile(path) as file:
        reader = _Scanner(file, wanted)
        try:
            reader.run()
        except Exception as error:
            # The mcap library raises whatever its parsers stumble on: struct, Unicode, zstd, memory errors.
            if not reader.started:
                raise RecordingError(f"{path}: not an MCAP file, or cut off in its first bytes") from error
            what = str(error) or type(error).__name__
            reader.contents.damage = f"damaged or cut off at byte {reader.offset}: {what}"
    reader.use_log_times()
    return reader.contents


class _Scanner:
    def __init__(self, file: "ClippedFile", wanted: Mapping[str, Wanted]) -> None:
        self.contents = Contents()
        self.started = False
        self.offset = 0
        self._file = file
        self._wanted = wanted
        self._topics: dict[int, str] = {}
        self._schema_names: dict[int, str] = {}
        self._n_messages = 0
        self._stamp = ros2.decoder("std_msgs/msg/Header")
        # By the time of writing, of topics that have had but one header stamp so far.
        self._logged = Contents()

    def run(self) -> None:
        for record in _stream_reader(self._file).records:
            self.started = True
            self._take(record)
            self.offset = self._file.tell()

    def use_log_times(self) -> None:
        """At the end: for topics whose header stamps say nothing."""
        contents = self.contents
        for topic, places in self._logged.messages.items():
            if len(places) >= UNSTAMPED:
                contents.messages[topic], contents.small[topic] = places, self._logged.small.get(topic, {})
                contents.unstamped.add(topic)
                contents.repeats[topic] -= len(places) - 1

    def _take(self, record: McapRecord) -> None:
        contents = self.contents
        if isinstance(record, Chunk):
            for number, inner in enumerate(open_chunk(record)):
                self._take_data(inner, Location(self.offset, number))
        elif isinstance(record, Metadata):
            contents.metadata.setdefault(record.name, {}).update(record.metadata)
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
            type_name = self._schema_names.get(record.schema_id, "")
            first = self.contents.types.setdefault(record.topic, type_name)
            wanted = self._wanted.get(record.topic)
            if wanted and record.message_encoding == "cdr" and type_name == first and type_name in wanted.types:
                self._topics[record.id] = record.topic
        elif isinstance(record, Message):
            self._n_messages += 1
            if record.channel_id in self._topics:
                self._take_message(self._topics[record.channel_id], record, location)

    def _take_message(self, topic: str, message: Message, location: Location) -> None:
        data = message.data
        type_name = self.contents.types[topic]
        if type_name == TRANSFORMS:
            # It has no header of its own.
            transforms = ros2.decoder(type_name)(data).transforms
            if topic == ros2.TF_STATIC:
                self.contents.static_transforms.extend(transforms)
            if topic == ros2.TF_STATIC or not transforms:
                return
            stamp_ns = ros2.header_stamp_ns(transforms[0].header)
        else:
            stamp_ns = ros2.header_stamp_ns(self._stamp(data))
        self._keep(self.contents, topic, stamp_ns, data, location)
        if len(self.contents.messages[topic]) > 1:
            self._logged.messages.pop(topic, None)
            self._logged.small.pop(topic, None)
        else:
            self._keep(self._logged, topic, min(message.log_time, LAST_STAMP_NS), data, location)

    def _keep(self, held: Contents, topic: str, stamp_ns: int, data: bytes, location: Location) -> None:
        places, wanted = held.messages.setdefault(topic, {}), self._wanted[topic]
        if stamp_ns in places:
            held.repeats[topic] = held.repeats.get(topic, 0) + 1
            return
        if wanted.keep is not None and not (wanted.once and held.small.get(topic)):
            decoded = ros2.decoder(self.contents.types[topic])(data)
            held.small.setdefault(topic, {})[stamp_ns] = wanted.keep(decoded)
        places[stamp_ns] = location


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
