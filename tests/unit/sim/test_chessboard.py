"""The virtual rig is calibrated from what it sees of a virtual chessboard, by the code that real cameras use."""

from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("embreex")

from typer.testing import CliRunner

from sim.__main__ import app
from sim.chessboard import ChessboardSession, write_pairs
from sim.faults import camera_faults
from stereogrid.calibration import Chessboard, StereoCalibration, calibrate_stereo, find_corners
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, as_floats, inverse, rotation_angle_rad

IDEAL = camera_faults("ideal")


def corners_px(truth: StereoCalibration, T_left_board: FloatArray, board: Chessboard) -> list[FloatArray]:
    """Where the left and the right raw picture truly show the corners (N, 2) of a board at a pose."""
    pixels = []
    for T, K, D in zip((T_left_board, truth.T_right_left @ T_left_board), truth.K, truth.distortion, strict=True):
        exact, _ = cv2.projectPoints(board.corners_m, cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], K, D)
        pixels.append(as_floats(exact.reshape(-1, 2)))
    return pixels


def test_a_webcam_rig_is_recovered_from_its_pictures() -> None:
    """It is judged by boards that it was not fitted to, and by where they truly are in the pictures."""
    session = ChessboardSession(seed=1)
    truth = session.truth()
    found = calibrate_stereo(list(session.pairs()), session.board)
    assert found.n_pairs == 18
    for K, D in zip(found.K, found.distortion, strict=True):
        assert K[0, 0] == pytest.approx(834.0, rel=0.001)
        assert K[1, 1] == pytest.approx(834.0, rel=0.001)
        # As far as the corner of the picture, at .48 of the focal length.
        assert D[0] * 0.48**2 + D[1] * 0.48**4 == pytest.approx(-0.08 * 0.48**2, abs=0.002)
    assert found.baseline_m == pytest.approx(0.06, abs=0.00005)
    others = [corners_px(truth, T, session.board) for T in ChessboardSession(seed=2).poses()]
    left, right = found.rectified_points(*(np.concatenate(side) for side in zip(*others, strict=True)))
    assert np.abs(left[:, 1] - right[:, 1]).mean() < 0.02
    # An angle and the principal point are hard to tell apart: a pixel is .07 degrees.
    assert rotation_angle_rad(found.T_right_left @ inverse(truth.T_right_left)) < np.deg2rad(0.07)


def test_the_true_calibration_says_where_the_corners_are() -> None:
    """The pictures and the numbers are made in two ways: by rendering and lens, and by OpenCV's projection."""
    session = ChessboardSession(faults=camera_faults("ideal, distortion_k1=-0.1, calibration_error_deg=0.3"), count=3)
    truth = session.truth()
    for pair, T_left_board in zip(session.pairs(), session.poses(), strict=True):
        for image, exact in zip(pair, corners_px(truth, T_left_board, session.board), strict=True):
            corners = find_corners(image, session.board)
            assert corners is not None
            off = corners - exact
            assert np.abs(off).max() < 0.3
            assert np.abs(off.mean(axis=0)).max() < 0.05


def test_the_boards_reach_every_part_of_the_picture() -> None:
    session = ChessboardSession()
    seen = np.zeros((3, 3), bool)
    for T in session.poses():
        points = session.board.corners_m @ T[:3, :3].T + T[:3, 3]
        pixels = 834.0 * points[:, :2] / points[:, 2:] + [319.5, 239.5]
        column, row = (np.clip(pixels // [640 / 3, 480 / 3], 0, 2)).astype(int).T
        seen[row, column] = True
    assert seen.all()


def test_the_same_seed_takes_the_same_pictures_and_another_one_others() -> None:
    first, same, other = (next(ChessboardSession(seed=seed, count=1).pairs())[0].tobytes() for seed in (3, 3, 4))
    assert first == same != other


def test_pairs_are_written_under_names_that_belong_together(tmp_path: Path) -> None:
    session = ChessboardSession(faults=IDEAL, count=2)
    assert write_pairs(session, tmp_path / "boards") == 2
    assert sorted(path.name for path in (tmp_path / "boards").iterdir()) == [
        "left01.png", "left02.png", "right01.png", "right02.png",
    ]  # fmt: skip
    left, _ = next(session.pairs())
    assert np.array_equal(cv2.imread(str(tmp_path / "boards" / "left01.png"), cv2.IMREAD_UNCHANGED), left)


def test_pictures_that_are_there_are_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "right07.jpg").write_bytes(b"mine")
    with pytest.raises(InvalidInputError, match=r"right07.jpg: exists already; choose another folder"):
        write_pairs(ChessboardSession(count=1), tmp_path)
    with pytest.raises(InvalidInputError, match="is no folder"):
        write_pairs(ChessboardSession(count=1), tmp_path / "right07.jpg")
    assert [path.name for path in tmp_path.iterdir()] == ["right07.jpg"]


def test_the_command_writes_pairs_and_tells_the_truth(tmp_path: Path) -> None:
    words = ["chessboard", "--out", str(tmp_path / "b"), "--count", "1", "--faults", "ideal", "--columns", "7"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0 and "1 pairs; true focal length 834.0 px, baseline 60.00 mm" in result.output
    image = cv2.imread(str(tmp_path / "b" / "left01.png"), cv2.IMREAD_GRAYSCALE)
    assert find_corners(image, Chessboard(7, 6)) is not None


@pytest.mark.parametrize(("wrong", "reason"), [({"count": 0}, "count"), ({"seed": -1}, "seed")])
def test_a_number_out_of_range_is_named(wrong: dict[str, int], reason: str) -> None:
    with pytest.raises(InvalidInputError, match=reason):
        ChessboardSession(**wrong)  # type: ignore[arg-type]
