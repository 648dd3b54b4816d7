"""A rig is recovered from its view of a chessboard, on real pairs and on exact ones; impossible rigs are refused."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stereogrid.calibration import (
    BoardViews,
    Chessboard,
    StereoCalibration,
    calibrate_corners,
    calibrate_stereo,
    calibrate_views,
    far_pairs,
    find_corners,
    residuals,
    without_far_pairs,
)
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_rotation

BOARD = Chessboard(9, 6, 0.025)
SIZE = (640, 480)
K = (
    np.array([[830.0, 0, 322.0], [0, 829.0, 238.0], [0, 0, 1]]),
    np.array([[838.0, 0, 316.0], [0, 837.0, 242.0], [0, 0, 1]]),
)
DISTORTION = (np.array([-0.08, 0.03, 0.001, -0.0005, 0.0]), np.array([-0.06, 0.01, 0.0, 0.0008, 0.0]))
T_RIGHT_LEFT = from_rotation(Rotation.from_rotvec([0.004, -0.01, 0.006]).as_matrix(), [-0.06, 0.0004, -0.0007])
RIG = StereoCalibration(K, DISTORTION, T_RIGHT_LEFT, SIZE)


def seen(n=12, noise_px=0.0):
    """Corners (n, 54, 2) of both cameras of RIG, of a board before them in n poses."""
    rng = np.random.default_rng(3)
    both = ([], [])
    for _ in range(n):
        turn = rng.uniform(-0.6, 0.6, 3)
        shift = np.array([rng.uniform(-0.16, 0.0), rng.uniform(-0.14, 0.0), rng.uniform(0.5, 0.8)])
        T_left_board = from_rotation(Rotation.from_rotvec(turn).as_matrix(), shift)
        for side, T in enumerate((T_left_board, T_RIGHT_LEFT @ T_left_board)):
            rotvec = Rotation.from_matrix(T[:3, :3]).as_rotvec()
            points = cv2.projectPoints(BOARD.corners_m, rotvec, T[:3, 3], K[side], DISTORTION[side])[0].reshape(-1, 2)
            both[side].append(points + rng.normal(0, noise_px, points.shape) if noise_px else points)
    return np.array(both[0]), np.array(both[1])


def drawn(board=BOARD, square_px=40, shape=(480, 640), at=(100, 80)):
    """An image of a board seen straight on, its first inner corner at (x, y) = at + square - 1/2."""
    image = np.full(shape, 220, np.uint8)
    for row in range(board.rows + 1):
        for column in range(board.columns + 1):
            if (row + column) % 2 == 0:
                y, x = at[1] + row * square_px, at[0] + column * square_px
                image[y : y + square_px, x : x + square_px] = 30
    return image


@pytest.fixture
def real_pairs(real_data):
    """The pairs (left, right) and the names of the left pictures."""
    folder = real_data("calibration")
    names = sorted(path.name for path in folder.glob("left[0-9][0-9].jpg"))
    assert len(names) == 13
    sides = [
        [cv2.imread(str(folder / n), cv2.IMREAD_GRAYSCALE) for n in (x, x.replace("left", "right"))] for x in names
    ]
    return [(left, right) for left, right in sides], names


def test_corners_are_found_where_the_squares_meet():
    corners = find_corners(cv2.GaussianBlur(drawn(), (0, 0), 0.8), BOARD)
    row, column = np.mgrid[:6, :9]
    exact = np.column_stack([100 + 40 * (column.ravel() + 1) - 0.5, 80 + 40 * (row.ravel() + 1) - 0.5])
    assert np.abs(corners - exact).max() < 0.05


def test_a_board_upside_down_is_counted_from_the_same_corner_of_the_image():
    upright, turned = (find_corners(image, BOARD) for image in (drawn(), np.ascontiguousarray(drawn()[::-1, ::-1])))
    for corners in (upright, turned):
        assert np.linalg.norm(corners[0]) < np.linalg.norm(corners[-1])
    np.testing.assert_allclose(turned, ([639.0, 479.0] - upright)[::-1], atol=0.05)


def test_no_board_gives_no_corners():
    assert find_corners(np.full((480, 640), 128, np.uint8), BOARD) is None


def test_exact_corners_give_the_rig_back():
    found = calibrate_corners(*seen(), BOARD, SIZE)
    for side in (0, 1):
        np.testing.assert_allclose(found.K[side], K[side], atol=0.05)
        np.testing.assert_allclose(found.distortion[side], DISTORTION[side], atol=2e-3)
    np.testing.assert_allclose(found.T_right_left, T_RIGHT_LEFT, atol=2e-5)
    errors = found.errors
    assert max(*errors.rms_px, errors.stereo_rms_px, errors.epipolar_p95_px) < 0.01
    assert errors.square_edge_mean == pytest.approx(1, abs=1e-4)


def test_the_rms_is_the_noise_of_the_corners():
    found = calibrate_corners(*seen(20, noise_px=0.3), BOARD, SIZE)
    # A vector of two coordinates is sqrt(2) as long as one deviation.
    assert found.errors.rms_px == pytest.approx((0.3 * np.sqrt(2),) * 2, rel=0.05)
    assert found.errors.stereo_rms_px == pytest.approx(0.3 * np.sqrt(2), rel=0.05)
    # Two rows that each have a deviation of .3 px differ by their mean absolute difference.
    assert found.errors.epipolar_mean_px == pytest.approx(0.3 * 2 / np.sqrt(np.pi), rel=0.1)


def test_rectified_corners_lie_in_one_row_at_their_depth():
    left, right = RIG.rectified_points(*seen(2))
    assert np.abs(left[:, 1] - right[:, 1]).max() < 0.01
    camera = RIG.rectification().camera
    assert camera.baseline_m == pytest.approx(RIG.baseline_m)
    depth_m = camera.depth_m(left[:, 0] - right[:, 0])
    assert (depth_m > 0.3).all() and (depth_m < 1.0).all()


def test_thirteen_real_pairs_are_calibrated_to_a_fraction_of_a_pixel(real_pairs):
    pairs, names = real_pairs
    found = calibrate_stereo(pairs, BOARD, names)
    assert found.n_pairs == 13 and not found.left_out
    assert found.errors.stereo_rms_px <= 0.45
    assert found.errors.epipolar_mean_px <= 0.15
    assert found.errors.square_edge_mean == pytest.approx(1, abs=0.005)
    assert found.K[0][0, 0] == pytest.approx(535, rel=0.01)
    assert found.baseline_m == pytest.approx(3.344 * 0.025, rel=0.01)


def test_columns_and_rows_may_be_named_the_other_way_round(real_pairs):
    pairs, names = real_pairs
    found = calibrate_stereo(pairs, Chessboard(6, 9, 0.025), names)
    assert found.n_pairs == 13 and found.errors.stereo_rms_px <= 0.45
    assert found.baseline_m == pytest.approx(3.344 * 0.025, rel=0.01)


def test_real_pairs_without_a_board_are_left_out_by_name(real_pairs):
    pairs, names = real_pairs
    blank = np.full((480, 640), 90, np.uint8)
    pairs[3] = (pairs[3][0], blank)
    found = calibrate_stereo(pairs, BOARD, names)
    assert found.n_pairs == 12
    assert found.left_out == (f"{names[3]}: no board of 9x6 inner corners in the right image",)


def test_swapped_cameras_are_refused():
    with pytest.raises(InvalidInputError, match=r"not to the right: baseline -\d+\.\d mm; are left and right swapped"):
        calibrate_corners(*seen()[::-1], BOARD, SIZE)


def test_pictures_of_different_moments_are_refused():
    left, right = seen()
    with pytest.raises(InvalidInputError, match=r"corners do not fit: rms .* of the same moments"):
        calibrate_corners(left, np.roll(right, 1, axis=0), BOARD, SIZE)


def test_one_pair_of_two_moments_among_many_is_named_and_can_be_left_out():
    left, right = seen(12, noise_px=0.1)
    right[4] = seen(13, noise_px=0.1)[1][12]
    views = BoardViews(BOARD, SIZE, tuple("abcdefghijkl"), (left, right))
    with pytest.raises(
        InvalidInputError, match=r"do not fit: rms .* of the same moments\? e: its corners .*far as usual$"
    ):
        calibrate_views(views)
    found = calibrate_views(without_far_pairs(views))
    assert found.n_pairs == 11 and [line[:2] for line in found.left_out] == ["e:"]
    assert found.baseline_m == pytest.approx(RIG.baseline_m, rel=0.002)


def test_a_bent_board_is_named_where_the_fit_still_stands():
    left, right = seen(12, noise_px=0.1)
    left[7] += 1.5 * np.sin(np.arange(54))[:, None]
    views = BoardViews(BOARD, SIZE, tuple("abcdefghijkl"), (left, right))
    found = calibrate_views(views)
    assert list(far_pairs(views.names, residuals(found, views.corners, BOARD).rms_px)) == ["h"]
    assert without_far_pairs(views).names == tuple("abcdefgijkl")


def test_pairs_that_are_alike_are_all_kept():
    left, right = seen(12, noise_px=0.3)
    names = tuple("abcdefghijkl")
    assert without_far_pairs(BoardViews(BOARD, SIZE, names, (left, right))).names == names


def test_corners_that_determine_nothing_are_refused():
    with pytest.raises(InvalidInputError, match="tilt the board in more ways"):
        calibrate_corners(*[np.full((8, 54, 2), 5.0)] * 2, BOARD, SIZE)


def test_too_few_pairs_and_those_without_a_board_are_named():
    blank = np.full((480, 640), 128, np.uint8)
    with pytest.raises(
        InvalidInputError,
        match=r"none of 2 pairs .* board of 9x6 inner corners .*; pair 1: .* right image; pair 2: .* left and",
    ):
        calibrate_stereo([(drawn(), blank), (blank, blank)], BOARD)
    with pytest.raises(InvalidInputError, match=r"only 1 of 5 .* 5 are needed; pair 2: .*; pair 4: .*; and 1 more"):
        calibrate_stereo([(drawn(), drawn()), *[(blank, blank)] * 4], BOARD)
    with pytest.raises(InvalidInputError, match="no pairs"):
        calibrate_stereo([], BOARD)
    with pytest.raises(InvalidInputError, match="4 pairs are too few"):
        calibrate_corners(*seen(4), BOARD, SIZE)


def test_images_of_another_size_or_kind_are_named():
    image, small = np.zeros((480, 640), np.uint8), np.zeros((240, 320), np.uint8)
    with pytest.raises(InvalidInputError, match="b: the right image is 320x240 px, the left one of a 640x480"):
        calibrate_stereo([(image, image), (image, small)], BOARD, ["a", "b"])
    with pytest.raises(InvalidInputError, match="pair 1: the left image must be"):
        calibrate_stereo([(np.zeros((480, 640, 3), np.uint8), image)], BOARD)


def test_corners_of_another_board_are_refused():
    with pytest.raises(InvalidInputError, match=r"\(M, 20, 2\)"):
        calibrate_corners(*seen(), Chessboard(5, 4, 0.025), SIZE)


def turned_K(**changes):
    matrix = K[0].copy()
    for place, value in changes.items():
        matrix[{"fx": (0, 0), "fy": (1, 1), "cx": (0, 2)}[place]] = value
    return (matrix, K[1])


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"K": turned_K(fx=60.0, fy=60.0)}, "left focal length is 60 px, for 640 px of width expected"),
        ({"K": turned_K(fx=9000.0, fy=9000.0)}, "left focal length is 9000 px"),
        ({"K": turned_K(fy=700.0)}, "left pixels are not square"),
        ({"K": turned_K(cx=20.0)}, "left principal point"),
        ({"K": turned_K(fx=np.nan)}, "finite"),
        ({"distortion": (np.array([-3.0, 0, 0, 0, 0]), DISTORTION[1])}, "left distortion .* folds the picture"),
        ({"distortion": (np.zeros(3), DISTORTION[1])}, "left distortion must be 4, 5, 8"),
        ({"distortion": (np.array([10.0, 0, 0, 0, 0]),) * 2}, "turn a focal length of 830 px into 2"),
        ({"T_right_left": from_rotation(np.eye(3), [0.06, 0, 0])}, "not to the right"),
        ({"T_right_left": from_rotation(np.eye(3), [-0.06, 0.05, 0])}, "not beside the left one"),
        ({"T_right_left": from_rotation(Rotation.from_rotvec([0, 0.9, 0]).as_matrix(), [-0.06, 0, 0])}, "would turn"),
    ],
)
def test_what_no_rig_can_be_is_refused_with_the_reason(wrong, reason):
    with pytest.raises(InvalidInputError, match=reason):
        replace(RIG, **wrong)


def test_a_board_has_enough_corners_and_a_size():
    with pytest.raises(InvalidInputError, match="3 rows"):
        Chessboard(9, 2, 0.025)
    with pytest.raises(InvalidInputError, match="square_m"):
        Chessboard(9, 6, 0.0)
