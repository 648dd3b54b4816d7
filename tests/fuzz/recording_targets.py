"""Recordings of every kind: whole files, messages inside of sound files, and the texts and images of folders."""

import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from target import Target

from stereogrid.calibration import StereoCalibration
from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.observation import Observation, Odometry, Truth
from stereogrid.recording import McapWriter, RawReport, RawWriter, open_recording

CAMERA = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
T_BASE_CAM = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
N = 3


def drain(path: Path) -> None:
    """All that a command would read of a recording."""
    recording = open_recording(path)
    list(recording.notes())
    list(recording)
    recording.true_poses()
    recording.truth_mesh_ply()
    recording.ticks()


def _observations() -> list[Observation]:
    rng = np.random.default_rng(0)
    made = []
    for i in range(N):
        left, right = rng.integers(0, 256, (2, *CAMERA.shape), dtype=np.uint8)
        T = from_yaw(0.1 * i, [0.2 * i, 0, 0])
        depth_m = np.full(CAMERA.shape, 2.0, np.float32)
        truth = Truth(T @ T_BASE_CAM, depth_m, {"person": from_yaw(0.0, [1, 0, 0])})
        made.append(Observation(0.1 * i, left, right, Odometry(T), T @ T_BASE_CAM, truth))
    return made


def _mcap(folder: Path) -> list[bytes]:
    path = folder / "sample.mcap"
    with McapWriter(path, CAMERA, T_BASE_CAM, metadata={"world": "corridor"}, truth_mesh_ply=bytes(50)) as writer:
        for i, each in enumerate(_observations()):
            writer.write_tick(0.1 * i, from_yaw(0.0, [0.2 * i, 0, 0]), np.array([i, i]))
            writer.write(each)
    data = path.read_bytes()
    path.unlink()
    return [data]


def _raw_mcap(folder: Path) -> list[bytes]:
    path = folder / "sample.mcap"
    K, D = CAMERA.K, np.array([-0.1, 0.02, 0.001, 0.0])
    rig = StereoCalibration((K, K), (D, D), from_rotation(np.eye(3), [-0.06, 0.001, 0]), (32, 24))
    with RawWriter(path, rig, T_BASE_CAM) as writer:
        for i, each in enumerate(_observations()):
            writer.write_report(RawReport(0.1 * i, each.odometry.T_odom_base, battery_v=12.0, sonar_m={0: 1.0}))
            writer.write_pair(each.left, each.right, 0.1 * i + 0.03, 0.1 * i + 0.04)
    data = path.read_bytes()
    path.unlink()
    return [data]


def _file(name: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        (folder / name).write_bytes(data)
        drain(folder / name)

    return read


def _messages(samples: Callable[[Path], list[bytes]]) -> Callable[[Path], list[bytes]]:
    """The messages of a file, each behind the number of its topic: to be forged one by one inside of a sound file."""

    def made(folder: Path) -> list[bytes]:
        from mcap.reader import make_reader

        (folder / "sample.mcap").write_bytes(samples(folder)[0])
        with (folder / "sample.mcap").open("rb") as file:
            found = list(make_reader(file).iter_messages())
        kept.setdefault(samples, found)
        return [struct.pack("<H", n) + message.data for n, (_, _, message) in enumerate(found)]

    kept = _KEPT
    return made


_KEPT: dict[object, list[object]] = {}


def _forged(samples: Callable[[Path], list[bytes]]) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        from mcap.writer import Writer

        found = _KEPT[samples]
        chosen = int.from_bytes(data[:2].ljust(2, b"\0"), "little") % len(found)
        path = folder / "forged.mcap"
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start(profile="ros2")
            channels: dict[str, int] = {}
            for n, (schema, channel, message) in enumerate(found):
                if channel.topic not in channels:
                    kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                    channels[channel.topic] = writer.register_channel(channel.topic, "cdr", kind)
                payload = data[2:] if n == chosen else message.data
                writer.add_message(channels[channel.topic], message.log_time, payload, message.publish_time)
            writer.finish()
        drain(path)

    return read


def _kitti(folder: Path) -> dict[str, bytes]:
    image = cv2.imencode(".png", _observations()[0].left)[1].tobytes()
    files = {f"image_{side}/{i:06d}.png": image for side in (0, 1) for i in range(N)}
    files["calib.txt"] = "".join(f"P{n}: {' '.join(map(str, P.ravel()))}\n" for n, P in enumerate(CAMERA.P)).encode()
    rows = (from_rotation(np.eye(3), [0, 0, 1.0 * i])[:3].ravel() for i in range(N))
    files["poses.txt"] = "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
    files["times.txt"] = b"0.0\n0.1\n0.2\n"
    return files


def in_folder(made: Callable[[Path], dict[str, bytes]], name: str) -> Target:
    """A folder of sound files, one of which is forged."""

    def read(data: bytes, folder: Path) -> None:
        place = folder / "recording"
        if not place.is_dir():
            for each, content in made(folder).items():
                (place / each).parent.mkdir(parents=True, exist_ok=True)
                (place / each).write_bytes(content)
        (place / name).write_bytes(data)
        drain(place)

    return Target(lambda folder: [made(folder)[name]], read)


TARGETS = {
    "mcap": Target(_mcap, _file("drive.mcap")),
    "mcap-raw": Target(_raw_mcap, _file("drive.mcap")),
    "mcap-message": Target(_messages(_mcap), _forged(_mcap)),
    "mcap-raw-message": Target(_messages(_raw_mcap), _forged(_raw_mcap)),
    **{
        f"kitti-{name.rpartition('/')[2].replace('000000', 'image')}": in_folder(_kitti, name)
        for name in ("calib.txt", "poses.txt", "times.txt", "image_0/000000.png")
    },
}
