"""Recordings as MCAP files of ROS 2 messages, which Foxglove and `ros2 bag` open too."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Attachment, McapRecord, Message

from ..errors import InvalidInputError, RecordingError, StereogridError
from ..geometry import FloatArray
from ..observation import Image, Observation, Truth
from . import ros2_messages as ros2
from .images import decode_grey, png_size
from .mcap_scan import ClippedFile, Contents, scan
from .mcap_writer import FORMAT_VERSION, MESH_NAME, METADATA_NAME, NOTE_NAME, McapWriter, mover_mesh_name
from .ticks import Ticks
from .track import odometry_track

__all__ = ["McapRecording", "McapWriter"]

_REQUIRED = (ros2.LEFT_IMAGE, ros2.RIGHT_IMAGE, ros2.ODOMETRY)

_RecordsAt = Callable[[int], list[McapRecord]]


class McapRecording:
    """The observations of an MCAP file written by McapWriter; images are read as they are asked for.

    The file is read through once when it is opened: damage is found then, and all before it can be used.
    Messages belong to one observation when their header stamps are equal; one without both images and
    odometry is left out. The recording claims its odometry: T_world_cam = T_odom_base @ T_base_cam.

    camera; T_base_cam (4, 4); poses (M, 4, 4): the claimed T_world_cam; metadata: the text in the file;
    damage: what ended the reading early, or None.
    Raises RecordingError when the file is missing, is no MCAP file or holds no observation of ours.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        contents = scan(self.path)
        self._contents = contents
        self.damage = contents.damage
        self.metadata = {**contents.metadata.get(METADATA_NAME, {}), **contents.metadata.get(NOTE_NAME, {})}
        try:
            self._stamps_ns = _whole_observations(contents, self.metadata)
            self.camera = ros2.read_camera(_first(contents, ros2.LEFT_INFO), _first(contents, ros2.RIGHT_INFO))
            self.T_base_cam = ros2.read_static_transform(contents.static_transforms)
            self._odometry = odometry_track([self._pose(ros2.ODOMETRY, stamp) for stamp in self._stamps_ns])
            true_stamps = contents.small.get(ros2.TRUE_POSE, {}).keys() & set(self._stamps_ns)
            self._truth = {stamp: self._pose(ros2.TRUE_POSE, stamp) for stamp in true_stamps}
        except InvalidInputError as error:
            raise RecordingError(f"{self.path}: {error}" + (f" ({self.damage})" if self.damage else "")) from error
        self.stamps_s: FloatArray = np.array([stamp_ns / 10**9 for stamp_ns in self._stamps_ns])
        self.poses: FloatArray = np.stack([each.T_odom_base @ self.T_base_cam for each in self._odometry])

    @property
    def is_complete(self) -> bool:
        """False when the file is damaged or was cut off: some observations are then missing."""
        return self.damage is None

    def __len__(self) -> int:
        return len(self._stamps_ns)

    def __iter__(self) -> Iterator[Observation]:
        with ClippedFile(self.path) as file:
            # Other writers put many messages in one chunk: unpack it once for all that are near.
            records_at = lru_cache(maxsize=4)(file.records_at)
            for number in range(len(self)):
                yield self._observation(number, records_at)

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
        with ClippedFile(self.path) as file:
            for stamp_ns in stamps_ns:
                with self._naming(f"the tick at {stamp_ns / 10**9:.9f} s"):
                    base, wheels = (self._message(topic, stamp_ns, file.records_at) for topic in topics)
                    poses.append(ros2.read_pose(base.pose, ros2.TRUE_BASE))
                    turns.append(ros2.read_wheels(wheels))
        return Ticks(np.array([stamp_ns / 10**9 for stamp_ns in stamps_ns]), np.array(poses), np.array(turns))

    def mover_mesh_ply(self, name: str) -> bytes | None:
        """The PLY file of a mover's mesh in its own frame, or None when the recording carries none of that name."""
        return self._attachment(mover_mesh_name(name))

    def _observation(self, number: int, records_at: _RecordsAt) -> Observation:
        stamp_ns = self._stamps_ns[number]
        with self._naming(f"the observation at {stamp_ns / 10**9:.9f} s"):
            left, right = (self._image(topic, stamp_ns, records_at) for topic in (ros2.LEFT_IMAGE, ros2.RIGHT_IMAGE))
            truth = self._read_truth(stamp_ns, records_at)
            odometry = self._odometry[number]
            return Observation(stamp_ns / 10**9, left, right, odometry, self.poses[number], truth)

    @contextmanager
    def _naming(self, what: str) -> Iterator[None]:
        """Turn whatever goes wrong into a RecordingError that names the file and what was read."""
        try:
            yield
        except Exception as error:
            # The mcap library raises whatever its parsers stumble on.
            fault = str(error) if isinstance(error, StereogridError) else f"cannot be decoded: {error!r}"
            raise RecordingError(f"{self.path}: {what}: {fault}") from error

    def _read_truth(self, stamp_ns: int, records_at: _RecordsAt) -> Truth | None:
        if stamp_ns not in self._truth:
            return None
        depth_m = None
        if stamp_ns in self._contents.messages.get(ros2.TRUE_DEPTH, {}):
            depth_m = ros2.read_depth(self._message(ros2.TRUE_DEPTH, stamp_ns, records_at))
            self._check_size(ros2.TRUE_DEPTH, depth_m.shape)
        movers = {}
        if stamp_ns in self._contents.messages.get(ros2.TRUE_MOVERS, {}):
            movers = ros2.read_movers(self._message(ros2.TRUE_MOVERS, stamp_ns, records_at))
        return Truth(self._truth[stamp_ns], depth_m, movers)

    def _image(self, topic: str, stamp_ns: int, records_at: _RecordsAt) -> Image:
        encoded = self._message(topic, stamp_ns, records_at).data
        # Checked before decoding: a hostile image may claim any size.
        self._check_size(topic, png_size(encoded, topic))
        return decode_grey(encoded, topic)

    def _check_size(self, topic: str, shape: tuple[int, ...]) -> None:
        if shape != self.camera.shape:
            raise InvalidInputError(f"{topic} is {shape}, the recording's camera {self.camera.shape}")

    def _message(self, topic: str, stamp_ns: int, records_at: _RecordsAt) -> Any:
        place = self._contents.messages[topic][stamp_ns]
        record = records_at(place.offset)[place.number]
        if not isinstance(record, Message):
            raise InvalidInputError("the file changed since it was opened")
        return ros2.decoder(ros2.TOPICS[topic])(record.data)

    def _pose(self, topic: str, stamp_ns: int) -> FloatArray:
        # A PoseStamped holds its pose, an Odometry a pose with covariance.
        pose = self._contents.small[topic][stamp_ns].pose
        return ros2.read_pose(getattr(pose, "pose", pose), f"{topic} at {stamp_ns / 10**9:.9f} s")


def _first(contents: Contents, topic: str) -> Any:
    return next(iter(contents.small[topic].values()))


def _whole_observations(contents: Contents, metadata: dict[str, str]) -> list[int]:
    if metadata.get("format_version", FORMAT_VERSION) != FORMAT_VERSION:
        raise InvalidInputError(
            f"recording format {metadata['format_version']!r} is not known, only {FORMAT_VERSION!r}"
        )
    missing = [topic for topic in (*_REQUIRED, ros2.LEFT_INFO, ros2.RIGHT_INFO) if topic not in contents.messages]
    if missing:
        raise InvalidInputError(f"no messages on {', '.join(missing)}")
    stamps = set.intersection(*(set(contents.messages[topic]) for topic in _REQUIRED))
    if not stamps:
        raise InvalidInputError("no observation is whole: the stamps of images and odometry never agree")
    return sorted(stamps)
