"""Eqs. 4 to 6, the matrices of a rectified pair, and rectification of synthetic and real distorted rigs."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stereogrid.camera import Rectification, StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_rotation, transform

MINORU = StereoCamera(focal_px=834, cx_px=319.5, cy_px=239.5, baseline_m=0.06, width_px=640, height_px=480)
SMALL = StereoCamera(focal_px=20, cx_px=7.25, cy_px=5.75, baseline_m=0.1, width_px=16, height_px=12)

cameras = st.builds(
    StereoCamera,
    focal_px=st.floats(50, 2000),
    cx_px=st.floats(-50, 800),
    cy_px=st.floats(-50, 800),
    baseline_m=st.floats(0.01, 2),
    width_px=st.integers(1, 2000),
    height_px=st.integers(1, 2000),
)
points = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(0.2, 100)).map(np.array)


def pixel(P, point_cam):
    u, v, w = P @ np.append(point_cam, 1)
    return np.array([u / w, v / w])


@given(cameras, points)
def test_eq4_depth_is_focal_times_baseline_over_left_minus_right(camera, point_cam):
    """d = x_left - x_right > 0. With the right image as x', as the text around Eq. 4 allows, depth is negative."""
    left, right = (pixel(P, point_cam) for P in camera.P)
    disparity = left[0] - right[0]
    assert disparity > 0
    assert camera.depth_m(disparity) == pytest.approx(point_cam[2], rel=1e-6)
    assert camera.disparity_px(point_cam[2]) == pytest.approx(disparity, rel=1e-6)
    assert camera.depth_m(right[0] - left[0]) < 0


def test_eq4_known_depth():
    """834 px x 60 mm = 50.04 px m: 10 px of disparity are 5.004 m."""
    assert MINORU.depth_m(10) == pytest.approx(5.004)


@given(cameras, points)
def test_eq5_and_eq6_with_the_right_pixel_are_off_by_exactly_the_baseline(camera, point_cam):
    (left, row), (right, row_right) = (pixel(P, point_cam) for P in camera.P)
    z = point_cam[2]
    x, y = z * (left - camera.cx_px) / camera.focal_px, z * (row - camera.cy_px) / camera.focal_px
    np.testing.assert_allclose([x, y, z], point_cam, rtol=1e-6, atol=1e-6)
    assert z * (right - camera.cx_px) / camera.focal_px == pytest.approx(x - camera.baseline_m, abs=1e-6)
    assert row_right == pytest.approx(row)


@given(st.floats(0.5, 9.9))
def test_project_undoes_back_project_at_every_pixel(depth_m):
    points_cam = SMALL.back_project(np.full(SMALL.shape, SMALL.disparity_px(depth_m)))
    rows, columns = np.indices(SMALL.shape)
    expected = np.stack([columns.ravel(), rows.ravel(), np.full(rows.size, SMALL.disparity_px(depth_m))], axis=1)
    np.testing.assert_allclose(SMALL.project(points_cam), expected, atol=1e-9)


@given(cameras, st.lists(points, min_size=1, max_size=4))
def test_project_agrees_with_the_projection_matrices(camera, cloud):
    left, right = ([pixel(P, p) for p in cloud] for P in camera.P)
    column, row, disparity = camera.project(cloud).T
    np.testing.assert_allclose(np.stack([column, row], axis=1), left, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(np.stack([column - disparity, row], axis=1), right, rtol=1e-9, atol=1e-6)


def test_back_project_keeps_only_matched_pixels_in_image_order():
    disparity_px = np.full(SMALL.shape, np.nan)
    disparity_px[2, 3], disparity_px[9, 1], disparity_px[5, 5] = 1.0, 2.0, 0.0
    points_cam = SMALL.back_project(disparity_px)
    np.testing.assert_allclose(SMALL.project(points_cam), [[3, 2, 1], [1, 9, 2]], atol=1e-12)


def test_back_project_refuses_an_image_of_another_size():
    with pytest.raises(InvalidInputError, match=r"disparity image is \(2, 2\), the camera \(12, 16\)"):
        SMALL.back_project(np.ones((2, 2)))


def test_q_agrees_with_opencv():
    rng = np.random.default_rng(1)
    disparity_px = rng.uniform(0.5, 15, SMALL.shape).astype(np.float32)
    theirs = cv2.reprojectImageTo3D(disparity_px, SMALL.Q)
    np.testing.assert_allclose(SMALL.back_project(disparity_px), theirs.reshape(-1, 3), rtol=1e-5)


@given(cameras)
def test_a_camera_survives_the_way_through_its_projection_matrices(camera):
    back = StereoCamera.from_projections(*camera.P, (camera.width_px, camera.height_px))
    for name, value in vars(camera).items():
        assert getattr(back, name) == pytest.approx(value, rel=1e-9), name


def test_from_projections_reads_a_kitti_calibration():
    """P0 and P1 of KITTI odometry 04 to 12: 0.5372 m of baseline."""
    f, cx, cy = 707.0912, 601.8873, 183.1104
    P0 = [[f, 0, cx, 0], [0, f, cy, 0], [0, 0, 1, 0]]
    P1 = [[f, 0, cx, -379.8145], [0, f, cy, 0], [0, 0, 1, 0]]
    camera = StereoCamera.from_projections(P0, P1, (1226, 370))
    assert camera.baseline_m == pytest.approx(0.53715, abs=1e-5)
    assert (camera.focal_px, camera.cx_px, camera.cy_px) == (f, cx, cy)
    assert (camera.width_px, camera.height_px, camera.shape) == (1226, 370, (370, 1226))
    # KITTI's colour cameras are both shifted from camera 0: only the difference is the baseline.
    P2, P3 = np.array(P0), np.array(P1)
    P2[0, 3], P3[0, 3] = 45.0, 45.0 - 379.8145
    assert StereoCamera.from_projections(P2, P3, (1226, 370)).baseline_m == pytest.approx(camera.baseline_m)


def broken(change):
    P0, P1 = (np.array(P) for P in MINORU.P)
    change(P0, P1)
    return P0, P1


def zero_focal(P0, P1):
    P0[0, 0] = P1[0, 0] = 0


def swapped(P0, P1):
    P0[0, 3], P1[0, 3] = P1[0, 3], P0[0, 3]


def oblong(P0, P1):
    P0[1, 1] = P1[1, 1] = 800


def other_camera(P0, P1):
    P1[0, 0] = 700


def not_finite(P0, P1):
    P1[0, 3] = np.nan


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (zero_focal, r"P\[0, 0\] = 0, not > 0"),
        (swapped, "baseline_m must be positive and finite, not -0.06"),
        (oblong, "pixels are not square"),
        (other_camera, "do not belong to one rectified pair"),
        (not_finite, "the right projection matrix contains NaN"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_projection_matrices_that_are_no_rectified_pair_are_refused_with_the_reason(change, reason):
    with pytest.raises(InvalidInputError, match=reason):
        StereoCamera.from_projections(*broken(change), (640, 480))


def test_projection_matrices_of_the_wrong_shape_are_refused():
    with pytest.raises(InvalidInputError, match=r"left projection matrix must be \(3, 4\), not \(3, 3\)"):
        StereoCamera.from_projections(MINORU.K, MINORU.P[1], (640, 480))


@pytest.mark.parametrize("name", ["focal_px", "baseline_m", "width_px", "height_px"])
@pytest.mark.parametrize("value", [0, -1, np.nan, np.inf])
def test_a_camera_that_cannot_be_is_refused_by_name(name, value):
    with pytest.raises(InvalidInputError, match=f"{name} must be positive and finite"):
        StereoCamera(**{**vars(MINORU), name: value})


@pytest.mark.parametrize("name", ["cx_px", "cy_px"])
def test_a_principal_point_must_be_finite(name):
    with pytest.raises(InvalidInputError, match=f"{name} must be finite"):
        StereoCamera(**{**vars(MINORU), name: np.nan})


def distorted_rig():
    """Two unlike, distorted cameras, 60 mm apart, turned against each other by about 2 degrees."""
    R_right_left = Rotation.from_rotvec([0.01, -0.03, 0.015]).as_matrix()
    K_left = np.array([[520.0, 0, 310], [0, 524, 245], [0, 0, 1]])
    K_right = np.array([[531.0, 0, 330], [0, 528, 235], [0, 0, 1]])
    D_left, D_right = np.array([-0.25, 0.08, 1e-3, -5e-4, 0.0]), np.array([-0.22, 0.05, -8e-4, 9e-4, 0.0])
    T_right_left = from_rotation(R_right_left, R_right_left @ [-0.06, 0.001, -0.002])
    return SimpleNamespace(K=(K_left, K_right), distortion=(D_left, D_right), T_right_left=T_right_left)


@pytest.fixture(scope="module")
def rig():
    return distorted_rig()


@pytest.fixture(scope="module")
def rectification(rig):
    return Rectification.from_calibration(rig.K, rig.distortion, rig.T_right_left, (640, 480))


def look_up(maps, columns, rows):
    """The raw pixel (N, 2) that each rectified pixel (N,) is read from, between map entries too."""
    columns, rows = (np.float32(each).reshape(-1, 1) for each in (columns, rows))
    return np.hstack([cv2.remap(m, columns, rows, cv2.INTER_LINEAR) for m in maps])


def test_rectification_sends_every_point_to_the_pixels_and_disparity_that_the_rectified_camera_predicts(
    rig, rectification
):
    """Points through OpenCV's distorted cameras land where our rectified pair says: rows agree, d = f b / z."""
    rng = np.random.default_rng(2)
    camera = rectification.camera
    p_rect = rng.uniform([-0.5, -0.4, 1], [0.5, 0.4, 1], (500, 3)) * rng.uniform(0.3, 6, (500, 1))
    column, row, disparity = camera.project(p_rect).T
    seen = (column > 1) & (column < 638) & (row > 1) & (row < 478) & (column - disparity > 1)
    assert seen.sum() > 250
    p_left = p_rect @ rectification.R_rect_left
    raw_left = cv2.projectPoints(p_left, np.zeros(3), np.zeros(3), rig.K[0], rig.distortion[0])[0][:, 0]
    p_right = transform(rig.T_right_left, p_left)
    raw_right = cv2.projectPoints(p_right, np.zeros(3), np.zeros(3), rig.K[1], rig.distortion[1])[0][:, 0]
    mapped_left = look_up(rectification.maps_left, column, row)
    mapped_right = look_up(rectification.maps_right, column - disparity, row)
    # cv2.remap itself interpolates in steps of 1/32 px.
    np.testing.assert_allclose(mapped_left[seen], raw_left[seen], atol=0.05)
    np.testing.assert_allclose(mapped_right[seen], raw_right[seen], atol=0.05)


def test_rectification_keeps_the_baseline(rig, rectification):
    assert rectification.camera.baseline_m == pytest.approx(np.linalg.norm(rig.T_right_left[:3, 3]))


def test_rectify_reads_the_raw_images_through_its_maps(rectification):
    """A raw image whose grey value is its column comes out as the columns of the map, inside the image."""
    raw = np.tile(np.arange(640) // 4, (480, 1)).astype(np.uint8)
    left, right = rectification.rectify(raw, raw)
    for image, (columns, _) in ((left, rectification.maps_left), (right, rectification.maps_right)):
        assert image.shape == rectification.camera.shape
        np.testing.assert_allclose(image[5:-5, 5:-5], columns[5:-5, 5:-5] / 4 - 0.375, atol=1.2)


def test_a_pair_that_is_already_rectified_stays_as_it_is():
    still = from_rotation(np.eye(3), [-0.06, 0, 0])
    none = np.zeros(5)
    same = Rectification.from_calibration((MINORU.K, MINORU.K), (none, none), still, (640, 480))
    assert vars(same.camera) == pytest.approx(vars(MINORU))
    np.testing.assert_allclose(same.R_rect_left, np.eye(3), atol=1e-12)
    image = np.random.default_rng(3).integers(0, 256, MINORU.shape, dtype=np.uint8)
    for out in same.rectify(image, image):
        np.testing.assert_array_equal(out, image)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"T_right_left": from_rotation(np.eye(3), [0.06, 0, 0])}, "the right camera is not to the right"),
        ({"T_right_left": from_rotation(np.eye(3), [0, -0.06, 0])}, "the right camera is not to the right"),
        ({"T_right_left": np.eye(4)}, "T_right_left has no translation"),
        ({"T_right_left": np.diag([2.0, 1, 1, 1])}, "T_right_left is not rigid"),
        ({"T_right_left": np.full((4, 4), np.nan)}, "T_right_left contains NaN"),
        ({"K": (np.eye(3), np.eye(4))}, r"the right intrinsics must be \(3, 3\)"),
        ({"K": (np.full((3, 3), np.nan), np.eye(3))}, "the left intrinsics must be"),
        ({"distortion": (np.zeros(3), np.zeros(5))}, "the left distortion must be 4, 5, 8, 12, 14 finite numbers"),
        ({"distortion": (np.zeros(5), np.full(5, np.nan))}, "the right distortion must be"),
    ],
)
def test_a_calibration_that_cannot_be_is_refused_with_the_reason(rig, changes, reason):
    given_rig = {**vars(rig), **changes}
    with pytest.raises(InvalidInputError, match=reason):
        Rectification.from_calibration(*(given_rig[k] for k in ("K", "distortion", "T_right_left")), (640, 480))


@pytest.mark.parametrize("size_px", [(0, 480), (640, 8193), (-640, 480), (10**12, 10**12)])
def test_pictures_of_no_size_or_one_beyond_all_cameras_are_not_rectified(rig, size_px):
    reason = f"pictures of {size_px[0]} x {size_px[1]} px; 1 to 8192 px a side can be rectified"
    with pytest.raises(InvalidInputError, match=reason):
        Rectification.from_calibration(rig.K, rig.distortion, rig.T_right_left, size_px)
    still, none = (np.eye(3),) * 2, (np.zeros(5),) * 2
    for size, raw_shape in ((size_px, None), ((640, 480), size_px[::-1])):
        with pytest.raises(InvalidInputError, match=reason):
            Rectification.from_matrices(rig.K, none, still, MINORU.P, size, raw_shape)


@pytest.mark.parametrize("side", ["left", "right"])
def test_rectify_refuses_an_image_of_another_size_by_side(rectification, side):
    images = {"left": np.zeros((480, 640), np.uint8), "right": np.zeros((480, 640), np.uint8)}
    images[side] = np.zeros((240, 320), np.uint8)
    with pytest.raises(InvalidInputError, match=rf"the {side} image is \(240, 320\), the calibration \(480, 640\)"):
        rectification.rectify(**images)


BOARD = (9, 6)


def find_corners(image):
    """(54, 1, 2) float32, or None where the board is not wholly in view."""
    found, corners = cv2.findChessboardCorners(image, BOARD)
    if not found:
        return None
    precise = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)
    return cv2.cornerSubPix(image, corners.reshape(-1, 1, 2).astype(np.float32), (5, 5), (-1, -1), precise)


@pytest.fixture(scope="module")
def chessboards(real_data):
    """The 13 real pairs: left and right corners, the calibration made from them, and its rectification."""
    folder = real_data("calibration")
    names = [path.name.removeprefix("left") for path in sorted(folder.glob("left[0-9][0-9].jpg"))]
    images = [
        [cv2.imread(str(folder / f"{side}{name}"), cv2.IMREAD_GRAYSCALE) for name in names]
        for side in ("left", "right")
    ]
    corners = [[find_corners(image) for image in each] for each in images]
    board = np.zeros((54, 3), np.float32)
    board[:, :2] = np.indices(BOARD).T.reshape(-1, 2)
    boards, size_px = [board] * len(names), (640, 480)
    single = [cv2.calibrateCamera(boards, each, size_px, None, None)[1:3] for each in corners]
    (K0, D0), (K1, D1) = single
    rms_px, K0, D0, K1, D1, R, t, *_ = cv2.stereoCalibrate(
        boards, *corners, K0, D0, K1, D1, size_px, flags=cv2.CALIB_FIX_INTRINSIC
    )
    T_right_left = from_rotation(R, np.ravel(t))
    rectification = Rectification.from_calibration((K0, K1), (D0, D1), T_right_left, size_px)
    return SimpleNamespace(
        images=images,
        corners=corners,
        K=(K0, K1),
        D=(D0, D1),
        T=T_right_left,
        rms_px=rms_px,
        rectification=rectification,
    )


def rectified_corners(chessboards):
    """Left and right corners (13, 54, 2) of the 13 boards in the rectified images [px]."""
    camera, R_left = chessboards.rectification.camera, chessboards.rectification.R_rect_left
    R_right = R_left @ chessboards.T[:3, :3].T
    for corners, K, D, R in zip(chessboards.corners, chessboards.K, chessboards.D, (R_left, R_right), strict=True):
        ideal = [cv2.undistortPoints(each, K, D, R=R, P=camera.K) for each in corners]
        yield np.reshape(ideal, (-1, 54, 2))


def test_real_chessboards_lie_on_equal_rows_after_rectification(chessboards):
    """Measured before (shared/facts/minoru.md): mean .141, 95 % below .353 px; stereo rms .448 px."""
    left, right = rectified_corners(chessboards)
    assert len(left) == 13
    dy = np.abs(left[..., 1] - right[..., 1])
    assert dy.mean() <= 0.17
    assert np.percentile(dy, 95) <= 0.42
    assert chessboards.rms_px <= 0.55


def test_real_images_rectified_by_the_maps_show_their_corners_on_equal_rows(chessboards):
    dy = []
    for left, right in zip(*chessboards.images, strict=True):
        pair = [find_corners(image) for image in chessboards.rectification.rectify(left, right)]
        if all(corners is not None for corners in pair):
            dy.append(np.abs(pair[0] - pair[1])[..., 1])
    assert len(dy) >= 10
    assert np.mean(dy) <= 0.17


def test_real_chessboards_measured_in_3d_have_square_fields_of_one_size(chessboards):
    """Eqs. 4 to 6 on real corners, in units of a field: neighbours are 1 apart (facts: 1.0014 +- .020)."""
    left, right = rectified_corners(chessboards)
    camera = chessboards.rectification.camera
    disparity = left[..., 0] - right[..., 0]
    ray = np.concatenate(
        [(left - [camera.cx_px, camera.cy_px]) / camera.focal_px, np.ones_like(left[..., :1])], axis=-1
    )
    corners = (ray * camera.depth_m(disparity)[..., None]).reshape(-1, 6, 9, 3)
    edges = np.concatenate([np.linalg.norm(np.diff(corners, axis=axis), axis=-1).ravel() for axis in (1, 2)])
    assert edges.mean() == pytest.approx(1, abs=0.01)
    assert edges.std() <= 0.025


def test_raw_images_may_be_larger_than_rectified_ones_and_no_others_are_taken():
    K = MINORU.K + np.outer([20, 12, 0], [0, 0, 1])
    raw = np.random.default_rng(0).integers(0, 256, (510, 690), dtype=np.uint8)
    none, still = np.zeros(4), np.eye(3)
    made = Rectification.from_matrices((K, K), (none, none), (still, still), MINORU.P, (640, 480), raw.shape)
    assert made.camera == MINORU
    for out in made.rectify(raw, raw):
        np.testing.assert_array_equal(out, raw[12:492, 20:660])
    with pytest.raises(InvalidInputError, match=r"the left image is \(480, 640\), the calibration \(510, 690\)"):
        made.rectify(*made.rectify(raw, raw))
