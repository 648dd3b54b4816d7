"""Poses, cameras and images as ROS 2 messages: built as dicts, read from what mcap_ros2 decodes."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import FloatArray, as_pose, from_quaternion_wxyz, from_rotation, quaternion_wxyz
from ..jpeg_header import is_jpeg
from ..observation import FloatImage, Image
from .images import encode_png
from .ros2_schemas import SCHEMAS

Message: TypeAlias = dict[str, Any]
Transform: TypeAlias = tuple[str, str, FloatArray]
"""Parent frame, child frame, T_parent_child (4, 4)."""

LEFT_IMAGE = "/left/image_rect/compressed"
RIGHT_IMAGE = "/right/image_rect/compressed"
LEFT_INFO = "/left/camera_info"
RIGHT_INFO = "/right/camera_info"
ODOMETRY = "/odom"
TF = "/tf"
TF_STATIC = "/tf_static"
TRUE_POSE = "/truth/pose"
TRUE_DEPTH = "/truth/depth"
TRUE_BASE = "/truth/base"
TRUE_MOVERS = "/truth/movers"
WHEELS = "/wheels"

TOPICS = {
    TF_STATIC: "tf2_msgs/msg/TFMessage",
    LEFT_INFO: "sensor_msgs/msg/CameraInfo",
    RIGHT_INFO: "sensor_msgs/msg/CameraInfo",
    ODOMETRY: "nav_msgs/msg/Odometry",
    TF: "tf2_msgs/msg/TFMessage",
    TRUE_POSE: "geometry_msgs/msg/PoseStamped",
    TRUE_BASE: "geometry_msgs/msg/PoseStamped",
    TRUE_MOVERS: "tf2_msgs/msg/TFMessage",
    WHEELS: "sensor_msgs/msg/JointState",
    TRUE_DEPTH: "sensor_msgs/msg/Image",
    LEFT_IMAGE: "sensor_msgs/msg/CompressedImage",
    RIGHT_IMAGE: "sensor_msgs/msg/CompressedImage",
}
"""Message type of each topic, in the order in which an observation is written."""

WHEEL_NAMES = ["left_wheels", "right_wheels"]
WORLD_FRAME = "world"
ODOM_FRAME = "odom"
BASE_FRAME = "base_link"
CAMERA_FRAME = "left_camera_optical"
RIGHT_CAMERA_FRAME = "right_camera_optical"
TRUE_BASE_FRAME = "base_link_true"
TRUE_CAMERA_FRAME = "left_camera_optical_true"
"""Of the frames of the truth: a frame has one parent, and base_link's is odom."""

_UNIT_TOLERANCE = 1e-3
_LAST_STAMP_NS = (2**31 - 1) * 10**9


def stamp_to_ns(stamp_s: float) -> int:
    """The nearest whole nanosecond; ns / 1e9 gives stamp_s back to half a nanosecond.

    Raises InvalidInputError outside 0 to 2^31 s, which is what a ROS 2 stamp can hold.
    """
    # Exact arithmetic: stamp_s * 1e9 in floats is off by a hundred ns at today's Unix time.
    ns = round(Fraction(stamp_s) * 10**9)
    if not 0 <= ns <= _LAST_STAMP_NS:
        raise InvalidInputError(f"stamp_s must be between 0 and 2^31 s to be recorded, not {stamp_s}")
    return ns


def header(stamp_ns: int, frame_id: str) -> Message:
    """std_msgs/Header."""
    sec, nanosec = divmod(stamp_ns, 10**9)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame_id}


def header_stamp_ns(decoded_header: Any) -> int:
    """The stamp of a decoded std_msgs/Header [ns]."""
    return int(decoded_header.stamp.sec) * 10**9 + int(decoded_header.stamp.nanosec)


def _vector(xyz: FloatArray) -> dict[str, float]:
    return dict(zip("xyz", xyz.tolist(), strict=True))


def _quaternion(T: FloatArray) -> dict[str, float]:
    return dict(zip("wxyz", quaternion_wxyz(T).tolist(), strict=True))


def pose_message(T: FloatArray) -> Message:
    """geometry_msgs/Pose of a (4, 4) pose."""
    return {"position": _vector(T[:3, 3]), "orientation": _quaternion(T)}


def odometry_message(stamp_ns: int, T_odom_base: FloatArray) -> Message:
    """nav_msgs/Odometry, odom -> base_link; covariance and twist stay zero, that is, unknown."""
    return {
        "header": header(stamp_ns, ODOM_FRAME),
        "child_frame_id": BASE_FRAME,
        "pose": {"pose": pose_message(T_odom_base)},
    }


def true_pose_message(stamp_ns: int, T_world_frame: FloatArray) -> Message:
    """geometry_msgs/PoseStamped of the left camera, or of the robot's base, in the frame `world`."""
    return {"header": header(stamp_ns, WORLD_FRAME), "pose": pose_message(T_world_frame)}


def wheels_message(stamp_ns: int, wheels_rad: FloatArray) -> Message:
    """sensor_msgs/JointState of the turns (2,) of the left and the right wheels [rad]."""
    return {"header": header(stamp_ns, BASE_FRAME), "name": WHEEL_NAMES, "position": wheels_rad.tolist()}


def static_transform_message(stamp_ns: int, T_base_cam: FloatArray, *others: Transform) -> Message:
    """tf2_msgs/TFMessage of base_link -> left_camera_optical and others."""
    return transforms_message(stamp_ns, [(BASE_FRAME, CAMERA_FRAME, T_base_cam), *others])


def right_camera(baseline_m: float) -> Transform:
    """Where the rectified right camera stands."""
    return CAMERA_FRAME, RIGHT_CAMERA_FRAME, from_rotation(np.eye(3), [baseline_m, 0.0, 0.0])


def movers_message(stamp_ns: int, movers: Mapping[str, FloatArray]) -> Message:
    """tf2_msgs/TFMessage of the true poses (4, 4) of what moves, by name, in the frame `world`."""
    return transforms_message(stamp_ns, [(WORLD_FRAME, name, T) for name, T in movers.items()])


def transforms_message(stamp_ns: int, transforms: Iterable[Transform]) -> Message:
    """tf2_msgs/TFMessage."""
    return {"transforms": [_stamped_transform(stamp_ns, each) for each in transforms]}


def _stamped_transform(stamp_ns: int, transform: Transform) -> Message:
    parent, child, T = transform
    numbers = {"translation": _vector(T[:3, 3]), "rotation": _quaternion(T)}
    return {"header": header(stamp_ns, parent), "child_frame_id": child, "transform": numbers}


def camera_info_message(stamp_ns: int, camera: StereoCamera, *, right: bool) -> Message:
    """sensor_msgs/CameraInfo of one rectified camera."""
    return {
        "header": header(stamp_ns, camera_frame(right=right)),
        "height": camera.height_px,
        "width": camera.width_px,
        "distortion_model": "plumb_bob",
        "d": [0.0] * 5,
        "k": camera.K.ravel().tolist(),
        "r": np.eye(3).ravel().tolist(),
        "p": camera.P[right].ravel().tolist(),
    }


def camera_frame(*, right: bool) -> str:
    """The frame of a camera."""
    return RIGHT_CAMERA_FRAME if right else CAMERA_FRAME


def image_format(encoded: bytes) -> str:
    """What a CompressedImage with these bytes says of them.

    What image_transport writes, "mono8; png compressed", is refused by viewers that know formats by their names.
    """
    return "jpeg" if is_jpeg(encoded) else "png"


def image_message(stamp_ns: int, image: Image, *, right: bool = False) -> Message:
    """sensor_msgs/CompressedImage: a PNG of the (H, W) uint8 image."""
    encoded = encode_png(image)
    frame = camera_frame(right=right)
    return {"header": header(stamp_ns, frame), "format": image_format(encoded), "data": encoded}


def depth_message(stamp_ns: int, depth_m: FloatImage) -> Message:
    """sensor_msgs/Image 32FC1 of a true depth image (H, W) [m], NaN where unknown (REP 118)."""
    depth = np.ascontiguousarray(depth_m, dtype="<f4")
    height, width = depth.shape
    return {
        "header": header(stamp_ns, TRUE_CAMERA_FRAME),
        "height": height,
        "width": width,
        "encoding": "32FC1",
        "is_bigendian": 0,
        "step": 4 * width,
        "data": depth.tobytes(),
    }


@cache
def decoder(type_name: str) -> Callable[[bytes], Any]:
    """Decodes the CDR bytes of a message by our own definition; the file's might be hostile."""
    schema = Schema(id=1, name=type_name, encoding="ros2msg", data=SCHEMAS[type_name].encode())
    decode: Callable[[bytes], Any] | None = DecoderFactory().decoder_for("cdr", schema)
    if decode is None:
        raise AssertionError("mcap_ros2 decodes every ros2msg schema")
    return decode


def read_transform(translation: Any, rotation: Any, name: str) -> FloatArray:
    """(4, 4) of a decoded translation (x, y, z) and quaternion. Raises InvalidInputError, naming `name`."""
    wxyz = np.array([rotation.w, rotation.x, rotation.y, rotation.z])
    t_m = [translation.x, translation.y, translation.z]
    if not (np.isfinite(wxyz).all() and np.isfinite(t_m).all()):
        raise InvalidInputError(f"{name} contains NaN or infinity")
    if abs(np.linalg.norm(wxyz) - 1) > _UNIT_TOLERANCE:
        raise InvalidInputError(f"{name} has no unit quaternion: w, x, y, z = {wxyz.tolist()}")
    return as_pose(from_quaternion_wxyz(wxyz, t_m), name)


def read_pose(pose: Any, name: str) -> FloatArray:
    """(4, 4) of a decoded geometry_msgs/Pose. Raises InvalidInputError, naming `name`."""
    return read_transform(pose.position, pose.orientation, name)


def read_poses(poses: Sequence[Any]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(K, 4, 4) of decoded geometry_msgs/Pose, and which of them (K,) are none: not finite, or no unit quaternion."""
    return _read_all([(each.position, each.orientation) for each in poses])


def read_transforms(transforms: Sequence[Any]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """As `read_poses`, of decoded geometry_msgs/Transform."""
    return _read_all([(each.translation, each.rotation) for each in transforms])


def _read_all(places: Sequence[tuple[Any, Any]]) -> tuple[FloatArray, NDArray[np.bool_]]:
    numbers = np.array([[t.x, t.y, t.z, *_xyzw(rotation)] for t, rotation in places]).reshape(-1, 7)
    wrong = ~np.isfinite(numbers).all(axis=1) | ~(np.abs(np.linalg.norm(numbers[:, 3:], axis=1) - 1) <= _UNIT_TOLERANCE)
    numbers[wrong] = [0, 0, 0, 0, 0, 0, 1]
    T = np.tile(np.eye(4), (len(numbers), 1, 1))
    T[:, :3, :3] = Rotation.from_quat(numbers[:, 3:]).as_matrix()
    T[:, :3, 3] = numbers[:, :3]
    return T, wrong


def _xyzw(rotation: Any) -> tuple[float, float, float, float]:
    return rotation.x, rotation.y, rotation.z, rotation.w


def read_static_transform(transforms: Iterable[Any]) -> FloatArray:
    """T_base_cam (4, 4) among decoded TransformStamped messages. Raises InvalidInputError if missing."""
    for stamped in transforms:
        if (stamped.header.frame_id, stamped.child_frame_id) == (BASE_FRAME, CAMERA_FRAME):
            return read_transform(stamped.transform.translation, stamped.transform.rotation, "T_base_cam")
    raise InvalidInputError(f"{TF_STATIC} holds no transform {BASE_FRAME} -> {CAMERA_FRAME}")


def has_static_transform(transforms: Iterable[Any]) -> bool:
    """Whether read_static_transform would find one."""
    return any((each.header.frame_id, each.child_frame_id) == (BASE_FRAME, CAMERA_FRAME) for each in transforms)


def read_movers(message: Any) -> dict[str, FloatArray]:
    """Poses (4, 4) by name of a decoded tf2_msgs/TFMessage. Raises InvalidInputError on a wrong one."""
    return {
        stamped.child_frame_id: read_transform(
            stamped.transform.translation, stamped.transform.rotation, stamped.child_frame_id
        )
        for stamped in message.transforms
    }


def read_wheels(message: Any) -> FloatArray:
    """Turns (2,) of the wheels [rad] of a decoded sensor_msgs/JointState. Raises InvalidInputError on other joints."""
    if list(message.name) != WHEEL_NAMES or len(message.position) != len(WHEEL_NAMES):
        raise InvalidInputError(f"{WHEELS} must hold {' and '.join(WHEEL_NAMES)}, not {list(message.name)}")
    turns: FloatArray = np.array(message.position, dtype=np.float64)
    if not np.isfinite(turns).all():
        raise InvalidInputError(f"{WHEELS} contains NaN or infinity")
    return turns


def read_camera(left_info: Any, right_info: Any) -> StereoCamera:
    """The camera of two decoded sensor_msgs/CameraInfo. Raises InvalidInputError when they are no pair."""
    P_left, P_right = (np.reshape(info.p, (3, 4)) for info in (left_info, right_info))
    return StereoCamera.from_projections(P_left, P_right, (left_info.width, left_info.height))


def read_depth(message: Any) -> FloatImage:
    """Depth (H, W) float32 [m] of a decoded sensor_msgs/Image. Raises InvalidInputError when it is none."""
    size = 4 * message.height * message.width
    if message.encoding != "32FC1" or message.step != 4 * message.width or len(message.data) != size:
        raise InvalidInputError(f"depth must be 32FC1 of {size} bytes, not {message.encoding} of {len(message.data)}")
    order = ">" if message.is_bigendian else "<"
    depth = np.frombuffer(message.data, dtype=f"{order}f4").reshape(message.height, message.width)
    return depth.astype(np.float32)
