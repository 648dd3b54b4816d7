"""Writes what a robot and its two cameras send, as it comes, to an MCAP file of ROS 2 messages."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

import numpy as np

from ..calibration import StereoCalibration
from ..camera import Rectification, StereoCamera
from ..errors import InvalidInputError
from ..geometry import FloatArray, as_pose
from ..observation import Image, check_pair
from . import ros2_messages as ros2
from . import ros2_raw as raw
from .ros2_file import Ros2File

_INFOS = (ros2.LEFT_INFO, ros2.RIGHT_INFO)
_IMAGES = (raw.LEFT_IMAGE, raw.RIGHT_IMAGE)


@dataclass(frozen=True)
class RawReport:
    """What a robot tells at a time since 1970.

    T_odom_base (4, 4), speed_mps forwards and turn_radps about z: its odometry. odometry_lost: how often so far the
    motion was lost: poses before and after have nothing to do with each other. sonar_m: ranges by the sonar's number.
    fault: why it may not move, "" for nothing; values: the rest of its state, as text by name.
    """

    stamp_s: float
    T_odom_base: FloatArray
    speed_mps: float = 0.0
    turn_radps: float = 0.0
    odometry_lost: int = 0
    battery_v: float | None = None
    sonar_m: Mapping[int, float] = field(default_factory=dict)
    fault: str = ""
    values: Mapping[str, str] = field(default_factory=dict)


class RawWriter:
    """Raw pairs and the robot's reports, each with stamps of its own, in one file; use it in a `with` block.

    Pictures are lossless. Every call ends with its messages in the file, so a killed run leaves all that was written.
    stereogrid.open_recording rectifies the pairs, and puts each where the odometry was at its moment.

    rig: what the raw pictures are rectified by; a StereoCamera where they are rectified already; None where nobody
    knows: such a file is no recording to map from. T_base_cam (4, 4): of the rectified left camera, or None likewise.
    metadata: text kept in the file.
    Raises RecordingError when the file exists (unless overwrite) or cannot be written, InvalidInputError when an
    argument is wrong.
    """

    def __init__(
        self,
        path: str | Path,
        rig: StereoCalibration | Rectification | StereoCamera | None,
        T_base_cam: FloatArray | None,
        *,
        metadata: Mapping[str, str] | None = None,
        overwrite: bool = False,
    ) -> None:
        self.path = Path(path)
        self._cameras = None if rig is None else camera_matrices(rig)
        self._baseline_m = None if self._cameras is None else _baseline_m(self._cameras[1])
        self._T_base_cam = None if T_base_cam is None else as_pose(T_base_cam, "T_base_cam")
        texts = {raw.KIND: raw.RAW, **(metadata or {})}
        self._file = Ros2File(path, raw.TOPICS, metadata=texts, grouped=True, overwrite=overwrite)

    @property
    def n_bytes(self) -> int:
        """Bytes in the file."""
        return self._file.n_bytes

    def write_pair(self, left: Image, right: Image, left_stamp_s: float, right_stamp_s: float) -> None:
        """Append a raw pair (H, W) uint8, taken at these times since 1970.

        Raises InvalidInputError when the pictures are not of the rig's size, RecordingError when the file cannot be
        written.
        """
        check_pair(left, right)
        size_px = left.shape[1], left.shape[0]
        if self._cameras is not None and size_px != self._cameras[0].size_px:
            raise InvalidInputError(f"the pictures are of {size_px} px, the calibration of {self._cameras[0].size_px}")
        stamps_ns = [ros2.stamp_to_ns(stamp_s) for stamp_s in (left_stamp_s, right_stamp_s)]
        self._place_camera(stamps_ns[0])
        for side, (camera, stamp_ns) in enumerate(zip(self._cameras or (), stamps_ns, strict=False)):
            info = raw.camera_info_message(stamp_ns, camera, right=bool(side))
            self._file.write(_INFOS[side], stamp_ns, info)
        for side, (image, stamp_ns) in enumerate(zip((left, right), stamps_ns, strict=True)):
            self._file.write(_IMAGES[side], stamp_ns, ros2.image_message(stamp_ns, image, right=bool(side)))
        self._file.flush()

    def write_report(self, report: RawReport) -> None:
        """Append what the robot told. Raises RecordingError when the file cannot be written."""
        stamp_ns = ros2.stamp_to_ns(report.stamp_s)
        self._place_camera(stamp_ns)
        twist = (report.speed_mps, report.turn_radps)
        self._file.write(
            ros2.ODOMETRY, stamp_ns, raw.odometry_message(stamp_ns, report.T_odom_base, twist, report.odometry_lost)
        )
        moved = raw.odometry_frame(report.odometry_lost), ros2.BASE_FRAME, report.T_odom_base
        self._file.write(ros2.TF, stamp_ns, ros2.transforms_message(stamp_ns, [moved]))
        if report.battery_v is not None:
            self._file.write(raw.BATTERY, stamp_ns, raw.battery_message(stamp_ns, report.battery_v))
        for number, range_m in report.sonar_m.items():
            self._file.write(raw.SONAR, stamp_ns, raw.sonar_message(stamp_ns, number, range_m))
        if report.values:
            self._file.write(raw.DIAGNOSTICS, stamp_ns, raw.diagnostics_message(stamp_ns, report.fault, report.values))
        self._file.flush()

    def write_note(self, key: str, text: str) -> None:
        """Add to the metadata what became known while recording, such as why it ended."""
        self._file.note(key, text)

    def sync(self) -> None:
        """Wait until the disk itself has all that was written: from then on a power cut takes nothing of it."""
        self._file.sync()

    def close(self) -> None:
        """Write the index and close the file; closing again does nothing."""
        self._file.close()

    def __enter__(self) -> "RawWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _place_camera(self, stamp_ns: int) -> None:
        """Once, with the first message."""
        if self._T_base_cam is not None:
            others = () if self._baseline_m is None else (ros2.right_camera(self._baseline_m),)
            message = ros2.static_transform_message(stamp_ns, self._T_base_cam, *others)
            self._file.write(ros2.TF_STATIC, stamp_ns, message)
            self._T_base_cam = None


def camera_matrices(
    rig: StereoCalibration | Rectification | StereoCamera,
) -> tuple[raw.CameraMatrices, raw.CameraMatrices]:
    """What ROS calls K, D, R and P of the left and the right camera of a rig."""
    if isinstance(rig, StereoCamera):
        size_px = rig.width_px, rig.height_px
        left, right = (raw.CameraMatrices(rig.K, np.zeros(5), np.eye(3), P, size_px) for P in rig.P)
        return left, right
    told = (rig if isinstance(rig, Rectification) else rig.rectification()).matrices
    left, right = (
        raw.CameraMatrices(*each, told.size_px) for each in zip(told.K, told.distortion, told.R, told.P, strict=True)
    )
    return left, right


def _baseline_m(right: raw.CameraMatrices) -> float:
    return float(-right.P[0, 3] / right.P[0, 0])
