"""Which rig it is that sends pairs."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from live_rig import camera_json
from recorded_rig import CAMERA, RIG

from hardware.errors import CameraError
from hardware.live.rig import parse_size, rig_of
from stereogrid.calibration import CalibrationFile, Mount, StereoCalibration
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_rotation

STRAIGHT = StereoCalibration(
    (CAMERA.K, CAMERA.K), (np.zeros(5), np.zeros(5)), from_rotation(np.eye(3), [-0.06, 0, 0]), (160, 120)
)


@dataclass
class Cameras:
    """What is asked of cameras here."""

    size_px: tuple[int, int] = (160, 120)
    name: str = "two cameras"
    about: dict[str, Any] = field(default_factory=dict)


def rig(about: dict[str, Any], calibration: CalibrationFile | None = None, mount: str = "", **cameras: Any) -> Any:
    return rig_of(Cameras(about=about, **cameras), calibration, mount)  # type: ignore[arg-type]


def test_a_server_that_says_what_its_pictures_are_needs_no_calibration() -> None:
    found = rig({"camera.json": camera_json()})
    assert found.camera == CAMERA and np.array_equal(found.T_base_cam, RIG.T_base_cam)


def test_a_calibration_comes_first_and_the_mount_given_overrules_all() -> None:
    held = CalibrationFile(STRAIGHT, T_base_cam=Mount(0.2, 0.03, 0.5).T_base_cam)
    assert rig({"camera.json": {}}, held) is held
    moved = rig({}, held, "0.1,0.03,0.4,10")
    assert np.allclose(moved.T_base_cam, Mount(0.1, 0.03, 0.4, 10.0).T_base_cam)
    assert moved.calibration is STRAIGHT


@pytest.mark.parametrize(
    ("about", "calibration", "message"),
    [
        ({}, None, "two cameras: nothing says what these cameras see: give --calibration"),
        ({"camera.json": {**camera_json(), "focal_px": "x"}}, None, "camera.json: 'focal_px' must be float, not 'x'"),
        ({"camera.json": {**camera_json(), "baseline_m": -1.0}}, None, "two cameras: camera.json: .*baseline"),
        ({"camera.json": {**camera_json(), "width_px": 168}}, None, "camera.json is of pictures of 168 x 120 pixels"),
        ({}, CalibrationFile(STRAIGHT), "does not say where the left camera stands on the robot: give --mount"),
    ],
)
def test_what_is_missing_or_does_not_fit_is_said(about: dict[str, Any], calibration: Any, message: str) -> None:
    with pytest.raises((CameraError, InvalidInputError), match=message):
        rig(about, calibration)


@pytest.mark.parametrize("text", ["", "1,2", "a,b,c", "1,2,3,4,5,6,7", "0,0,nan", "0,0,-1", "0,0,.4,200"])
def test_a_mount_that_no_camera_has_is_refused(text: str) -> None:
    with pytest.raises(InvalidInputError):
        Mount.parse(text)


def test_sizes_are_read_and_what_is_none_is_refused() -> None:
    assert parse_size("320x240") == (320, 240) and parse_size("640X480") == (640, 480)
    for text in ("320", "320x", "0x1", "-1x5", "axb", "1x2x3", "²x3"):
        with pytest.raises(InvalidInputError, match="WIDTHxHEIGHT"):
            parse_size(text)
