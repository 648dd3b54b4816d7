"""Finds what an MCAP file holds, as far as it can be read."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema, Statistics

from ..errors import InvalidInputError, RecordingError
from .contents import Collector, Contents, Wanted
from .mcap_file import ClippedFile, Records


@dataclass(frozen=True)
class Location:
    """Where a message lies: the offset of its record or chunk in the file, and its number in the chunk."""

    offset: int
    number: int


MessageAt = Callable[[Location], Message]


@contextmanager
def messages_of(path: Path) -> Iterator[MessageAt]:
    """Open a file to read messages by the places that a scan gave them."""
    with ClippedFile(path) as file:
        # Many messages may lie in one chunk: unpack it once for all that are near.
        records_at = lru_cache(maxsize=4)(file.records_at)

        def message_at(place: Location) -> Message:
            record = records_at(place.offset)[place.number]
            if not isinstance(record, Message):
                raise InvalidInputError("the file changed since it was opened")
            return record

        yield message_at


def scan(path: Path, wanted: Mapping[str, Wanted], by_type: Mapping[str, Wanted] | None = None) -> Contents:
    """Read the whole file once, keeping places (Location) and small messages of the topics wanted; over damage
    (Records).

    by_type: what is wanted of topics that `wanted` does not name.
    Raises RecordingError when the file cannot be opened or is no MCAP file.
    """
    collector = Collector(wanted, by_type)
    collector.contents.damage = scan_into(collector, path)
    collector.finish()
    return collector.contents


def scan_into(
    collector: Collector,
    path: Path,
    place: Callable[[Location], Any] = lambda at: at,
    unpack: Callable[[bytes], bytes] = bytes,
) -> str | None:
    """Hand a file's messages to a collector; what could not be read, in a line, None for a file that is whole.

    place: what to make of where each lies; unpack: of a message's bytes.
    Raises RecordingError as `scan` does.
    """
    with ClippedFile(path) as file:
        records = Records(file, path)
        scanner = _Scanner(collector, place, unpack)
        for offset, found in records:
            scanner.take(offset, found)
        if records.is_empty:
            raise RecordingError(f"{path}: not an MCAP file, or cut off in its first bytes")
    return _damage([*records.damages, *scanner.faults], scanner.n_messages, scanner.n_written)


def _damage(faults: list[str], n_found: int, n_written: int | None) -> str | None:
    """What could not be read, in one line."""
    if n_written is not None and n_found != n_written and not faults:
        return f"{n_found} messages found where {n_written} were written"
    if not faults:
        return None
    places = f" and in {len(faults) - 1} more places" if len(faults) > 1 else ""
    lost = "" if n_written is None else f"; {max(n_written - n_found, 0)} of {n_written} messages are lost"
    return f"damaged or cut off at {faults[0]}{places}{lost}"


class _Scanner:
    """n_messages: found; n_written: how many the file says that it has, None where it does not get to say so.

    faults: records that say what no record can, in words.
    """

    def __init__(
        self, collector: Collector, place: Callable[[Location], Any], unpack: Callable[[bytes], bytes]
    ) -> None:
        self.n_messages = 0
        self.n_written: int | None = None
        self.faults: list[str] = []
        self._collector, self._place, self._unpack = collector, place, unpack
        self._topics: dict[int, str] = {}
        self._wanted: set[int] = set()
        self._schema_names: dict[int, str] = {}

    def take(self, offset: int, records: list[McapRecord]) -> None:
        """Take the record at an offset, or those of the chunk there; what cannot be decoded is a fault."""
        for number, record in enumerate(records):
            self._try(record, Location(offset, number))

    def _try(self, record: McapRecord, location: Location) -> None:
        try:
            self._take(record, location)
        except Exception as error:
            # Decoders of foreign bytes raise whatever they stumble on.
            self.faults.append(f"byte {location.offset}: {str(error) or type(error).__name__}")

    def _take(self, record: McapRecord, location: Location) -> None:
        contents = self._collector.contents
        if isinstance(record, Message):
            self._take_message(record, location)
            self.n_messages += 1
        elif isinstance(record, Schema):
            self._schema_names[record.id] = record.name
        elif isinstance(record, Channel):
            self._take_channel(record)
        elif isinstance(record, Metadata):
            contents.metadata.setdefault(record.name, {}).update(record.metadata)
        elif isinstance(record, Attachment):
            contents.attachments[record.name] = location.offset
        elif isinstance(record, Statistics):
            self.n_written = record.message_count

    def _take_channel(self, channel: Channel) -> None:
        self._topics[channel.id] = channel.topic
        self._wanted.discard(channel.id)
        wanted = self._collector.wants(channel.topic, self._schema_names.get(channel.schema_id, ""))
        if wanted and channel.message_encoding == "cdr":
            self._wanted.add(channel.id)

    def _take_message(self, message: Message, location: Location) -> None:
        topic = self._topics.get(message.channel_id)
        if topic is not None:
            self._collector.count(topic)
        if topic is not None and message.channel_id in self._wanted:
            self._collector.take(topic, message.log_time, self._unpack(message.data), self._place(location))
