"""The lens moves, dims and blurs as its numbers say, and rectification takes back what the calibration knows."""

import numpy as np
import pytest
from faults_scenes import centre, flat, spots

pytest.importorskip("embreex")

from sim.faults import CameraFaults, FaultyPair
from sim.faults.optics import unknown_rotation
from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError

CAMERA = StereoCamera(834.0, 319.5, 239.5, 0.06, 640, 480)
PLACES = [(60.0, 50.0), (319.5, 60.0), (580.0, 430.0), (320.0, 240.0), (100.0, 400.0)]


def test_vignetting_takes_its_share_in_the_corner_and_nothing_in_the_middle() -> None:
    left, right = FaultyPair(CAMERA, CameraFaults(vignetting=0.4), 0).taken(flat(200, CAMERA), 0)
    assert np.array_equal(left, right)
    for corner in (left[0, 0], left[0, -1], left[-1, 0], left[-1, -1]):
        assert (corner / 200) ** 2 == pytest.approx(0.6, abs=0.01)
    assert left[239, 319] == 200
    # It grows with the square of the radius.
    assert (left[239, 0] / 200) ** 2 == pytest.approx(1 - 0.4 * 319.5**2 / (319.5**2 + 239.5**2), abs=0.01)


@pytest.mark.parametrize("k1", [-0.15, -0.05, 0.1])
def test_distortion_moves_points_by_the_formula_and_rectification_moves_them_back(k1: float) -> None:
    pair = FaultyPair(CAMERA, CameraFaults(distortion_k1=k1), 0)
    image = spots(CAMERA, PLACES)
    raw, _ = pair.raw((image, image), 0)
    rectified, _ = pair.taken((image, image), 0)
    corner2 = (319.5**2 + 239.5**2) / 834.0**2
    focal_px = 834.0 / max(1.0, 1 + k1 * corner2)
    moved = []
    for place in PLACES:
        at = (np.array(place) - [319.5, 239.5]) / 834.0
        expected = [319.5, 239.5] + focal_px * at * (1 + k1 * at @ at)
        moved.append(np.linalg.norm(expected - place))
        assert centre(raw, tuple(expected)) == pytest.approx(expected, abs=0.03)
        assert centre(rectified, place) == pytest.approx(place, abs=0.03)
    assert max(moved) > 2


def test_a_distortion_that_folds_the_picture_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"distortion_k1 = -2.0 folds"):
        FaultyPair(CAMERA, CameraFaults(distortion_k1=-2.0), 0)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_turned_right_camera_shifts_its_rectified_picture_by_focal_times_angle(seed: int) -> None:
    faults = CameraFaults(calibration_error_deg=0.1)
    left, right = FaultyPair(CAMERA, faults, seed).taken((spots(CAMERA, PLACES),) * 2, 0)
    turn = unknown_rotation(faults, seed)
    for place in PLACES:
        ray = turn.T @ [(place[0] - 319.5) / 834.0, (place[1] - 239.5) / 834.0, 1.0]
        assert centre(left, place) == pytest.approx(place, abs=0.03)
        assert centre(right, place) == pytest.approx([319.5, 239.5] + 834.0 * ray[:2] / ray[2], abs=0.03)
    # To first order, in the middle: turned about x the picture moves along y, about y along x.
    rotvec = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
    assert np.linalg.norm(rotvec) == pytest.approx(np.deg2rad(0.1), rel=1e-3)
    middle = centre(right, (320.0, 240.0)) - (320.0, 240.0)
    assert middle == pytest.approx([-834.0 * rotvec[1], 834.0 * rotvec[0]], abs=0.03)


def test_the_axis_of_the_calibration_error_is_by_seed_and_its_angle_is_not() -> None:
    faults = CameraFaults(calibration_error_deg=0.05)
    a, b = unknown_rotation(faults, 1), unknown_rotation(faults, 2)
    assert np.array_equal(a, unknown_rotation(faults, 1))
    assert np.trace(a) == pytest.approx(np.trace(b)) and np.abs(a - b).max() > 1e-4


def test_the_edges_of_a_rectified_picture_are_filled() -> None:
    for k1 in (-0.15, 0.1):
        faults = CameraFaults(distortion_k1=k1, calibration_error_deg=0.05)
        for image in FaultyPair(CAMERA, faults, 0).taken(flat(180, CAMERA), 0):
            assert np.abs(image.astype(int) - 180).max() <= 1
