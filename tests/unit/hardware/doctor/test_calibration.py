"""A calibration is checked alone, against the pictures' size, and against what the cameras see."""

import cv2
import numpy as np
import pytest

from hardware.cameras.pairs import RawPair
from hardware.doctor.calibration import check_file, check_fit, check_own, check_size
from stereogrid.calibration import CalibrationErrors, Mount, StereoCalibration, save_calibration
from stereogrid.checks import NOT_THERE, OK, PROBLEM, WARNING
from stereogrid.geometry import from_rotation

SIZE_PX = (320, 240)
K = np.array([[400.0, 0, 159.5], [0, 400.0, 119.5], [0, 0, 1]])
DISPARITY_PX = 12


def save(path, *, rms_px=0.3, mount=True):
    errors = CalibrationErrors((rms_px, rms_px), rms_px, 0.1, 0.3, 1.0, 0.01)
    rig = StereoCalibration(
        (K, K), (np.zeros(5), np.zeros(5)), from_rotation(np.eye(3), [-0.06, 0, 0]), SIZE_PX, errors, n_pairs=14
    )
    save_calibration(rig, path, T_base_cam=Mount(0.1, 0.03, 0.4).T_base_cam if mount else None)
    return path


@pytest.fixture
def file(tmp_path):
    return check_file(save(tmp_path / "rig.toml"))[1]


def states(checks):
    return {check.name: check.state for check in checks}


def test_a_good_file_is_told_in_one_line(tmp_path):
    checks, _ = check_file(save(tmp_path / "rig.toml"))
    assert states(checks) == {"calibration": OK, "mount": OK}
    assert "320x240, focal length 400 px, baseline 60.0 mm, 14 pairs, rms 0.30 px" in checks[0].found
    assert checks[1].found == "left lens 0.10 m ahead, 0.03 m to the left, 0.40 m up"


def test_a_poor_one_and_one_without_a_mount_are_warned_of(tmp_path):
    checks, _ = check_file(save(tmp_path / "rig.toml", rms_px=1.5, mount=False))
    assert states(checks) == {"calibration": WARNING, "mount": WARNING}


@pytest.mark.parametrize("text", [None, "format = 'nonsense'\n", "not toml"])
def test_a_file_that_is_none_is_a_problem(tmp_path, text):
    path = tmp_path / "rig.toml"
    if text is not None:
        path.write_text(text)
    (check,), held = check_file(path)
    assert (check.state, held) == (PROBLEM, None)
    assert "hardware calibrate" in check.remedy


def test_pictures_of_another_size_are_a_problem_with_the_size_to_ask_for(file):
    assert check_size(file, SIZE_PX).state == OK
    check = check_size(file, (640, 480))
    assert check.state == PROBLEM and check.remedy.startswith("--size 320x240")


def pair(rows_px=0, disparity_px=DISPARITY_PX):
    """A wall of blots that both cameras see, the right one shifted."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (280, 400)).astype(np.uint8), (0, 0), 2.0)
    wall = cv2.normalize(wall, None, 0, 255, cv2.NORM_MINMAX)
    left = wall[20:260, 40:360]
    right = wall[20 + rows_px : 260 + rows_px, 40 + disparity_px : 360 + disparity_px]
    return RawPair(np.ascontiguousarray(left), np.ascontiguousarray(right), 0.0, 0.0)


def test_what_the_cameras_see_fits_the_calibration_they_have(file):
    check = check_fit(file, pair())
    assert check.state == OK, check
    assert check.values["rows_px"] < 0.5 and check.values["ahead"] > 0.9


def test_a_rig_that_was_knocked_is_warned_of(file):
    check = check_fit(file, pair(rows_px=4))
    assert check.state == WARNING and "have moved" in check.remedy
    assert check.values["rows_px"] == pytest.approx(4, abs=0.5)


def test_swapped_cameras_are_a_problem(file):
    check = check_fit(file, pair(disparity_px=-DISPARITY_PX))
    assert check.state == PROBLEM and "swapped" in check.found


def test_a_bare_wall_tells_nothing(file):
    grey = np.full((240, 320), 128, np.uint8)
    assert check_fit(file, RawPair(grey, grey, 0.0, 0.0)).state == NOT_THERE


def test_what_a_server_says_of_its_pictures_is_checked_too():
    said = {"focal_px": 400.0, "cx_px": 159.5, "cy_px": 119.5, "baseline_m": 0.06, "width_px": 320, "height_px": 240}
    said["T_base_cam"] = Mount(0.1, 0.03, 0.4).T_base_cam.tolist()
    check, rig = check_own(said, SIZE_PX)
    assert check.state == OK and rig is not None
    assert check_fit(rig, pair()).state == OK
    for wrong, size_px in (({**said, "focal_px": -1.0}, SIZE_PX), ({}, SIZE_PX), (said, (640, 480))):
        check, rig = check_own(wrong, size_px)
        assert (check.state, rig) == (PROBLEM, None)
