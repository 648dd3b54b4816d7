"""Where a file has pictures of two cameras, their CameraInfo and the odometry: as its user says, or found by names."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from ..calibration import Mount, StereoCalibration, load_calibration
from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray
from . import ros2_messages as ros2
from . import ros2_raw as raw
from .contents import TRANSFORMS, Contents, Wanted, told_pose, whole

CAMERA_INFO = raw.TOPICS[ros2.LEFT_INFO]
ODOMETRY = raw.TOPICS[ros2.ODOMETRY]
POSE_TYPES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
)
BY_TYPE = {
    **dict.fromkeys(raw.IMAGE_TYPES, Wanted(raw.IMAGE_TYPES)),
    CAMERA_INFO: Wanted((CAMERA_INFO,), whole, once=True),
    **{name: Wanted((name,), told_pose) for name in (ODOMETRY, *POSE_TYPES)},
    TRANSFORMS: Wanted((TRANSFORMS,), transforms=True),
}
"""What a scan keeps of a file whose topics are yet to be found."""

_SIDES = (
    (r"left", "right"),
    (r"(?<![a-z0-9])l(?![a-z0-9])", "r"),
    (r"(?<=infra)1", "2"),
    (r"(?<![0-9])0+(?![0-9])", None),
    (r"(?<![0-9])0*1(?![0-9])", None),
)
"""What is left in a topic's name, and what stands there for the right camera (None: the next number); the most certain
first."""
_NO_PICTURES = re.compile(r"depth|dispar|mask|label|segment|confidence|theora|truth")


@dataclass(frozen=True)
class RawTopics:
    """Where a file has the pictures of the left and the right camera, their CameraInfo, and the odometry."""

    left_image: str = raw.LEFT_IMAGE
    right_image: str = raw.RIGHT_IMAGE
    left_info: str = ros2.LEFT_INFO
    right_info: str = ros2.RIGHT_INFO
    odometry: str = ros2.ODOMETRY

    @property
    def images(self) -> tuple[str, str]:
        """Of the left and the right camera."""
        return self.left_image, self.right_image

    @property
    def infos(self) -> tuple[str, str]:
        """Of the left and the right camera."""
        return self.left_info, self.right_info

    @property
    def rectified(self) -> bool:
        """Whether their names say that the pictures are rectified, as ROS names them."""
        return all(is_rectified(topic) for topic in self.images)

    def wanted(self) -> dict[str, Wanted]:
        """What of the file a scan has to keep."""
        return {
            ros2.TF_STATIC: Wanted((raw.TOPICS[ros2.TF_STATIC],)),
            **dict.fromkeys(self.infos, BY_TYPE[CAMERA_INFO]),
            **dict.fromkeys(self.images, Wanted(raw.IMAGE_TYPES)),
            self.odometry: BY_TYPE[ODOMETRY],
        }


@dataclass(frozen=True, eq=False)
class Given:
    """What a user says in place of what a recording says of itself; "" and None leave it to the recording.

    left_image ... odometry: topics; odometry may be /tf. calibration: of the cameras, whose pictures are then raw;
    T_base_cam (4, 4): of the rectified left camera; standing: the rig stood still all the time.
    """

    left_image: str = ""
    right_image: str = ""
    left_info: str = ""
    right_info: str = ""
    odometry: str = ""
    calibration: StereoCalibration | None = None
    T_base_cam: FloatArray | None = None
    standing: bool = False

    @classmethod
    def told(
        cls, topics: Sequence[str] = (), *, calibration: Path | None = None, mount: str = "", standing: bool = False
    ) -> "Given":
        """From texts. topics: in the order of the fields; calibration: a file; mount: as Mount.parse takes it.

        Raises ConfigError or InvalidInputError when one of them is wrong.
        """
        known = None if calibration is None else load_calibration(calibration)
        T_base_cam = Mount.parse(mount).T_base_cam if mount else getattr(known, "T_base_cam", None)
        given = cls(calibration=known.calibration if known else None, T_base_cam=T_base_cam, standing=standing)
        named: dict[str, Any] = dict(zip(TOPICS, topics, strict=False))
        return replace(given, **named)

    @property
    def said(self) -> list[str]:
        """What is said, by the names of the fields."""
        return [name for name, value in vars(self).items() if not isinstance(value, str | bool | None) or value]

    @property
    def names_topics(self) -> bool:
        """Whether a topic is named."""
        return any((self.left_image, self.right_image, self.left_info, self.right_info, self.odometry))


TOPICS = tuple(each.name for each in fields(RawTopics))
"""The topics among them, in their order."""
GIVEN = tuple(each.name for each in fields(Given))
"""All that a user may say."""


class UnusableBagError(RecordingError):
    """No recording can be made of what a file holds. topics: (type, count) by name of all that it has; listed: what of
    the message tells them."""

    listed = ""

    def __init__(self, what: str, contents: Contents) -> None:
        self.topics = {topic: (name, contents.counts.get(topic, 0)) for topic, name in sorted(contents.types.items())}
        super().__init__(what)

    def at(self, path: Path, damage: str | None) -> "UnusableBagError":
        """The same, naming the file, and its damage."""
        self.args = (f"{path}: {self}" + (f" ({damage})" if damage else ""),)
        return self


class MissingTopicsError(UnusableBagError):
    """A file has no topics that are needed: it says which it has."""

    def __init__(self, what: str, contents: Contents) -> None:
        super().__init__(what, contents)
        listed = ", ".join(f"{topic} ({name}, {n})" for topic, (name, n) in self.topics.items()) or "none at all"
        self.listed = f"; its topics: {listed}"
        self.args = (f"{what}{self.listed}",)


def is_rectified(topic: str) -> bool:
    """Whether the name says so: image_rect, image_rect_color, infra1/image_rect_raw, rect/image, ..."""
    return "rect" in topic.lower().replace("direct", "")


def find_topics(contents: Contents, given: Given, *, by_tf: bool) -> RawTopics:
    """The topics that are given, and for the others those that look most like them; odometry "" where there is none.

    by_tf: whether the transforms tell where something is in the world.
    Raises MissingTopicsError when there are no pictures of two cameras, InvalidInputError for a given topic that is not
    there or holds something else.
    """
    _check_given(contents, given)
    left, right = _images(contents, given)
    odometry = given.odometry or ("" if given.standing else _odometry(contents, by_tf=by_tf))
    return RawTopics(left, right, *_infos(left, right, contents, given), odometry)


def pairs_of(topics: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Pairs (left, right) that differ in what says the side, the most certain first."""
    names = sorted(topics, key=lambda name: (len(name), name))
    known = set(names)
    for left_side, right_side in _SIDES:
        for left in names:
            right = _other_side(left, left_side, right_side)
            if right != left and right in known:
                yield left, right


def _other_side(topic: str, left_side: str, right_side: str | None) -> str:
    def other(match: "re.Match[str]") -> str:
        found = match.group()
        if right_side is None:
            return str(int(found) + 1).zfill(len(found))
        return right_side.upper() if found.isupper() else right_side.title() if found.istitle() else right_side

    return re.sub(left_side, other, topic, flags=re.IGNORECASE)


def _images(contents: Contents, given: Given) -> tuple[str, str]:
    if given.left_image and given.right_image:
        return given.left_image, given.right_image
    pictures = [
        topic for topic, name in contents.types.items() if name in raw.IMAGE_TYPES and contents.messages.get(topic)
    ]
    if not given.left_image and not given.right_image:
        pictures = [topic for topic in pictures if not _NO_PICTURES.search(topic.lower())]
    found = [pair for pair in pairs_of(pictures) if _agrees(pair, given)]
    if not found:
        raise MissingTopicsError(
            "no topics are pictures of a left and a right camera by their names: say which with --left-topic and "
            "--right-topic",
            contents,
        )
    # Stable: of those that are alike in this, the most certain.
    return min(found, key=lambda pair: _rank(pair, contents, given))


def _agrees(pair: tuple[str, str], given: Given) -> bool:
    return given.left_image in ("", pair[0]) and given.right_image in ("", pair[1])


def _rank(pair: tuple[str, str], contents: Contents, given: Given) -> tuple[bool, ...]:
    """Pictures that fit what is known; then those that lose nothing and cost least."""
    left = pair[0]
    rectified = is_rectified(left)
    return (
        len({is_rectified(topic) for topic in pair}) > 1,
        # A calibration is of raw pictures.
        rectified if given.calibration is not None else not rectified,
        contents.types[left] == raw.IMAGE_TYPES[0],
        "color" in left or "rgb" in left,
    )


def _infos(left: str, right: str, contents: Contents, given: Given) -> tuple[str, str]:
    """Those beside the pictures, else those whose names have most in common with theirs; else the usual names."""
    infos = [topic for topic in contents.messages if contents.types[topic] == CAMERA_INFO]
    found = [_beside(left, infos), _beside(right, infos)]
    if not all(topic in infos for topic in found):
        pairs = sorted(pairs_of(infos), key=lambda pair: -_n_shared(pair[0], left))
        found = [*pairs[0]] if pairs else found
    return given.left_info or found[0], given.right_info or found[1]


def _n_shared(a: str, b: str) -> int:
    """The folders that two topics share."""
    return sum(1 for _ in takewhile(lambda names: names[0] == names[1], zip(a.split("/"), b.split("/"), strict=False)))


def _beside(image: str, infos: list[str]) -> str:
    """The camera_info beside a topic of pictures, or beside a folder above it."""
    parts = image.split("/")
    beside = ["/".join([*parts[:k], "camera_info"]) for k in range(len(parts) - 1, 0, -1)]
    return next((topic for topic in beside if topic in infos), beside[0] if beside else image)


def _odometry(contents: Contents, *, by_tf: bool) -> str:
    """An Odometry, the transforms, or poses of something: the first that there is; "" for none."""
    for types in ((ODOMETRY,), (), POSE_TYPES):
        # A lone pose is where someone wants to go, or began.
        found = [
            topic
            for topic, poses in contents.small.items()
            if contents.types[topic] in types and (len(poses) > 1 or types == (ODOMETRY,))
        ]
        if found:
            return min(found, key=lambda topic: _odometry_rank(topic, contents))
        if not types and by_tf:
            return ros2.TF
    return ""


def _odometry_rank(topic: str, contents: Contents) -> tuple[bool, bool, int, str]:
    return topic != ros2.ODOMETRY, not topic.endswith(ros2.ODOMETRY), -len(contents.small[topic]), topic


def _check_given(contents: Contents, given: Given) -> None:
    expected: Mapping[str, tuple[str, ...]] = {
        "left_image": raw.IMAGE_TYPES,
        "right_image": raw.IMAGE_TYPES,
        "left_info": (CAMERA_INFO,),
        "right_info": (CAMERA_INFO,),
        "odometry": (ODOMETRY, *POSE_TYPES, TRANSFORMS),
    }
    for name, types in expected.items():
        topic = getattr(given, name)
        if not topic:
            continue
        if topic not in contents.types:
            raise MissingTopicsError(f"there is no topic {topic}", contents)
        if contents.types[topic] not in types:
            raise InvalidInputError(f"{topic} holds {contents.types[topic]}, not {' or '.join(types)}")
