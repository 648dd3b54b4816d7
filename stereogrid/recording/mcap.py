"""Recordings as MCAP files of ROS 2 messages, which Foxglove and `ros2 bag` open too."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
from mcap.records import Attachment

from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray
from ..observation import Image, Observation, Truth
from . import ros2_messages as ros2
from .contents import Contents, Wanted, told_pose, whole
from .file_recording import ObservationAt
from .images import decode_grey, png_size
from .mcap_base import McapBase
from .mcap_file import ClippedFile
from .mcap_scan import MessageAt, messages_of
from .mcap_writer import MESH_NAME, McapWriter, mover_mesh_name, mover_of_mesh
from .ticks import Ticks
from .track import odometry_track

__all__ = ["McapRecording", "McapWriter"]

RECTIFIED = (ros2.LEFT_IMAGE, ros2.RIGHT_IMAGE)
"""The topics of the pictures."""
_REQUIRED = (*RECTIFIED, ros2.ODOMETRY)

WANTED = {topic: Wanted((type_name,)) for topic, type_name in ros2.TOPICS.items() if topic != ros2.TF} | {
    topic: Wanted((ros2.TOPICS[topic],), keep, once=keep is whole)
    for topic, keep in (
        (ros2.LEFT_INFO, whole),
        (ros2.RIGHT_INFO, whole),
        (ros2.ODOMETRY, told_pose),
        (ros2.TRUE_POSE, told_pose),
    )
}


class McapRecording(McapBase):
    """The observations of an MCAP file written by McapWriter; images are read as they are asked for.

    The file is read through once when it is opened: damage is found then, and all before it can be used.
    Messages belong to one observation when their header stamps are equal; one without both images and
    odometry is left out. The recording claims its odometry: T_world_cam = T_odom_base @ T_base_cam.

    camera; T_base_cam (4, 4); poses (M, 4, 4): the claimed T_world_cam; metadata: the text in the file;
    damage: what ended the reading early, or None.
    Raises RecordingError when the file is missing, is no MCAP file or holds no observation of ours.
    """

    def __init__(self, path: str | Path, contents: Contents | None = None) -> None:
        super().__init__(path, WANTED, contents)
        with self._opening():
            self._stamps_ns = self._whole_observations()
            self.camera = ros2.read_camera(self._contents.first(ros2.LEFT_INFO), self._contents.first(ros2.RIGHT_INFO))
            self.T_base_cam = ros2.read_static_transform(self._contents.static_transforms)
            self._odometry = odometry_track([self._contents.pose(ros2.ODOMETRY, stamp) for stamp in self._stamps_ns])
            true_stamps = self._contents.small.get(ros2.TRUE_POSE, {}).keys() & set(self._stamps_ns)
            self._truth = {stamp: self._contents.pose(ros2.TRUE_POSE, stamp) for stamp in true_stamps}
        self.stamps_s = np.array([stamp_ns / 10**9 for stamp_ns in self._stamps_ns])
        self.poses = np.stack([each.T_odom_base @ self.T_base_cam for each in self._odometry])

    @contextmanager
    def _reading(self) -> Iterator[ObservationAt]:
        with messages_of(self.path) as message_at:
            yield partial(self._observation, message_at)

    def true_poses(self) -> FloatArray | None:
        """True T_world_cam (M, 4, 4), NaN for an observation without one; None when there are none at all."""
        if not self._truth:
            return None
        unknown = np.full((4, 4), np.nan)
        return np.stack([self._truth.get(stamp_ns, unknown) for stamp_ns in self._stamps_ns])

    def truth_mesh_ply(self) -> bytes | None:
        """The PLY file of the true world's mesh, or None when the recording carries none."""
        return self._attachment(MESH_NAME)

    def _attachment(self, name: str) -> bytes | None:
        offset = self._contents.attachments.get(name)
        if offset is None:
            return None
        with ClippedFile(self.path) as file:
            (record,) = file.records_at(offset)
        if not isinstance(record, Attachment):
            raise RecordingError(f"{self.path}: changed since it was opened")
        return record.data

    def ticks(self) -> Ticks | None:
        """The robot's true motion between the observations, as the simulator wrote it; None when it did not."""
        topics = (ros2.TRUE_BASE, ros2.WHEELS)
        places = [self._contents.messages.get(topic, {}) for topic in topics]
        stamps_ns = sorted(places[0].keys() & places[1].keys())
        if not stamps_ns:
            return None
        poses, turns = [], []
        with messages_of(self.path) as message_at:
            for stamp_ns in stamps_ns:
                with self._naming(f"the tick at {stamp_ns / 10**9:.9f} s"):
                    base, wheels = (self._message(topic, stamp_ns, message_at) for topic in topics)
                    poses.append(ros2.read_pose(base.pose, ros2.TRUE_BASE))
                    turns.append(ros2.read_wheels(wheels))
        return Ticks(np.array([stamp_ns / 10**9 for stamp_ns in stamps_ns]), np.array(poses), np.array(turns))

    def mover_names(self) -> tuple[str, ...]:
        """The movers whose meshes the recording carries."""
        return tuple(name for each in self._contents.attachments if (name := mover_of_mesh(each)))

    def mover_mesh_ply(self, name: str) -> bytes | None:
        """The PLY file of a mover's mesh in its own frame, or None when the recording carries none of that name."""
        return self._attachment(mover_mesh_name(name))

    def _observation(self, message_at: MessageAt, number: int) -> Observation:
        stamp_ns = self._stamps_ns[number]
        with self._naming(f"the observation at {stamp_ns / 10**9:.9f} s"):
            left, right = (self._image(topic, stamp_ns, message_at) for topic in (ros2.LEFT_IMAGE, ros2.RIGHT_IMAGE))
            truth = self._read_truth(stamp_ns, message_at)
            odometry = self._odometry[number]
            return Observation(stamp_ns / 10**9, left, right, odometry, self.poses[number], truth)

    def _read_truth(self, stamp_ns: int, message_at: MessageAt) -> Truth | None:
        if stamp_ns not in self._truth:
            return None
        depth_m = None
        if stamp_ns in self._contents.messages.get(ros2.TRUE_DEPTH, {}):
            depth_m = ros2.read_depth(self._message(ros2.TRUE_DEPTH, stamp_ns, message_at))
            self._check_size(ros2.TRUE_DEPTH, depth_m.shape)
        movers = {}
        if stamp_ns in self._contents.messages.get(ros2.TRUE_MOVERS, {}):
            movers = ros2.read_movers(self._message(ros2.TRUE_MOVERS, stamp_ns, message_at))
        return Truth(self._truth[stamp_ns], depth_m, movers)

    def _image(self, topic: str, stamp_ns: int, message_at: MessageAt) -> Image:
        encoded = self._message(topic, stamp_ns, message_at).data
        # Checked before decoding: a hostile image may claim any size.
        self._check_size(topic, png_size(encoded, topic))
        return decode_grey(encoded, topic)

    def _check_size(self, topic: str, shape: tuple[int, ...]) -> None:
        if shape != self.camera.shape:
            raise InvalidInputError(f"{topic} is {shape}, the recording's camera {self.camera.shape}")

    def _whole_observations(self) -> list[int]:
        """The stamps [ns] of the observations that have all that is required."""
        self._contents.require(*_REQUIRED, ros2.LEFT_INFO, ros2.RIGHT_INFO)
        stamps_of = [set(self._contents.messages[topic]) for topic in _REQUIRED]
        stamps = set.intersection(*stamps_of)
        if not stamps:
            raise InvalidInputError("no observation is whole: the stamps of images and odometry never agree")
        self._leave_out("moments without both images and odometry", len(set.union(*stamps_of) - stamps))
        repeats = sum(self._contents.repeats.get(topic, 0) for topic in _REQUIRED)
        self._leave_out("images and odometry with the stamp of an earlier one", repeats)
        return sorted(stamps)
