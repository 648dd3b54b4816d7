"""What all recordings told by ROS messages share: pictures, their calibration and poses, each with its stamp."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numpy as np

from ..camera import SIDES, Rectification, StereoCamera
from ..errors import InvalidInputError
from ..observation import Image
from . import ros2_messages as ros2
from . import ros2_raw as raw
from .contents import Contents
from .odometry_path import OdometryPath, Stamps
from .raw_recording import PictureAt, RawRecording
from .raw_topics import RawTopics
from .ros2_images import read_image

MessageAt = Callable[[str, int], Any]
"""message_at(topic, stamp_ns): the decoded message."""


class ToldRecording(RawRecording):
    """A subclass fills `_contents`, calls `_use` with the topics to use, and gives `_messages`.

    unstamped: topics whose messages all have one header stamp, and are taken to be of the moments at which they were
    recorded.
    """

    _contents: Contents
    _topics: RawTopics
    unstamped: tuple[str, ...] = ()

    def notes(self) -> Iterator[str]:
        """Skew, and topics whose stamps say nothing."""
        yield from super().notes()
        for topic in self.unstamped:
            yield f"all of {topic} has one header stamp: the times at which it was recorded are used instead"

    @abstractmethod
    def _messages(self) -> AbstractContextManager[MessageAt]:
        """Open what is needed to read messages by topic and stamp."""

    @contextmanager
    def _pictures(self) -> Iterator[PictureAt]:
        with self._messages() as message_at:

            def picture_at(side: int, stamp_ns: int) -> Image:
                topic = self._topics.images[side]
                return read_image(message_at(topic, stamp_ns), topic, self.raw_shape)

            yield picture_at

    def _use(self, topics: RawTopics, *, standing: bool) -> None:
        self._topics = topics
        used = (*topics.images, *(() if standing else (topics.odometry,)))
        self.unstamped = tuple(topic for topic in used if topic in self._contents.unstamped)
        self._contents.require(*topics.images)

    def _own_rig(self) -> Rectification | StereoCamera:
        """What the CameraInfo say: what rectifies the pictures, or the camera of those that are."""
        infos = self._topics.infos
        if not any(info in self._contents.messages for info in infos):
            raise InvalidInputError(
                f"no messages on {' and '.join(infos)}: it was recorded without a calibration; give one "
                "(--calibration rig.toml)"
            )
        self._contents.require(*infos)
        left, right = (self._contents.first(info) for info in infos)
        if self._topics.rectified:
            return ros2.read_camera(left, right)
        return raw.rectification(*(raw.read_camera_info(*each) for each in zip((left, right), SIDES, strict=True)))

    def _picture_stamps(self) -> tuple[Stamps, Stamps]:
        self._leave_out("pictures with the stamp of an earlier one", self._repeats(*self._topics.images))
        left_ns, right_ns = (
            np.array(sorted(self._contents.messages[topic]), np.int64) for topic in self._topics.images
        )
        return left_ns, right_ns

    def _path(self, *, strict: bool = True) -> OdometryPath:
        """What the topic of the odometry tells. strict: a pose that is none is an error; else it is left out."""
        topic = self._topics.odometry
        told: Mapping[int, Any] = self._contents.small.get(topic, {})
        if not told:
            raise InvalidInputError(
                f"no messages on {topic}: it was recorded without a robot; where the rig stood still, say so "
                "(--poses standing)"
            )
        self._leave_out("reports of the odometry with the stamp of an earlier one", self._repeats(topic))
        stamps_ns = np.array(sorted(told), np.int64)
        poses, wrong = ros2.read_poses([told[stamp_ns].pose for stamp_ns in stamps_ns.tolist()])
        if wrong.any() and (strict or wrong.all()):
            # Says what is wrong with the first.
            self._contents.pose(topic, int(stamps_ns[wrong.argmax()]))
        self._leave_out("reports of the odometry that are NaN or no rotation", int(wrong.sum()))
        stamps_ns = stamps_ns[~wrong]
        return OdometryPath.of(stamps_ns, poses[~wrong], [told[stamp_ns].frame for stamp_ns in stamps_ns.tolist()])

    def _repeats(self, *topics: str) -> int:
        return sum(self._contents.repeats.get(topic, 0) for topic in topics)
