"""Writes observations as ROS 2 messages to an MCAP file that stays readable when the run is killed."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType

import numpy as np

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import FloatArray, as_pose, inverse
from ..observation import Observation
from . import ros2_messages as ros2
from .ros2_file import Ros2File

MESH_NAME = "truth_mesh.ply"
_MESH_TYPE = "model/ply"


class McapWriter:
    """Writes observations to `path` as they come; use it in a `with` block, which finishes the file.

    Each message is a chunk of its own and is flushed with its observation, so a killed run leaves every
    observation that was written, and poses can be read without the images. Nothing depends on the clock:
    the same observations give the same bytes. An observation's pose is written as its odometry;
    T_world_cam is not, since a reader makes it from T_odom_base @ T_base_cam.

    metadata: text kept in the file. truth_mesh_ply: the bytes of the true world's mesh; mover_meshes_ply: of what
    moves in it, by name, each in its own frame.
    Raises RecordingError when the file exists (unless overwrite) or cannot be written, InvalidInputError
    when an argument is wrong.
    """

    def __init__(
        self,
        path: str | Path,
        camera: StereoCamera,
        T_base_cam: FloatArray,
        *,
        metadata: Mapping[str, str] | None = None,
        truth_mesh_ply: bytes | None = None,
        mover_meshes_ply: Mapping[str, bytes] | None = None,
        overwrite: bool = False,
    ) -> None:
        self.path = Path(path)
        self.camera = camera
        self.T_base_cam = as_pose(T_base_cam, "T_base_cam")
        self._last_stamp_ns: int | None = None
        self._last_tick_ns: int | None = None
        self._file = Ros2File(path, ros2.TOPICS, metadata=metadata or {}, overwrite=overwrite)
        if truth_mesh_ply is not None:
            self._file.attach(MESH_NAME, _MESH_TYPE, truth_mesh_ply)
        for name, mesh_ply in (mover_meshes_ply or {}).items():
            self._file.attach(mover_mesh_name(name), _MESH_TYPE, mesh_ply)
        self._file.flush()

    def write_tick(self, stamp_s: float, T_world_base: FloatArray, wheels_rad: FloatArray) -> None:
        """Append the robot's true pose (4, 4) and the turns (2,) of its wheels [rad] at a time between observations.

        Ticks come in the order of their stamps, best before the observation that they lead to.
        Raises InvalidInputError when the stamp does not increase, RecordingError when the file cannot be written.
        """
        stamp_ns = ros2.stamp_to_ns(stamp_s)
        if self._last_tick_ns is not None and stamp_ns <= self._last_tick_ns:
            raise InvalidInputError(f"ticks' stamps must increase: {stamp_s} s follows {self._last_tick_ns / 1e9} s")
        self._file.write(ros2.TRUE_BASE, stamp_ns, ros2.true_pose_message(stamp_ns, T_world_base))
        self._file.write(ros2.WHEELS, stamp_ns, ros2.wheels_message(stamp_ns, wheels_rad))
        self._last_tick_ns = stamp_ns

    def write_note(self, key: str, text: str) -> None:
        """Add to the metadata what became known while recording, such as why it ended; one note a recording."""
        self._file.note(key, text)

    def write(self, observation: Observation) -> None:
        """Append one observation.

        Raises InvalidInputError when its images are not the camera's size or its stamp does not increase,
        RecordingError when the file cannot be written.
        """
        stamp_ns = self._checked_stamp_ns(observation)
        if self._last_stamp_ns is None:
            self._file.write(ros2.TF_STATIC, stamp_ns, self._standing(stamp_ns))
        # The right image comes last: an observation that has it is whole.
        for topic, message in self._messages(stamp_ns, observation):
            self._file.write(topic, stamp_ns, message)
        self._file.flush()
        self._last_stamp_ns = stamp_ns

    def close(self) -> None:
        """Write the index and close the file; closing again does nothing."""
        self._file.close()

    def __enter__(self) -> "McapWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _standing(self, stamp_ns: int) -> ros2.Message:
        """What stands still in the tree of frames: world - odom - base_link - cameras, and world - the true base_link.

        The recording claims that odom is world; how far it drifts is how far base_link is from the true one.
        """
        return ros2.static_transform_message(
            stamp_ns,
            self.T_base_cam,
            ros2.right_camera(self.camera.baseline_m),
            (ros2.WORLD_FRAME, ros2.ODOM_FRAME, np.eye(4)),
            (ros2.TRUE_BASE_FRAME, ros2.TRUE_CAMERA_FRAME, self.T_base_cam),
        )

    def _moving(self, stamp_ns: int, observation: Observation) -> ros2.Message:
        transforms: list[ros2.Transform] = [(ros2.ODOM_FRAME, ros2.BASE_FRAME, observation.odometry.T_odom_base)]
        if observation.truth is not None:
            T_world_base = observation.truth.T_world_cam @ inverse(self.T_base_cam)
            transforms.append((ros2.WORLD_FRAME, ros2.TRUE_BASE_FRAME, T_world_base))
        return ros2.transforms_message(stamp_ns, transforms)

    def _messages(self, stamp_ns: int, observation: Observation) -> Iterator[tuple[str, ros2.Message]]:
        yield ros2.LEFT_INFO, ros2.camera_info_message(stamp_ns, self.camera, right=False)
        yield ros2.RIGHT_INFO, ros2.camera_info_message(stamp_ns, self.camera, right=True)
        yield ros2.ODOMETRY, ros2.odometry_message(stamp_ns, observation.odometry.T_odom_base)
        yield ros2.TF, self._moving(stamp_ns, observation)
        truth = observation.truth
        if truth is not None:
            yield ros2.TRUE_POSE, ros2.true_pose_message(stamp_ns, truth.T_world_cam)
            if truth.movers:
                yield ros2.TRUE_MOVERS, ros2.movers_message(stamp_ns, truth.movers)
            if truth.depth_m is not None:
                yield ros2.TRUE_DEPTH, ros2.depth_message(stamp_ns, truth.depth_m)
        yield ros2.LEFT_IMAGE, ros2.image_message(stamp_ns, observation.left)
        yield ros2.RIGHT_IMAGE, ros2.image_message(stamp_ns, observation.right, right=True)

    def _checked_stamp_ns(self, observation: Observation) -> int:
        truth = observation.truth
        depth = None if truth is None else truth.depth_m
        for name, image in (("image", observation.left), ("true depth", depth)):
            if image is not None and image.shape != self.camera.shape:
                raise InvalidInputError(f"the {name} is {image.shape}, the recording's camera {self.camera.shape}")
        stamp_ns = ros2.stamp_to_ns(observation.stamp_s)
        if self._last_stamp_ns is not None and stamp_ns <= self._last_stamp_ns:
            raise InvalidInputError(
                f"stamps must increase: {observation.stamp_s} s follows {self._last_stamp_ns / 1e9} s"
            )
        return stamp_ns


def mover_mesh_name(name: str) -> str:
    """What the mesh of a mover is called among the file's attachments."""
    return f"mover/{name}.ply"


def mover_of_mesh(attachment: str) -> str:
    """The mover whose mesh an attachment of this name is; "" for another attachment."""
    name = attachment.removeprefix("mover/").removesuffix(".ply")
    return name if attachment == mover_mesh_name(name) else ""
