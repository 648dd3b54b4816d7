"""The files that a ROS bag is made of: ROS 1's .bag and ROS 2's .db3 through `rosbags`, .mcap through our own scan."""

from abc import ABC, abstractmethod
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader as Rosbag1Reader
from rosbags.rosbag2 import Reader as Rosbag2Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ..errors import InvalidInputError, RecordingError
from .bag_bounds import bound_chunks, unpack_message
from .contents import TRANSFORMS, Collector
from .mcap_scan import messages_of, scan_into
from .ros2_schemas import SCHEMAS

DataAt = Callable[[Any], bytes]
"""data_at(place): the message there, as CDR bytes."""

_OLD_NAMES = {"tf/msg/tfMessage": TRANSFORMS}
"""Types of ROS 1 that are the same as others under a newer name."""


class BagFile(ABC):
    """One file of a bag. number: which of the bag's files it is; part of the places of its messages. packed: each
    message is compressed."""

    def __init__(self, path: Path, number: int = 0, *, packed: bool = False) -> None:
        self.path = path
        self.number = number
        self._unpack = unpack_message if packed else bytes
        self.n_wrong = 0

    @abstractmethod
    def scan_into(self, collector: Collector) -> str | None:
        """Hand the messages that are wanted to a collector, at places (number, ...); what ended the reading early.

        n_wrong counts those that could not be decoded. Raises RecordingError when the file cannot be opened.
        """

    @abstractmethod
    @contextmanager
    def opened(self) -> Iterator[DataAt]:
        """Open the file to read messages by the places that a scan gave them."""
        yield from ()


class McapFile(BagFile):
    """An .mcap file: what is readable of a damaged one is read."""

    def scan_into(self, collector: Collector) -> str | None:
        """See BagFile."""
        return scan_into(collector, self.path, lambda location: (self.number, location), self._unpack)

    @contextmanager
    def opened(self) -> Iterator[DataAt]:
        """See BagFile."""
        with messages_of(self.path) as message_at:
            yield lambda place: self._unpack(message_at(place).data)


class _RosbagsFile(BagFile):
    """A file that `rosbags` reads: a message's place is its topic, its time of writing, and the how manieth of those it
    is."""

    def __init__(self, path: Path, number: int = 0, *, packed: bool = False) -> None:
        super().__init__(path, number, packed=packed)
        self._wanted: set[int] = set()

    @abstractmethod
    def _reader(self) -> Any:
        """The reader, yet to be opened."""

    @abstractmethod
    def _cdr(self, type_name: str, data: bytes) -> bytes:
        """A message's bytes as CDR."""

    @contextmanager
    def _open(self) -> Iterator[Any]:
        try:
            reader = self._reader()
            reader.open()
        except Exception as error:
            # Its parsers raise whatever they stumble on: struct, SQLite, assertion and memory errors.
            raise RecordingError(f"{self.path}: {self._unopened(error)}") from error
        try:
            yield reader
        finally:
            reader.close()

    def _unopened(self, error: Exception) -> str:
        return f"cannot be read: {str(error) or type(error).__name__}"

    def scan_into(self, collector: Collector) -> str | None:
        """See BagFile."""
        with self._open() as reader:
            for each in reader.connections:
                collector.count(each.topic, each.msgcount)
                if collector.wants(each.topic, _type_name(each)):
                    self._wanted.add(each.id)
            wanted = self._connections(reader)
            if not wanted:
                return None
            try:
                for connection, place, data in _placed(reader.messages(connections=wanted)):
                    self._take(collector, connection, (self.number, place), data)
            except Exception as error:
                return f"{self.path.name} is damaged or cut off: {str(error) or type(error).__name__}"
        return None

    def _connections(self, reader: Any, topic: str | None = None) -> list[Any]:
        """Those that a scan found to be wanted, of one topic or of all."""
        return [each for each in reader.connections if each.id in self._wanted and topic in (None, each.topic)]

    def _at(self, reader: Any, connections: list[Any], time_ns: int) -> Iterator[tuple[Any, int, bytes]]:
        """The messages on connections of one moment."""
        yield from reader.messages(connections=connections, start=time_ns, stop=time_ns + 1)

    def _take(self, collector: Collector, connection: Any, place: Any, data: bytes) -> None:
        try:
            collector.take(connection.topic, place[1][1], self._cdr(_type_name(connection), data), place)
        except Exception:
            # One message that is not what its topic promises does not end a bag.
            self.n_wrong += 1

    @contextmanager
    def opened(self) -> Iterator[DataAt]:
        """See BagFile."""
        with self._open() as reader:

            def data_at(place: tuple[str, int, int]) -> bytes:
                topic, time_ns, number = place
                found = self._at(reader, self._connections(reader, topic), time_ns)
                connection, _, data = next(islice(found, number, None), (None, 0, b""))
                if connection is None:
                    raise InvalidInputError("the file changed since it was opened")
                return self._cdr(_type_name(connection), data)

            yield data_at


class Rosbag1File(_RosbagsFile):
    """A .bag file of ROS 1."""

    def __init__(self, path: Path, number: int = 0) -> None:
        super().__init__(path, number)
        # Of ROS 2: what it is asked for has these definitions, and ROS 1 has the same but for the header's `seq`.
        self._types = get_typestore(Stores.ROS2_HUMBLE)
        self._types.register(get_types_from_msg(SCHEMAS[TRANSFORMS], TRANSFORMS))

    def _reader(self) -> Rosbag1Reader:
        return Rosbag1Reader(self.path)

    @contextmanager
    def _open(self) -> Iterator[Any]:
        with super()._open() as reader:
            bound_chunks(reader)
            yield reader

    def _at(self, reader: Any, connections: list[Any], time_ns: int) -> Iterator[tuple[Any, int, bytes]]:
        """See above. The reader would walk through all that is on them: it is shown no more than it is to find."""
        whole = reader.indexes
        reader.indexes = {each.id: _of_time(whole[each.id], time_ns) for each in connections}
        try:
            found = list(reader.messages(connections=connections))
        finally:
            reader.indexes = whole
        yield from found

    def _unopened(self, error: Exception) -> str:
        if "index" in str(error).lower():
            return (
                f"cannot be read ({str(error) or type(error).__name__}): if its recorder was cut off, `rosbag reindex "
                f"{self.path.name}` makes its index anew"
            )
        return super()._unopened(error)

    def _cdr(self, type_name: str, data: bytes) -> bytes:
        return bytes(self._types.ros1_to_cdr(data, type_name))


class SqliteFile(_RosbagsFile):
    """A .db3 file of ROS 2."""

    def _reader(self) -> Rosbag2Reader:
        return Rosbag2Reader(self.path)

    def _cdr(self, type_name: str, data: bytes) -> bytes:  # noqa: ARG002
        return self._unpack(data)


def _of_time(index: list[Any], time_ns: int) -> list[Any]:
    """The entries of a connection's index, which is in the order of its times, that are of one."""
    start, stop = bisect_left(index, time_ns, key=_time_of), bisect_right(index, time_ns, key=_time_of)
    return index[start:stop]


def _time_of(entry: Any) -> int:
    time_ns: int = entry.time
    return time_ns


def _type_name(connection: Any) -> str:
    name: str = connection.msgtype
    return _OLD_NAMES.get(name, name)


def _placed(messages: Iterator[tuple[Any, int, bytes]]) -> Iterator[tuple[Any, tuple[str, int, int], bytes]]:
    """Messages in the order of their times, each with its place."""
    last: dict[str, tuple[int, int]] = {}
    for connection, time_ns, data in messages:
        before_ns, number = last.get(connection.topic, (-1, 0))
        number = number + 1 if before_ns == time_ns else 0
        last[connection.topic] = time_ns, number
        yield connection, (connection.topic, time_ns, number), data
