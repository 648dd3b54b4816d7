"""Recordings in ROS bags: of ROS 1 (.bag), of ROS 2 (a folder, a .db3), and in MCAP files of others."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..camera import Rectification, StereoCamera
from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray, from_rotation, nearest_pose
from . import ros2_messages as ros2
from .bag_folder import Bag
from .bag_mount import BASES, placing
from .contents import TRANSFORMS, Contents
from .odometry_path import OdometryPath
from .raw_recording import PairingLimits, RawDrive
from .raw_topics import Given, MissingTopicsError, UnusableBagError, find_topics
from .told_recording import MessageAt, ToldRecording
from .transforms import Transforms, frame_name, last_name


class BagRecording(ToldRecording):
    """The observations in a ROS bag: pictures, CameraInfo, poses and transforms on whatever topics it has them.

    given: what the user says in place of the bag; the rest is found (find_topics). Pictures whose topics are named as
    rectified are taken as they are; others are rectified by their CameraInfo. The poses are those of an Odometry, of
    the transforms from odom, map or world to the camera, or of a PoseStamped; where the camera sits on the robot is
    what the transforms say of it (placing).
    The whole bag is read through once when it is opened; no picture is decoded or kept.
    limits: of what makes a pair. contents: of a scan that was made already, of a lone .mcap file.
    Raises UnusableBagError when no recording can be made of what the bag holds (MissingTopicsError: it lacks topics),
    RecordingError when it cannot be read.
    """

    def __init__(
        self,
        path: str | Path,
        given: Given | None = None,
        *,
        limits: PairingLimits | None = None,
        contents: Contents | None = None,
    ) -> None:
        self.path, self.metadata, self.left_out = Path(path), {}, {}
        self._given = given or Given()
        self._bag = Bag(self.path)
        self._contents = self._bag.scan(contents)
        self.damage = self._contents.damage
        self._leave_out("messages that cannot be decoded", self._bag.n_wrong)
        with self._opening():
            tree = Transforms(self._contents)
            self._leave_out("transforms that are NaN or no rotation", tree.n_wrong)
            topics = find_topics(self._contents, self._given, by_tf=tree.world)
            self._use(topics, standing=self._given.standing)
            self._lay(self._drive(tree), limits or PairingLimits())

    def notes(self) -> Iterator[str]:
        """Which topics are used, and how the camera was found to sit."""
        yield f"pictures: {', '.join(self._topics.images)}{' (rectified)' if self._rectification is None else ''}"
        if not self._given.standing:
            yield f"poses: {self._topics.odometry}"
        yield from self._mount_notes
        yield from super().notes()

    @contextmanager
    def _messages(self) -> Iterator[MessageAt]:
        with self._bag.opened() as data_at:

            def message_at(topic: str, stamp_ns: int) -> Any:
                data = data_at(self._contents.messages[topic][stamp_ns])
                return ros2.decoder(self._contents.types[topic])(data)

            yield message_at

    @contextmanager
    def _opening(self) -> Iterator[None]:
        """Name the bag, and its damage, in whatever is wrong with what it holds."""
        try:
            yield
        except UnusableBagError as error:
            raise error.at(self.path, self.damage) from None
        except (InvalidInputError, RecordingError) as error:
            # One that was named already is not named again.
            what = str(error).removeprefix(f"{self.path}: ")
            raise UnusableBagError(what, self._contents).at(self.path, self.damage) from error

    def _drive(self, tree: Transforms) -> RawDrive:
        given = self._given
        rig = self._own_rig() if given.calibration is None else given.calibration.rectification()
        camera = self._camera_frame()
        path, child = (None, "") if given.standing else self._told(tree, camera)
        found = placing(tree, camera, child, T_base_cam=given.T_base_cam, R_rect_lens=self._R_rect_lens(rig))
        self._mount_notes = found.notes
        if path is not None:
            T = path.T_odom_base @ found.T_child_base
            # Anew: what the base travels is not what another frame does.
            path = OdometryPath.of(path.stamps_ns, T, [str(piece) for piece in path.piece])
        return RawDrive(self._picture_stamps(), rig, found.T_base_cam, path, self._topics.odometry)

    def _told(self, tree: Transforms, camera: str) -> tuple[OdometryPath, str]:
        """The path of a frame, and its name."""
        topic = self._topics.odometry
        if not topic:
            raise MissingTopicsError(
                "nothing tells where the robot was: no nav_msgs/msg/Odometry, no transforms from odom, map or world, "
                "no poses; where the rig stood still, say so (--poses standing)",
                self._contents,
            )
        if self._contents.types.get(topic) not in (None, TRANSFORMS):
            told = next(iter(self._contents.small.get(topic, {}).values()), None)
            return self._path(strict=False), "" if told is None else frame_name(told.child)
        frames = [camera, *(frame for name in BASES for frame in tree.frames if last_name(frame) == name)]
        moved = next((found for found in map(tree.moving, frames) if found is not None), None)
        if moved is None:
            raise InvalidInputError(
                f"the transforms do not lead from odom, map or world to the left camera's frame {camera!r}; they know "
                f"{', '.join(tree.frames) or 'no frame'}; say what tells where the robot was (--odometry-topic)"
            )
        world, body, stamps_ns, T_world_body = moved
        return OdometryPath.of(stamps_ns, T_world_body, [world] * len(stamps_ns)), body

    def _camera_frame(self) -> str:
        """What the left pictures say, or their CameraInfo."""
        topic = self._topics.left_image
        with self._bag.opened() as data_at, self._naming(f"the first message on {topic}"):
            # Its header alone: a picture that is broken is found when it is read.
            places = self._contents.messages[topic]
            header = ros2.decoder("std_msgs/msg/Header")(data_at(places[min(places)]))
        info = next(iter(self._contents.small.get(self._topics.left_info, {}).values()), None)
        return frame_name(header.frame_id or ("" if info is None else info.header.frame_id))

    def _R_rect_lens(self, rig: Rectification | StereoCamera) -> FloatArray:
        """(3, 3): from the left lens's frame, of which transforms tell, to that of the rectified pictures."""
        if isinstance(rig, Rectification):
            return rig.R_rect_left
        R: FloatArray = np.reshape(self._contents.first(self._topics.left_info).r, (3, 3)).astype(float)
        return nearest_pose(from_rotation(R), "R of the left CameraInfo")[:3, :3] if R.any() else np.eye(3)
