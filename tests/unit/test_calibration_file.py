"""A calibration is read back as it was written, and a file that cannot be true is refused by name and reason."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stereogrid.calibration import (
    CalibrationErrors,
    CameraNames,
    Chessboard,
    Mount,
    RectifiedRig,
    StereoCalibration,
    load_calibration,
    save_calibration,
)
from stereogrid.errors import ConfigError, InvalidInputError
from stereogrid.geometry import from_rotation, transform

RIG = StereoCalibration(
    (
        np.array([[830.1, 0, 322.0], [0, 829.2, 238.0], [0, 0, 1]]),
        np.array([[838.3, 0, 316.0], [0, 837.4, 242.0], [0, 0, 1]]),
    ),
    (np.array([-0.08, 0.03, 0.001, -0.0005, 0.0]), np.array([-0.06, 0.01, 0.0, 1 / 3, 0.0]) * [1, 1, 1, 0.001, 1]),
    from_rotation(Rotation.from_rotvec([0.004, -0.01, 0.006]).as_matrix(), [-0.06, 0.0004, -0.0007]),
    (640, 480),
    CalibrationErrors((0.21, 0.22), 0.23, 0.1, 0.25, 1.0004, 0.011),
    n_pairs=14,
    left_out=("left07.png: no board", 'a "quoted" \\ name 📷\n'),
)
NAMES = CameraNames("minoru", True, "/dev/v4l/by-path/a:1.0", "/dev/v4l/by-path/b:1.0")
MOUNT = Mount(0.1, 0.03, 0.4, pitch_deg=5.0)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    save_calibration(RIG, path, T_base_cam=MOUNT.T_base_cam, board=Chessboard(9, 6, 0.03), cameras=NAMES)
    return path


def with_change(path: Path, before: str, after: str) -> Path:
    text = path.read_text(encoding="utf-8")
    assert text.count(before) >= 1
    path.write_text(text.replace(before, after, 1), encoding="utf-8")
    return path


def test_a_calibration_is_read_back_to_the_last_bit(saved: Path) -> None:
    found = load_calibration(saved)
    for side in (0, 1):
        np.testing.assert_array_equal(found.calibration.K[side], RIG.K[side])
        np.testing.assert_array_equal(found.calibration.distortion[side], RIG.distortion[side])
    np.testing.assert_array_equal(found.calibration.T_right_left, RIG.T_right_left)
    for name in ("size_px", "errors", "n_pairs", "left_out"):
        assert getattr(found.calibration, name) == getattr(RIG, name)
    assert (found.board, found.cameras) == (Chessboard(9, 6, 0.03), NAMES)
    assert found.T_base_cam == pytest.approx(MOUNT.T_base_cam, abs=1e-12)
    assert found.date.startswith("20") and found.date.endswith("+00:00")
    assert found.camera == RIG.rectification().camera


def test_a_person_can_read_and_change_where_the_camera_sits(saved: Path) -> None:
    text = saved.read_text(encoding="utf-8")
    assert "[mount]\nx_m = 0.1\ny_m = 0.03\nz_m = 0.4\npitch_deg = 5.0\n" in text
    moved = load_calibration(with_change(saved, "z_m = 0.4\n", "z_m = 1\n")).T_base_cam
    assert moved is not None and moved[2, 3] == 1.0


def test_what_is_not_known_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    save_calibration(replace(RIG, errors=None, n_pairs=0, left_out=()), path)
    found = load_calibration(path)
    assert found.T_base_cam is None and found.board is None and found.calibration.errors is None
    assert found.cameras == CameraNames()


def test_a_pitch_looks_down_a_yaw_left_and_a_roll_leans_right() -> None:
    ahead, up = [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]
    down = transform(Mount(0, 0, 1, pitch_deg=30).T_base_cam, ahead)
    np.testing.assert_allclose(down, [np.cos(np.pi / 6), 0, 1 - 0.5], atol=1e-12)
    left = transform(Mount(0, 0, 1, yaw_deg=90).T_base_cam, ahead)
    np.testing.assert_allclose(left, [0, 1, 1], atol=1e-12)
    right = transform(Mount(0, 0, 1, roll_deg=90).T_base_cam, up)
    np.testing.assert_allclose(right, [0, -1, 1], atol=1e-12)


angles = st.floats(-89, 89)
lengths = st.floats(-2, 2)


@given(mount=st.builds(Mount, lengths, lengths, st.floats(0.01, 2), angles, angles, angles))
def test_a_mount_is_found_again_in_its_pose(mount: Mount) -> None:
    again = Mount.of(mount.T_base_cam)
    np.testing.assert_allclose(again.T_base_cam, mount.T_base_cam, atol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [({"z_m": 0.0}, "z_m"), ({"z_m": 40.0}, "z_m"), ({"x_m": np.nan}, "x_m"), ({"pitch_deg": 100.0}, "pitch_deg")],
)
def test_a_camera_is_not_in_the_ground_nor_out_of_reach(wrong: dict[str, float], reason: str) -> None:
    with pytest.raises(InvalidInputError, match=reason):
        replace(MOUNT, **wrong)


def test_the_public_minoru_calibration_with_a_rectification_of_1787_px_is_refused(tmp_path: Path) -> None:
    """320x240, fx 445 and 451; its rectification turns the left picture until R[0][0] = .38 and f = 1787 px."""
    path = tmp_path / "minoru.toml"
    # Such a turn comes of a baseline that points along the axis.
    turn = np.arccos(0.38)
    text = f"""format = "stereogrid calibration"
version = 1
size_px = [320, 240]
T_right_left = [
  [1.0, 0.0, 0.0, {-0.06 * np.cos(turn)}],
  [0.0, 1.0, 0.0, 0.0],
  [0.0, 0.0, 1.0, {0.06 * np.sin(turn)}],
  [0.0, 0.0, 0.0, 1.0],
]
[left]
K = [[445.0, 0.0, 160.0], [0.0, 445.0, 120.0], [0.0, 0.0, 1.0]]
distortion = [0.0, 0.0, 0.0, 0.0, 0.0]
[right]
K = [[451.0, 0.0, 160.0], [0.0, 451.0, 120.0], [0.0, 0.0, 1.0]]
distortion = [0.0, 0.0, 0.0, 0.0, 0.0]
"""
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"minoru\.toml: the right camera is not beside the left one"):
        load_calibration(path)
    # The same turn by a rotation between the cameras.
    a = Rotation.from_rotvec([0, 2 * turn, 0]).as_matrix()
    rows = ",\n".join(str([float(v) for v in (*row, x)]) for row, x in zip(a, (-0.06, 0, 0), strict=True))
    start, end = text.index("T_right_left"), text.index("[left]")
    turned = f"{text[:start]}T_right_left = [\n{rows},\n[0.0, 0.0, 0.0, 1.0]]\n{text[end:]}"
    path.write_text(turned, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"minoru\.toml: rectifying would turn"):
        load_calibration(path)


@pytest.mark.parametrize(
    ("before", "after", "reason"),
    [
        ("version = 1", "version = 2", "version 2, newer than this program, which reads 1"),
        ("version = 1", 'version = "one"', "version must be 1, not 'one'"),
        ('format = "stereogrid calibration"\n', "", "is no calibration: format must be 'stereogrid calibration'"),
        ("date =", "data =", "unknown key 'data'; did you mean 'date'"),
        ("[board]", "[bored]", "unknown key 'bored'; did you mean 'board'"),
        ("square_m = 0.03", "square_m = -1", "board.*square_m must be positive"),
        ("size_px = [640, 480]", "size_px = [640]", "size_px must be the pictures' width and height"),
        ("size_px = [640, 480]", 'size_px = ["640", "480"]', "size_px.* must be int"),
        ("size_px = [640, 480]", "size_px = [320, 240]", "principal point .* is far from the image's middle"),
        ("830.1", "nan", "left intrinsics .* finite"),
        ("0.0004", "nan", "T_right_left contains NaN"),
        ("0.0004", "inf", "T_right_left contains NaN or inf"),
        ("stereo_rms_px = 0.23", "stereo_rms_px = nan", "errors.* stereo_rms_px must be finite"),
        ("epipolar_p95_px = 0.25", "epipolar_p95_px = -1", "epipolar_p95_px must be finite and >= 0"),
        ("stereo_rms_px = 0.23", "stereo_rms_px = 3.1", "the corners do not fit: rms 3.10 px"),
        ("rms_px = [0.21, 0.22]", "rms_px = [0.21]", "rms_px must be of the left and the right"),
        ("-0.06, 0.01, 0.0,", "", "right distortion must be"),
        ("[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 1.0]", "T_right_left must be 4 rows of 4 numbers"),
        ("z_m = 0.4", "z_m = -0.4", "mount.* z_m, the lens above the ground"),
        ("z_m = 0.4\n", "", "missing key 'mount.z_m'"),
        ("swap = true", "swap = 1", "'cameras.swap' must be bool"),
        ("version = 1", "version", "at line 3"),
    ],
)
def test_a_wrong_line_is_named_with_the_file(saved: Path, before: str, after: str, reason: str) -> None:
    with pytest.raises(ConfigError, match=rf"rig\.toml: .*{reason}"):
        load_calibration(with_change(saved, before, after))


@pytest.mark.parametrize("key", ["format", "version", "size_px", "T_right_left", "left", "right"])
def test_a_missing_part_is_named(saved: Path, key: str) -> None:
    text = saved.read_text(encoding="utf-8")
    start = text.index(f"[{key}]" if key in ("left", "right") else f"{key} =")
    end = text.index("\n[" if key in ("left", "right") else "\n", start)
    if key == "T_right_left":
        end = text.index("\n]", start) + 2
    saved.write_text(text[:start] + text[end:], encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"rig\.toml: .*{key}"):
        load_calibration(saved)


def test_millimetres_for_metres_are_seen_by_the_baseline() -> None:
    with pytest.raises(InvalidInputError, match=r"baseline is 60000 mm.* given in metres"):
        replace(RIG, T_right_left=from_rotation(np.eye(3), [-60.0, 0, 0]))


def test_a_file_that_is_not_there_or_is_no_text_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read"):
        load_calibration(tmp_path / "none.toml")
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(ConfigError, match=r"picture\.toml: is no text"):
        load_calibration(tmp_path / "picture.toml")
    with pytest.raises(InvalidInputError, match=r"no such folder"):
        save_calibration(RIG, tmp_path / "none" / "rig.toml")


CAMERA_JSON = {
    "focal_px": 417.0,
    "cx_px": 159.5,
    "cy_px": 119.5,
    "baseline_m": 0.06,
    "width_px": 320,
    "height_px": 240,
    "T_base_cam": MOUNT.T_base_cam.tolist(),
}


def test_pictures_that_come_rectified_are_left_as_they_are() -> None:
    rig = RectifiedRig.from_table(CAMERA_JSON)
    assert (rig.camera.focal_px, rig.camera.cx_px, rig.camera.baseline_m) == (417.0, 159.5, 0.06)
    np.testing.assert_array_equal(rig.T_base_cam, MOUNT.T_base_cam)
    pair = tuple(np.random.default_rng(0).integers(0, 255, (2, 240, 320), np.uint8))
    assert all(np.array_equal(a, b) for a, b in zip(rig.rectify(*pair), pair, strict=True))
    with pytest.raises(InvalidInputError, match=r"the right image is \(240, 319\)"):
        rig.rectify(pair[0], pair[1][:, 1:])


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"focal_px": 9.0}, "focal length is 9 px"),
        ({"focal_px": float("nan")}, "focal_px must be positive"),
        ({"baseline_m": -0.06}, "baseline_m"),
        ({"baseline_m": 60.0}, "baseline is 60000 mm"),
        ({"cx_px": 1.0}, "principal point"),
        ({"width_px": 320.5}, "width_px.* int"),
        ({"T_base_cam": [[1.0]]}, "T_base_cam must be a"),
        ({"T_base_cam": [[1.0], [2.0, 3.0]]}, "T_base_cam must be 4 rows"),
        ({"T_base_cam": np.diag([2.0, 2.0, 2.0, 1.0]).tolist()}, "T_base_cam is not rigid"),
        ({"T_base_cam": None}, "T_base_cam"),
        ({"fov": 1}, "unknown key 'fov'"),
    ],
)
def test_a_camera_json_that_cannot_be_true_is_refused(wrong: dict[str, object], reason: str) -> None:
    with pytest.raises((ConfigError, InvalidInputError), match=reason):
        RectifiedRig.from_table(CAMERA_JSON | wrong)
    with pytest.raises(ConfigError, match="missing key 'cy_px'"):
        RectifiedRig.from_table({k: v for k, v in CAMERA_JSON.items() if k != "cy_px"})
