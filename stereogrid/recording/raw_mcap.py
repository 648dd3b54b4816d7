"""Recordings of raw pictures and of the robot's odometry, each with stamps of its own."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration import StereoCalibration
from ..camera import SIDES, Rectification
from ..errors import InvalidInputError
from ..geometry import FloatArray
from ..observation import Image, Observation, Odometry
from . import ros2_messages as ros2
from . import ros2_raw as raw
from .mcap_base import McapBase, RecordsAt, told_pose, whole
from .mcap_scan import Contents, Wanted
from .odometry_path import UNKNOWN, OdometryPath, Stamps
from .pairing import paired

MAX_SMEAR_PX = 1.0
MAX_GAP_S = 0.5
"""Between reports of the odometry that are further apart the robot was anywhere."""


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

    def wanted(self) -> dict[str, Wanted]:
        """What of the file a scan has to keep."""
        info = Wanted((raw.TOPICS[ros2.LEFT_INFO],), whole, once=True)
        return {
            ros2.TF_STATIC: Wanted((raw.TOPICS[ros2.TF_STATIC],)),
            **dict.fromkeys(self.infos, info),
            **dict.fromkeys(self.images, Wanted(raw.IMAGE_TYPES)),
            self.odometry: Wanted((raw.TOPICS[ros2.ODOMETRY],), told_pose),
        }


class RawMcapRecording(McapBase):
    """The observations in a file of raw pictures: paired by their stamps, rectified while they are read.

    A pair's stamp is the middle of its pictures'; its odometry is interpolated between the two reports around that.
    Where the odometry was lost (its frame changes), the pieces have nothing to do with each other: the one with the
    most pairs counts. travelled_m and turned_rad are summed over its reports.

    topics: where the file has what. rig and T_base_cam: in place of what the file says. standing: the rig stood still
    all the time, so that no odometry is needed. max_skew_s: of the pictures of a pair (see `paired`); max_gap_s: of the
    reports around one; max_smear_px: how far the picture may have moved, by the robot's turning, from the moment of
    the one picture to that of the other, which a matcher would take for disparity.
    camera: the rectified pair; T_base_cam (4, 4); poses (M, 4, 4): the claimed T_world_cam; stamps_s (M,); skew_s (M,):
    how much later the right picture was taken; metadata: the text in the file; damage: what ended the reading early, or
    None; left_out: how many pictures, reports and pairs were, by the reason; unstamped: topics whose messages all have
    one header stamp, and are taken to be of the moments at which they were recorded.
    Raises RecordingError when the file is missing, is no MCAP file or holds no pair with odometry and calibration.
    """

    def __init__(
        self,
        path: str | Path,
        topics: RawTopics | None = None,
        *,
        rig: StereoCalibration | None = None,
        T_base_cam: FloatArray | None = None,
        standing: bool = False,
        max_skew_s: float | None = None,
        max_gap_s: float = MAX_GAP_S,
        max_smear_px: float = MAX_SMEAR_PX,
        contents: Contents | None = None,
    ) -> None:
        self._topics = topics or RawTopics()
        super().__init__(path, self._topics.wanted(), contents)
        self.left_out: dict[str, int] = {}
        used = (*self._topics.images, *(() if standing else (self._topics.odometry,)))
        self.unstamped = tuple(topic for topic in used if topic in self._contents.unstamped)
        with self._opening():
            self._require(*self._topics.images)
            self._rectification = rig.rectification() if rig is not None else self._own_rectification()
            self.camera = self._rectification.camera
            static = self._contents.static_transforms
            self.T_base_cam = ros2.read_static_transform(static) if T_base_cam is None else T_base_cam
            self._pairs_ns = self._pairs(max_skew_s)
            self._odometry = (
                [Odometry(np.eye(4))] * len(self._pairs_ns) if standing else self._placed(max_gap_s, max_smear_px)
            )
        middle_ns = self._middle_ns()
        self.stamps_s: FloatArray = np.array([stamp_ns / 10**9 for stamp_ns in middle_ns.tolist()])
        self.skew_s: FloatArray = (self._pairs_ns[:, 1] - self._pairs_ns[:, 0]) / 1e9
        self.poses: FloatArray = np.stack([each.T_odom_base @ self.T_base_cam for each in self._odometry])

    def __len__(self) -> int:
        return len(self._pairs_ns)

    def __iter__(self) -> Iterator[Observation]:
        with self._opened() as records_at:
            for number in range(len(self)):
                yield self._observation(number, records_at)

    def raw_pairs(self) -> Iterator[tuple[Image, Image]]:
        """The pairs as the cameras gave them, in the same order."""
        with self._opened() as records_at:
            for number in range(len(self)):
                with self._naming(f"the pair at {self.stamps_s[number]:.9f} s"):
                    yield self._raw_pair(number, records_at)

    def _observation(self, number: int, records_at: RecordsAt) -> Observation:
        stamp_s = float(self.stamps_s[number])
        with self._naming(f"the observation at {stamp_s:.9f} s"):
            left, right = self._rectification.rectify(*self._raw_pair(number, records_at))
            return Observation(stamp_s, left, right, self._odometry[number], self.poses[number])

    def _raw_pair(self, number: int, records_at: RecordsAt) -> tuple[Image, Image]:
        left, right = (
            raw.read_image(self._message(topic, stamp_ns, records_at), topic, self.camera.shape)
            for topic, stamp_ns in zip(self._topics.images, self._pairs_ns[number].tolist(), strict=True)
        )
        return left, right

    def _own_rectification(self) -> Rectification:
        infos = self._topics.infos
        if not any(info in self._contents.messages for info in infos):
            raise InvalidInputError(f"no messages on {' and '.join(infos)}: it was recorded without a calibration")
        self._require(*infos)
        left, right = (raw.read_camera_info(self._first(info), side) for info, side in zip(infos, SIDES, strict=True))
        return raw.rectification(left, right)

    def _pairs(self, max_skew_s: float | None) -> Stamps:
        """Stamps (M, 2) of the left and the right picture of each pair."""
        self._leave_out("pictures with the stamp of an earlier one", self._repeats(*self._topics.images))
        stamps_ns = [np.array(sorted(self._contents.messages[topic]), np.int64) for topic in self._topics.images]
        numbers = paired(stamps_ns[0], stamps_ns[1], max_skew_s)
        self._leave_out("pictures without one of the other camera", sum(map(len, stamps_ns)) - 2 * len(numbers))
        if len(numbers) == 0:
            raise InvalidInputError("no two pictures of the left and the right camera are of the same moment")
        pairs_ns: Stamps = np.stack([each[numbers[:, side]] for side, each in enumerate(stamps_ns)], axis=1)
        return pairs_ns

    def _placed(self, max_gap_s: float, max_smear_px: float) -> list[Odometry]:
        """The odometry of the pairs; those without, and those smeared, are left out."""
        path = self._path()
        apart_s = np.abs(self._pairs_ns[:, 1] - self._pairs_ns[:, 0]) / 1e9
        smeared = self.camera.focal_px * path.turn_radps(self._middle_ns()) * apart_s > max_smear_px
        self._leave_out("pairs taken too far apart for how fast the robot turned", int(smeared.sum()))
        self._pairs_ns = self._pairs_ns[~smeared]
        pieces = path.pieces_at(self._middle_ns(), max_gap_s)
        known = pieces[pieces != UNKNOWN]
        self._leave_out("pairs where the odometry does not reach", len(pieces) - len(known))
        if len(known) == 0:
            raise InvalidInputError(f"{self._topics.odometry} tells of no moment at which a pair was taken")
        longest = np.bincount(known).argmax()
        self._leave_out("pairs of other pieces of the drive: the odometry was lost", int((known != longest).sum()))
        self._pairs_ns = self._pairs_ns[pieces == longest]
        return path.at(self._middle_ns())

    def _path(self) -> OdometryPath:
        topic = self._topics.odometry
        told: Mapping[int, Any] = self._contents.small.get(topic, {})
        if not told:
            raise InvalidInputError(
                f"no messages on {topic}: it was recorded without a robot; where the rig stood still, say so "
                "(--poses standing)"
            )
        self._leave_out("reports of the odometry with the stamp of an earlier one", self._repeats(topic))
        stamps_ns = sorted(told)
        poses, wrong = ros2.read_poses([told[stamp_ns].pose for stamp_ns in stamps_ns])
        if wrong.any():
            # Says what is wrong with the first.
            self._pose(topic, stamps_ns[int(wrong.argmax())])
        return OdometryPath.of(np.array(stamps_ns, np.int64), poses, [told[stamp_ns].frame for stamp_ns in stamps_ns])

    def _repeats(self, *topics: str) -> int:
        return sum(self._contents.repeats.get(topic, 0) for topic in topics)

    def _middle_ns(self) -> Stamps:
        middle: Stamps = self._pairs_ns[:, 0] + (self._pairs_ns[:, 1] - self._pairs_ns[:, 0]) // 2
        return middle

    def _leave_out(self, what: str, count: int) -> None:
        if count:
            self.left_out[what] = count
