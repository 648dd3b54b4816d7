"""What a file of messages holds: where each lies, by its header stamp, and what of the small ones is kept."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from ..errors import InvalidInputError
from ..geometry import FloatArray
from . import ros2_messages as ros2

UNSTAMPED = 3
"""So many messages of one topic with one header stamp, written at different times, have a driver that sets none."""
TRANSFORMS = "tf2_msgs/msg/TFMessage"
LAST_STAMP_NS = 2**63 - 1


@dataclass(frozen=True)
class Wanted:
    """What is wanted of a topic: messages of one of these types; `keep` makes of one, decoded, what is held in memory.

    once: only of the first one. Without `keep` no more is kept than where each message lies. transforms: the messages
    themselves are kept as they are, all of them, since several may have one stamp.
    """

    types: tuple[str, ...]
    keep: Callable[[Any], Any] | None = None
    once: bool = False
    transforms: bool = False


@dataclass
class Contents:
    """What a scan found of what was wanted. messages: topic -> header stamp [ns] -> place, as the scan names places;
    small: what was kept of them, by the same keys; types and counts: of each topic's messages, wanted or not.

    unstamped: topics all of whose messages have one and the same header stamp; the keys are then the times at which
    they were written to the file (log_time). repeats: by topic, how many messages have the stamp of an earlier one, and
    are not here. transforms: CDR bytes of the messages of moving transforms. damage says what could not be read,
    None for a file that is whole.
    """

    messages: dict[str, dict[int, Any]] = field(default_factory=dict)
    small: dict[str, dict[int, Any]] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    static_transforms: list[Any] = field(default_factory=list)
    transforms: list[bytes] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, int] = field(default_factory=dict)
    unstamped: set[str] = field(default_factory=set)
    repeats: dict[str, int] = field(default_factory=dict)
    damage: str | None = None

    def require(self, *topics: str) -> None:
        """Raises InvalidInputError, naming those of the topics that have no messages."""
        missing = [topic for topic in topics if topic not in self.messages]
        if missing:
            raise InvalidInputError(f"no messages on {', '.join(missing)}")

    def first(self, topic: str) -> Any:
        """What was kept of the topic's first message."""
        return next(iter(self.small[topic].values()))

    def pose(self, topic: str, stamp_ns: int) -> FloatArray:
        """(4, 4) of the pose that was kept. Raises InvalidInputError, naming topic and stamp, where it is none."""
        return ros2.read_pose(self.small[topic][stamp_ns].pose, f"{topic} at {stamp_ns / 10**9:.9f} s")


@dataclass(frozen=True)
class ToldPose:
    """The pose in a message, still as it was decoded, the frame it is in, and the frame it is of where that is said."""

    frame: str
    pose: Any
    child: str = ""


def told_pose(message: Any) -> ToldPose:
    """Of a decoded message; its covariances, most of it, are let go."""
    if hasattr(message, "transform"):
        pose = SimpleNamespace(position=message.transform.translation, orientation=message.transform.rotation)
    else:
        # A PoseStamped holds its pose, an Odometry a pose with covariance.
        pose = getattr(message.pose, "pose", message.pose)
    return ToldPose(message.header.frame_id, pose, getattr(message, "child_frame_id", ""))


def whole(message: Any) -> Any:
    """All of a decoded message."""
    return message


class Collector:
    """Fills `contents` with what is wanted of the messages that a scan hands it, in the order of the file.

    wanted: by topic; by_type: of topics that it does not name, or that hold something else.
    """

    def __init__(self, wanted: Mapping[str, Wanted], by_type: Mapping[str, Wanted] | None = None) -> None:
        self.contents = Contents()
        self._wanted, self._by_type = dict(wanted), by_type or {}
        self._stamp = ros2.decoder("std_msgs/msg/Header")
        # By the time of writing, of topics that have had but one header stamp so far.
        self._logged = Contents()

    def wants(self, topic: str, type_name: str) -> bool:
        """Whether a topic's messages of this type are wanted; a topic's type is the first that is said of it."""
        first = self.contents.types.setdefault(topic, type_name)
        wanted = self._wanted.get(topic)
        if (wanted is None or type_name not in wanted.types) and type_name == first and type_name in self._by_type:
            wanted = self._wanted[topic] = self._by_type[type_name]
        return wanted is not None and type_name == first and type_name in wanted.types

    def count(self, topic: str, n: int = 1) -> None:
        """So many more messages of a topic, wanted or not."""
        self.contents.counts[topic] = self.contents.counts.get(topic, 0) + n

    def take(self, topic: str, log_ns: int, data: bytes, place: Any) -> None:
        """A message that is wanted, as CDR bytes. Raises whatever a decoder does."""
        type_name = self.contents.types[topic]
        if type_name == TRANSFORMS and self._take_transforms(topic, data):
            return
        if type_name == TRANSFORMS:
            # It has no header of its own.
            transforms = ros2.decoder(type_name)(data).transforms
            if not transforms:
                return
            stamp_ns = ros2.header_stamp_ns(transforms[0].header)
        else:
            stamp_ns = ros2.header_stamp_ns(self._stamp(data))
        self._keep(self.contents, topic, stamp_ns, data, place)
        if len(self.contents.messages[topic]) > 1:
            self._logged.messages.pop(topic, None)
            self._logged.small.pop(topic, None)
        else:
            self._keep(self._logged, topic, min(log_ns, LAST_STAMP_NS), data, place)

    def finish(self) -> None:
        """At the end: topics whose header stamps say nothing get the times of writing."""
        contents = self.contents
        for topic, places in self._logged.messages.items():
            if len(places) >= UNSTAMPED:
                contents.messages[topic], contents.small[topic] = places, self._logged.small.get(topic, {})
                contents.unstamped.add(topic)
                contents.repeats[topic] -= len(places) - 1

    def _take_transforms(self, topic: str, data: bytes) -> bool:
        if topic == ros2.TF_STATIC or (topic.endswith(ros2.TF_STATIC) and self._wanted[topic].transforms):
            self.contents.static_transforms.extend(ros2.decoder(TRANSFORMS)(data).transforms)
            return True
        if self._wanted[topic].transforms:
            self.contents.transforms.append(data)
            return True
        return False

    def _keep(self, held: Contents, topic: str, stamp_ns: int, data: bytes, place: Any) -> None:
        places, wanted = held.messages.setdefault(topic, {}), self._wanted[topic]
        if stamp_ns in places:
            held.repeats[topic] = held.repeats.get(topic, 0) + 1
            return
        if wanted.keep is not None and not (wanted.once and held.small.get(topic)):
            decoded = ros2.decoder(self.contents.types[topic])(data)
            held.small.setdefault(topic, {})[stamp_ns] = wanted.keep(decoded)
        places[stamp_ns] = place
