"""ROS bags of small drawn drives, written by rosbags' own writers."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, FloatArray, from_rotation, from_yaw
from stereogrid.observation import Image
from stereogrid.recording import ros2_messages as ros2

CAMERA = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
T0_S = 1_700_000_000.0
PERIOD_S = 0.1
T_FOOTPRINT_BASE = from_rotation(np.eye(3), [0, 0, 0.1])
T_BASE_MAST = from_yaw(0.2, [0.15, 0.0, 0.25])
T_MAST_LENS = from_rotation(R_BASE_OPTICAL, [0, 0.03, 0.05])
T_FOOTPRINT_LENS = T_FOOTPRINT_BASE @ T_BASE_MAST @ T_MAST_LENS
LENS = "left_optical_frame"

_STORES = {kind: get_typestore(kind) for kind in (Stores.ROS2_HUMBLE, Stores.ROS1_NOETIC)}
for _store in _STORES.values():
    _store.register(get_types_from_msg("geometry_msgs/msg/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    _store.register(get_types_from_msg("uint8 spin", "odd_msgs/msg/Whirl"))
ROS1, ROS2 = _STORES[Stores.ROS1_NOETIC], _STORES[Stores.ROS2_HUMBLE]


class Sent(NamedTuple):
    """A message as a dict, and when it was recorded; raw: bytes in its place."""

    topic: str
    kind: str
    message: dict[str, Any]
    log_ns: int
    raw: bytes | None = None


def pose_at(stamp_s: float) -> FloatArray:
    """Where base_footprint is in odom: a drive of .2 m/s that turns by .1 rad/s."""
    after_s = stamp_s - T0_S
    return from_yaw(0.1 * after_s, [0.2 * after_s, 0.01 * after_s**2, 0.0])


def picture(number: int, side: int) -> Image:
    """One whose first pixel tells its number."""
    pixels = np.random.default_rng([number, side]).integers(0, 256, CAMERA.shape, dtype=np.uint8)
    pixels[0, 0] = number
    return pixels


def image(stamp_ns: int, pixels: Image, encoding: str = "mono8", frame: str = LENS) -> dict[str, Any]:
    """sensor_msgs/Image."""
    height, width = pixels.shape[:2]
    size = {"height": height, "width": width, "encoding": encoding, "step": pixels.nbytes // height}
    return {"header": ros2.header(stamp_ns, frame), "is_bigendian": 0, **size, "data": pixels.tobytes()}


def transform(stamp_ns: int, parent: str, child: str, T: FloatArray) -> dict[str, Any]:
    """tf2_msgs/TFMessage of one."""
    (stamped,) = ros2.static_transform_message(stamp_ns, T)["transforms"]
    stamped["header"]["frame_id"], stamped["child_frame_id"] = parent, child
    return {"transforms": [stamped]}


def fixed_frames() -> list[Sent]:
    """base_footprint -> base_link -> mast -> left_optical_frame, each in a message of its own."""
    edges = {
        ("base_footprint", "base_link"): T_FOOTPRINT_BASE,
        ("base_link", "mast"): T_BASE_MAST,
        ("mast", LENS): T_MAST_LENS,
    }
    log_ns = ros2.stamp_to_ns(T0_S)
    return [
        Sent("/tf_static", "tf2_msgs/msg/TFMessage", transform(log_ns, *names, T), log_ns) for names, T in edges.items()
    ]


def pictures(
    n: int = 6, topics: tuple[str, str] = ("/stereo/left/image_rect", "/stereo/right/image_rect")
) -> list[Sent]:
    """Pairs, the right picture 4 ms later, 30 ms after each report of `odometry`; recorded 20 ms after they were
    taken."""
    return [
        Sent(topic, "sensor_msgs/msg/Image", image(stamp_ns, picture(k, side)), stamp_ns + 20_000_000)
        for k in range(n)
        for side, topic in enumerate(topics)
        for stamp_ns in [ros2.stamp_to_ns(T0_S + PERIOD_S * k + 0.03 + 0.004 * side)]
    ]


def infos(topics: tuple[str, str] = ("/stereo/left/camera_info", "/stereo/right/camera_info")) -> list[Sent]:
    """The calibration of CAMERA."""
    log_ns = ros2.stamp_to_ns(T0_S)
    messages = [ros2.camera_info_message(log_ns, CAMERA, right=right) for right in (False, True)]
    for message in messages:
        message["header"]["frame_id"] = LENS
    return [
        Sent(topic, "sensor_msgs/msg/CameraInfo", message, log_ns)
        for topic, message in zip(topics, messages, strict=True)
    ]


def odometry(n: int = 7, topic: str = "/odom", child: str = "base_footprint") -> list[Sent]:
    """Reports of pose_at."""
    sent = []
    for k in range(n):
        stamp_ns = ros2.stamp_to_ns(T0_S + PERIOD_S * k)
        message = ros2.odometry_message(stamp_ns, pose_at(T0_S + PERIOD_S * k))
        sent.append(Sent(topic, "nav_msgs/msg/Odometry", {**message, "child_frame_id": child}, stamp_ns))
    return sent


def drive(n: int = 6) -> list[Sent]:
    """All that a recording needs, and what no one knows."""
    odd = Sent("/whirl", "odd_msgs/msg/Whirl", {"spin": 7}, ros2.stamp_to_ns(T0_S))
    return [*fixed_frames(), *infos(), *pictures(n), *odometry(n + 1), odd]


def write_bag1(path: Path, sent: Iterable[Sent], compression: Any = None, chunk_bytes: int = 4096) -> Path:
    """A .bag of ROS 1."""
    writer = Writer1(path)
    if compression is not None:
        writer.set_compression(compression)
    writer.chunk_threshold = chunk_bytes
    with writer:
        connections: dict[str, Any] = {}
        for each in sorted(sent, key=lambda one: one.log_ns):
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(each.topic, each.kind, typestore=ROS1)
            raw = each.raw
            writer.write(
                connections[each.topic],
                each.log_ns,
                bytes(ROS2.cdr_to_ros1(cdr(each), each.kind)) if raw is None else raw,
            )
    return path


def write_bag2(
    folder: Path, sent: Iterable[Sent], storage: str = "sqlite3", compression: CompressionMode = CompressionMode.NONE
) -> Path:
    """A folder of ROS 2."""
    plugin = StoragePlugin.SQLITE3 if storage == "sqlite3" else StoragePlugin.MCAP
    writer = Writer(folder, version=9, storage_plugin=plugin)
    if compression != CompressionMode.NONE:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for each in sorted(sent, key=lambda one: one.log_ns):
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(each.topic, each.kind, typestore=ROS2)
            writer.write(connections[each.topic], each.log_ns, cdr(each) if each.raw is None else each.raw)
    return folder


def cdr(sent: Sent) -> bytes:
    """A message's bytes."""
    return bytes(ROS2.serialize_cdr(_made(sent.kind, sent.message), sent.kind))


def _made(kind: str, said: dict[str, Any]) -> Any:
    """An object of rosbags' types of a dict; what it does not say is zero."""
    values = {}
    for name, (node, argument) in ROS2.fielddefs[kind][1]:
        if name in said or node == 2:
            values[name] = _value(node, argument, said.get(name, {}))
        elif node == 1:
            values[name] = "" if argument[0] == "string" else 0
        else:
            (_, (base, _)), size = argument
            values[name] = np.zeros(size, base)
    return ROS2.types[kind](**values)


def _value(node: int, argument: Any, said: Any) -> Any:
    if node == 2:
        return _made(argument, said)
    if node == 1:
        return said
    (inner, what), _ = argument
    if inner == 2:
        return [_made(what, each) for each in said]
    return np.frombuffer(said, np.uint8) if isinstance(said, bytes) else np.array(said, what[0])
