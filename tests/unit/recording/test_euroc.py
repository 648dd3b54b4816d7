"""EuRoC folders: the whole chain of extrinsics, in every layout, and one line for all that can be wrong."""

import re
import shutil
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from euroc_folders import FIRST_NS, PERIOD_NS, POINT_M, T_BODY_CAM, T_world_body, write_euroc, write_flat

from stereogrid.cli import app, run
from stereogrid.config import MappingConfig
from stereogrid.errors import StereogridError
from stereogrid.geometry import inverse, transform
from stereogrid.grid import OccupancyGrid
from stereogrid.mapper import Mapper
from stereogrid.matching import matcher
from stereogrid.recording import EurocRecording, Given, Selection, open_recording
from stereogrid.scoring.ground import camera_height
from stereogrid.sensor_model import SensorModel


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_euroc(tmp_path_factory.mktemp("euroc"))


@pytest.fixture
def spoilable(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "sequence")


def middle_px(picture: np.ndarray) -> np.ndarray:
    """Column and row of the middle of what is bright."""
    weight = np.where(picture > 10, picture, 0).astype(float)
    row, column = (np.arange(n) for n in picture.shape)
    return np.array([(weight.sum(axis=0) * column).sum(), (weight.sum(axis=1) * row).sum()]) / weight.sum()


def test_a_point_of_the_world_is_seen_where_the_claimed_pose_puts_it(made: Path) -> None:
    recording = open_recording(made)
    assert len(recording) == 6
    for each in recording:
        seen = recording.camera.project(transform(inverse(each.T_world_cam), POINT_M[None]))[0]
        np.testing.assert_allclose(middle_px(each.left), seen[:2], atol=0.1)
        np.testing.assert_allclose(middle_px(each.right), seen[:2] - [seen[2], 0], atol=0.1)
        assert seen[2] > 3


def test_the_camera_stands_where_the_body_carries_it(made: Path) -> None:
    recording = open_recording(made)
    for number in range(6):
        true = T_world_body(number * PERIOD_NS / 1e9) @ T_BODY_CAM[0]
        np.testing.assert_allclose(recording.poses[number, :3, 3], true[:3, 3], atol=1e-9)


def test_base_sits_at_the_body_and_looks_where_the_rectified_camera_does(made: Path) -> None:
    recording = open_recording(made)
    first = next(iter(recording)).odometry.T_odom_base
    np.testing.assert_allclose(first[:3, 3], T_world_body(0)[:3, 3], atol=1e-9)
    np.testing.assert_allclose(first[:3, 0], recording.poses[0][:3, 2], atol=1e-9)
    assert first[2, 2] > 0.95, "its z is up"


@pytest.mark.parametrize("layout", ["above mav0", "mav0", "flat"])
def test_every_layout_holds_the_same(made: Path, tmp_path: Path, layout: str) -> None:
    path = {"above mav0": made, "mav0": made / "mav0", "flat": tmp_path}[layout]
    if layout == "flat":
        write_flat(tmp_path)
    ours, expected = open_recording(path), EurocRecording(made)
    assert isinstance(ours, EurocRecording) and ours.left_out == {}
    np.testing.assert_array_equal(ours.poses, expected.poses)
    np.testing.assert_array_equal(next(ours.read([3])).right, next(expected.read([3])).right)


def test_stamps_are_kept_to_the_nanosecond(made: Path) -> None:
    recording = open_recording(made)
    assert recording.stamps_s.tolist() == [(FIRST_NS + i * PERIOD_NS) / 10**9 for i in range(6)]


def test_pictures_without_a_partner_and_pairs_beyond_the_truth_are_left_out_and_counted(
    spoilable: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (spoilable / f"mav0/cam1/data/{FIRST_NS + 2 * PERIOD_NS}.png").unlink()
    truth = spoilable / "mav0/state_groundtruth_estimate0/data.csv"
    truth.write_text("\n".join(truth.read_text().splitlines()[:-4]))
    recording = open_recording(spoilable)
    assert recording.left_out == {
        "pictures that are listed but not there": 1,
        "pictures without one of the other camera": 1,
        "pairs where the odometry does not reach": 1,
    }
    assert len(recording) == 4
    assert run(app, ["info", str(spoilable)]) == 0
    told = capsys.readouterr().out
    assert "euroc: 4 observations in 0.200 s (15.00 Hz), path 0.12 m" in told
    assert "left out: 1 pairs where the odometry does not reach" in told


def test_the_pose_of_a_marker_is_brought_to_the_body(spoilable: Path, made: Path) -> None:
    """As Vicon tells it: T_BS of the marker in the sensor.yaml beside."""
    told = spoilable / "mav0/state_groundtruth_estimate0"
    told.rename(spoilable / "mav0/vicon0")
    rows = (spoilable / "mav0/vicon0/data.csv").read_text().splitlines()
    T_body_marker = np.eye(4)
    T_body_marker[:3, 3] = 0.1, 0.2, 0.3
    moved = [rows[0]]
    for row in rows[1:]:
        words = row.split(",")
        T = T_world_body((int(words[0]) - FIRST_NS) / 1e9) @ T_body_marker
        moved.append(",".join([words[0], *map(repr, T[:3, 3].tolist()), *words[4:]]))
    (spoilable / "mav0/vicon0/data.csv").write_text("\n".join(moved))
    (spoilable / "mav0/vicon0/sensor.yaml").write_text(f"T_BS:\n  data: {T_body_marker.ravel().tolist()}\n")
    np.testing.assert_allclose(open_recording(spoilable).poses, open_recording(made).poses, atol=1e-9)


def test_a_rig_that_stood_still_needs_no_truth(spoilable: Path) -> None:
    shutil.rmtree(spoilable / "mav0/state_groundtruth_estimate0")
    recording = open_recording(spoilable, given=Given(standing=True))
    assert len(recording) == 6
    np.testing.assert_array_equal(recording.poses, [recording.T_base_cam] * 6)


def huge_png() -> bytes:
    """A whole PNG file that claims 60000 x 60000 pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 60000, 60000, 8, 0, 0, 0, 0)
    parts = chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(bytes(1000))), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def text(name: str, change: Callable[[str], str]) -> Callable[[Path], object]:
    return lambda folder: (folder / "mav0" / name).write_text(change((folder / "mav0" / name).read_text()))


def replaced(name: str, old: str, new: str) -> Callable[[Path], object]:
    def change(whole: str) -> str:
        assert old in whole
        return whole.replace(old, new, 1)

    return text(name, change)


def row(number: int, column: int, word: str) -> Callable[[Path], object]:
    """Another word in a row of the ground truth."""

    def change(whole: str) -> str:
        lines = [line.split(",") for line in whole.splitlines()]
        lines[number][column] = word
        return "\n".join(map(",".join, lines))

    return text(TRUTH, change)


def picture(change: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    """The first picture changed."""
    path = f"mav0/cam0/data/{FIRST_NS}.png"
    return lambda folder: (folder / path).write_bytes(change((folder / path).read_bytes()))


def aliases(_: str) -> str:
    lines = ["a0: &a0 [x, x, x]", *(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}, *a{k - 1}, *a{k - 1}]" for k in range(1, 30))]
    return "\n".join(lines)


def of_a_giant(sensor: str) -> str:
    larger = re.sub(r"intrinsics: .*", "intrinsics: [10000, 10000, 8000, 6000]", sensor)
    return larger.replace("160, 120", "16000, 12000")


SENSOR, TRUTH = "cam0/sensor.yaml", "state_groundtruth_estimate0/data.csv"
WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "no yaml": (
        lambda f: (f / "mav0" / SENSOR).unlink(),
        r"cam0/sensor\.yaml: no such file; it says what the sensor is",
    ),
    "no cam1": (lambda f: shutil.rmtree(f / "mav0/cam1"), r"cam1/sensor\.yaml: no such file"),
    "no pictures": (lambda f: shutil.rmtree(f / "mav0/cam1/data"), r"mav0/cam1: no pictures; expected \.png"),
    "other pictures than those listed": (
        lambda f: [path.rename(path.with_name("x" + path.name)) for path in (f / "mav0/cam1/data").iterdir()],
        r"cam1/data\.csv: none of its 6 pictures is in .*cam1/data",
    ),
    "a name that is no stamp": (
        lambda f: [(f / "mav0/cam0/data.csv").unlink(), (f / "mav0/cam0/data/a.png").write_bytes(b"")],
        r"cam0/data/a\.png: 'a' is no stamp",
    ),
    "pictures listed outside of the folder": (
        text("cam0/data.csv", lambda whole: whole.replace(",", ",../data/")),
        r"cam0/data\.csv: none of its 6 pictures",
    ),
    "a yaml of words": (text(SENSOR, lambda _: "hello"), r"sensor\.yaml: no keys and values, but str"),
    "a yaml of nonsense": (text(SENSOR, lambda _: "a: [1, }"), r"sensor\.yaml: no YAML of plain values: "),
    "a yaml of bytes": (
        lambda f: (f / "mav0" / SENSOR).write_bytes(b"\xff\x00"),
        r"sensor\.yaml: no YAML of plain values: ",
    ),
    "a yaml that makes objects": (
        text(SENSOR, lambda _: "T_BS: !!python/object/apply:os.system [touch /tmp/x]"),
        r"sensor\.yaml: no YAML of plain values: could not determine",
    ),
    "a yaml bomb": (text(SENSOR, aliases), r"sensor\.yaml: has aliases"),
    "a yaml nested deep": (text(SENSOR, lambda _: "a: " + "[" * 50_000), r"sensor\.yaml: is nested deeper than"),
    "a yaml far too long": (text(SENSOR, lambda _: "#" * 200_000), r"sensor\.yaml: 200,000 bytes"),
    "no T_BS": (replaced(SENSOR, "T_BS", "T_SB"), r"sensor\.yaml: no key T_BS; it has 'sensor_type, comment, T_SB"),
    "T_BS of 15": (replaced(SENSOR, "0.0, 0.0, 0.0, 1.0]", "0.0, 0.0, 1.0]"), "data must be 16 finite numbers"),
    "T_BS of a mirror": (replaced(SENSOR, "0.0, 0.0, 0.0, 1.0]", "0.0, 0.0, 0.0, 2.0]"), "T_BS must end with the row"),
    "intrinsics of a word": (replaced(SENSOR, "[100.5,", "[wide,"), "intrinsics must be 4 finite numbers, not"),
    "intrinsics with nan": (replaced(SENSOR, "[100.5,", "[.nan,"), "intrinsics must be 4 finite numbers, not"),
    "a resolution of one": (replaced(SENSOR, "[160, 120]", "160"), "resolution must be 2 finite numbers, not 160"),
    "a resolution beyond all cameras": (
        lambda f: [text(f"cam{n}/sensor.yaml", of_a_giant)(f) for n in (0, 1)],
        "pictures of 16000 x 12000 px; 1 to 8192 px a side",
    ),
    "equidistant": (
        replaced(SENSOR, "radial-tangential", "equidistant"),
        "a camera 'pinhole' with distortion 'equidistant'; only pinhole with radial-tangential or .*plain folder",
    ),
    "a calibration of other pictures": (
        text("cam1/sensor.yaml", lambda whole: whole.replace("160, 120", "752, 480")),
        r"cam0 is \(160, 120\) px, cam1 \(752, 480\)",
    ),
    "cameras swapped": (
        lambda f: [
            (f / "mav0/cam0").rename(f / "mav0/c"),
            (f / "mav0/cam1").rename(f / "mav0/cam0"),
            (f / "mav0/c").rename(f / "mav0/cam1"),
        ],
        "the right camera is not to the right.*swapped",
    ),
    "no truth": (lambda f: (f / "mav0" / TRUTH).unlink(), "no ground truth: expected state_groundtruth_estimate0/data"),
    "positions alone": (
        lambda f: (f / "mav0" / TRUTH).parent.rename(f / "mav0/leica0"),
        "no ground truth: leica0 tells positions alone; expected state",
    ),
    "two truths": (
        lambda f: [
            (f / "mav0" / TRUTH).rename(f / "mav0/groundtruth_a.csv"),
            (f / "mav0/groundtruth_b.csv").write_text(""),
        ],
        r"more than one ground truth: groundtruth_a\.csv, groundtruth_b\.csv",
    ),
    "an empty truth": (text(TRUTH, lambda _: "#timestamp\n"), r"data\.csv: no poses"),
    "nan in the truth": (row(3, 2, "nan"), r"data\.csv:4: contains NaN"),
    "a word in the truth": (row(3, 2, "x"), r"data\.csv:4: .*'x'"),
    "truth of few numbers": (
        text(TRUTH, lambda whole: "\n".join(line[:40] for line in whole.splitlines())),
        r"data\.csv:2: \d numbers, expected ns, x, y, z, qw",
    ),
    "no unit quaternion": (row(2, 4, "2.0"), r"data\.csv:3: the quaternion has the norm 2"),
    "truth that goes back": (row(5, 0, str(FIRST_NS)), r"data\.csv:6: the stamp 14.* is not later than 14.* before"),
    "truth of another time": (
        text(TRUTH, lambda whole: whole.replace("\n1403715", "\n1303715")),
        "the ground truth tells of no moment at which a pair was taken",
    ),
    "another size": (
        picture(lambda _: cv2.imencode(".png", np.zeros((480, 752), np.uint8))[1].tobytes()),
        r"142976\.png: the image is 752 x 480 px, the calibration is for 160 x 120 px",
    ),
    "a giant": (picture(lambda _: huge_png()), r"142976\.png: the image is 60000 x 60000 px, the calibration"),
    "cut short": (
        picture(lambda whole: whole[: len(whole) // 2]),
        r"142976\.png: not a readable image: the PNG is cut short",
    ),
    "no picture": (picture(lambda _: b"hello"), r"142976\.png: not a PNG image"),
    "empty": (picture(lambda _: b""), r"142976\.png: not a PNG image"),
}


@pytest.mark.parametrize(("spoil", "message"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_named_in_one_line(
    spoilable: Path, spoil: Callable[[Path], object], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    spoil(spoilable)
    with pytest.raises(StereogridError, match=message) as caught:
        list(open_recording(spoilable))
    assert str(spoilable) in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 700
    assert capfd.readouterr().err == ""


# The real thing: a MAV on a box in ETH's Vicon room, whose world has its z = 0 on the floor.


def plane(points_m: np.ndarray) -> tuple[float, float]:
    """Tilt [degrees] and mean height [m] of the plane through most of points (N, 3)."""
    for near_m in (0.12, 0.06, 0.06, 0.06, 0.03, 0.03, 0.03):
        rows = np.c_[points_m[:, :2], np.ones(len(points_m))]
        slopes = np.linalg.lstsq(rows, points_m[:, 2], rcond=None)[0]
        points_m = points_m[abs(rows @ slopes - points_m[:, 2]) < near_m]
    tilt_deg = np.degrees(np.arctan(np.hypot(*slopes[:2])))
    return float(tilt_deg), float(points_m[:, 2].mean())


def test_the_floor_of_a_real_room_is_level_and_at_the_height_of_the_worlds_zero(
    real_data: Callable[[str], Path],
) -> None:
    recording = open_recording(real_data("sequences/euroc_static"))
    assert len(recording) == 12 and recording.left_out == {}
    assert recording.camera.baseline_m == pytest.approx(0.11008, abs=1e-5)
    assert recording.camera.focal_px == pytest.approx(436.24, abs=0.01)
    model = SensorModel(max_range_m=3.0)
    config = MappingConfig.for_camera(recording.camera)
    grid = OccupancyGrid(0.02, model=model)
    mapper = Mapper(recording.camera, matcher("bm", num_disparities=config.matcher.num_disparities), grid)
    points = []
    for each in Selection(recording, stride=4):
        disparity = mapper.step(each)
        points.append(transform(each.T_world_cam, recording.camera.back_project(disparity.disparity_px)))
    mapper.finish()
    camera_m = recording.poses[0, :3, 3]
    for name, cloud in (("points", np.concatenate(points)), ("map", grid.occupied_centres())):
        near = np.hypot(*(cloud[:, :2] - camera_m[:2]).T) < 2.5
        tilt_deg, height_m = plane(cloud[near & (abs(cloud[:, 2]) < 0.3)])
        assert tilt_deg < 1.0, name
        assert abs(height_m) < 0.03, name
    assert camera_height(grid, recording.poses[::4, :3, 3]).value == pytest.approx(camera_m[2], abs=0.03)
