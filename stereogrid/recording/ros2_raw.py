"""What a robot and its two cameras send, as ROS 2 messages: raw pictures, their calibration, what the robot reports."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..calibration import StereoCalibration
from ..calibration.rig import check_rectifying_turn
from ..camera import DISTORTION_SIZES, Rectification
from ..errors import InvalidInputError, unknown_name
from ..geometry import FloatArray, as_floats, from_rotation
from . import ros2_messages as ros2
from .ros2_messages import Message

KIND, RAW = "kind", "raw"
"""What the metadata of our own files say."""
LEFT_IMAGE = "/left/image_raw/compressed"
RIGHT_IMAGE = "/right/image_raw/compressed"
SONAR = "/sonar"
BATTERY = "/battery"
DIAGNOSTICS = "/diagnostics"

TOPICS = {
    ros2.TF: "tf2_msgs/msg/TFMessage",
    ros2.TF_STATIC: "tf2_msgs/msg/TFMessage",
    ros2.LEFT_INFO: "sensor_msgs/msg/CameraInfo",
    ros2.RIGHT_INFO: "sensor_msgs/msg/CameraInfo",
    LEFT_IMAGE: "sensor_msgs/msg/CompressedImage",
    RIGHT_IMAGE: "sensor_msgs/msg/CompressedImage",
    ros2.ODOMETRY: "nav_msgs/msg/Odometry",
    SONAR: "sensor_msgs/msg/Range",
    BATTERY: "sensor_msgs/msg/BatteryState",
    DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
}
"""Message type of each topic of a raw recording."""

IMAGE_TYPES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")
DISTORTION_MODELS = ("plumb_bob", "rational_polynomial")
_UNKNOWN = float("nan")
_SONAR_CONE_RAD, _SONAR_NEAREST_M, _SONAR_FARTHEST_M = np.radians(30.0), 0.15, 5.0
"""Of a Pioneer's sonars."""
_OK, _ERROR = 0, 2


@dataclass(frozen=True)
class CameraMatrices:
    """What a CameraInfo tells of one camera: K (3, 3), distortion as OpenCV orders it, R (3, 3), P (3, 4)."""

    K: FloatArray
    distortion: FloatArray
    R: FloatArray
    P: FloatArray
    size_px: tuple[int, int]


def camera_info_message(stamp_ns: int, camera: CameraMatrices, *, right: bool = False) -> Message:
    """sensor_msgs/CameraInfo of one raw camera."""
    distortion = camera.distortion.ravel().tolist()
    distortion += [0.0] * (5 - len(distortion))
    width, height = camera.size_px
    return {
        "header": ros2.header(stamp_ns, ros2.camera_frame(right=right)),
        "height": height,
        "width": width,
        "distortion_model": DISTORTION_MODELS[len(distortion) > 5],
        "d": distortion,
        "k": camera.K.ravel().tolist(),
        "r": camera.R.ravel().tolist(),
        "p": camera.P.ravel().tolist(),
    }


def read_camera_info(message: Any, side: str) -> CameraMatrices:
    """The matrices in a decoded sensor_msgs/CameraInfo.

    Raises InvalidInputError when the camera was not calibrated or its distortion is of no kind that OpenCV's pinhole
    camera has.
    """
    K, R, P = (np.reshape(as_floats(each), (3, -1)) for each in (message.k, message.r, message.p))
    distortion = as_floats(message.d)
    if not K.any() or not P.any():
        raise InvalidInputError(f"the {side} camera_info holds no calibration (its K or P is zero)")
    if not distortion.any():
        distortion = np.zeros(5)
    elif message.distortion_model not in DISTORTION_MODELS:
        raise unknown_name(f"{side} distortion model", message.distortion_model, DISTORTION_MODELS)
    if distortion.size not in DISTORTION_SIZES:
        raise InvalidInputError(f"the {side} camera_info holds {distortion.size} numbers of distortion")
    # Whoever does not rectify may leave R zero.
    return CameraMatrices(K, distortion, R if R.any() else np.eye(3), P, (int(message.width), int(message.height)))


def rectification(left: CameraMatrices, right: CameraMatrices) -> Rectification:
    """What makes rectified pairs of this rig's raw ones.

    Raises InvalidInputError, with the reason, when the numbers are none that two cameras side by side can have.
    """
    if left.size_px != right.size_px:
        raise InvalidInputError(f"the camera_infos are of pictures of {left.size_px} and {right.size_px} px")
    K, distortion, R, P = ((getattr(left, name), getattr(right, name)) for name in ("K", "distortion", "R", "P"))
    found = Rectification.from_matrices(K, distortion, R, P, left.size_px)
    R_right = R[1].T
    t_m = R_right @ [-found.camera.baseline_m, 0.0, 0.0]
    # Made for what it refuses.
    StereoCalibration(K, distortion, from_rotation(R_right @ R[0], t_m), left.size_px)
    check_rectifying_turn(found.R_rect_left)
    return found


def odometry_message(stamp_ns: int, T_odom_base: FloatArray, twist: tuple[float, float], piece: int = 0) -> Message:
    """nav_msgs/Odometry with its twist, forwards [m/s] and about z [rad/s].

    piece: how often the motion was lost before. A pose after that is in a frame of its own, since where that lies in
    the one before nobody knows: `odom`, then `odom_1`, ...
    """
    speed_mps, turn_radps = twist
    return {
        "header": ros2.header(stamp_ns, odometry_frame(piece)),
        "child_frame_id": ros2.BASE_FRAME,
        "pose": {"pose": ros2.pose_message(T_odom_base)},
        "twist": {"twist": {"linear": _xyz(speed_mps, 0.0, 0.0), "angular": _xyz(0.0, 0.0, turn_radps)}},
    }


def odometry_frame(piece: int) -> str:
    """The frame of the poses of a piece of the drive."""
    return f"{ros2.ODOM_FRAME}_{piece}" if piece else ros2.ODOM_FRAME


def _xyz(*numbers: float) -> dict[str, float]:
    return dict(zip("xyz", numbers, strict=True))


def sonar_message(stamp_ns: int, number: int, range_m: float) -> Message:
    """sensor_msgs/Range of one sonar in its frame, sonar_0, sonar_1, ..."""
    return {
        "header": ros2.header(stamp_ns, f"sonar_{number}"),
        "radiation_type": 0,
        "field_of_view": _SONAR_CONE_RAD,
        "min_range": _SONAR_NEAREST_M,
        "max_range": _SONAR_FARTHEST_M,
        "range": range_m,
        "variance": 0.0,
    }


def battery_message(stamp_ns: int, voltage_v: float) -> Message:
    """sensor_msgs/BatteryState of which only the voltage is known."""
    names = ("temperature", "current", "charge", "capacity", "design_capacity", "percentage")
    unknown = dict.fromkeys(names, _UNKNOWN)
    return {"header": ros2.header(stamp_ns, ros2.BASE_FRAME), "voltage": voltage_v, "present": True, **unknown}


def diagnostics_message(stamp_ns: int, fault: str, values: Mapping[str, str]) -> Message:
    """diagnostic_msgs/DiagnosticArray of the robot's state: its fault, "" for none, and values by name."""
    status = {
        "level": _ERROR if fault else _OK,
        "name": "robot",
        "message": fault,
        "hardware_id": "",
        "values": [{"key": key, "value": value} for key, value in values.items()],
    }
    return {"header": ros2.header(stamp_ns, ros2.BASE_FRAME), "status": [status]}
