"""From pictures of a chessboard to a calibration."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_floats, from_rotation
from ..observation import Image
from .chessboard import Chessboard, find_corners
from .rig import MAX_RMS_PX, CalibrationErrors, StereoCalibration, misfit

MIN_PAIRS = 5
"""Fewer views of a plane leave focal length and distortion open."""
MODEL = cv2.CALIB_FIX_K3
"""k1, k2, p1, p2: a third radial term follows the noise of the corners and runs away where no board was seen."""
CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)


def calibrate_stereo(
    pairs: Sequence[tuple[Image, Image]], board: Chessboard, names: Sequence[str] | None = None
) -> StereoCalibration:
    """Calibrate from raw pictures (H, W) uint8 of a board, (left, right) of the same moments.

    names: of the pairs, for messages; by default their numbers. A pair in which the board is not found on both sides
    is left out, and named in `left_out`. Raises InvalidInputError when the sizes differ, too few pairs are left, or
    the result is none that two cameras side by side can have.
    """
    named = list(zip(names or [f"pair {n}" for n in range(1, len(pairs) + 1)], pairs, strict=True))
    size_px = _common_size(named)
    corners: list[tuple[FloatArray, FloatArray]] = []
    left_out: list[str] = []
    for name, pair in named:
        left, right = (find_corners(image, board) for image in pair)
        if left is None or right is None:
            missing = " and the ".join(side for side, found in (("left", left), ("right", right)) if found is None)
            left_out.append(f"{name}: no board of {board} in the {missing} image")
        else:
            corners.append((left, right))
    if len(corners) < MIN_PAIRS:
        raise InvalidInputError(
            "; ".join([f"only {len(corners)} of {len(pairs)} pairs can be used, {MIN_PAIRS} are needed", *left_out])
        )
    left_corners, right_corners = (np.stack(each) for each in zip(*corners, strict=True))
    return calibrate_corners(left_corners, right_corners, board, size_px, tuple(left_out))


def calibrate_corners(
    corners_left: ArrayLike,
    corners_right: ArrayLike,
    board: Chessboard,
    size_px: tuple[int, int],
    left_out: tuple[str, ...] = (),
) -> StereoCalibration:
    """The same from the corners (M, N, 2) of M pairs [px], N in the order of `Chessboard.corners_m`."""
    both = as_floats(corners_left).astype(np.float32), as_floats(corners_right).astype(np.float32)
    if both[0].shape != both[1].shape or both[0].ndim != 3 or both[0].shape[1:] != (len(board.corners_m), 2):
        raise InvalidInputError(
            f"expected corners (M, {len(board.corners_m)}, 2) of both cameras, not {both[0].shape} and {both[1].shape}"
        )
    if len(both[0]) < MIN_PAIRS:
        raise InvalidInputError(f"{len(both[0])} pairs are too few to calibrate from: {MIN_PAIRS} are needed")
    boards = [board.corners_m.astype(np.float32)] * len(both[0])
    try:
        alone = [_one_camera(boards, list(corners), size_px) for corners in both]
        (_, K0, D0), (_, K1, D1) = alone
        rms_px, K0, D0, K1, D1, R, t_m, *_ = cv2.stereoCalibrate(
            boards, list(both[0]), list(both[1]), K0, D0, K1, D1, size_px,
            flags=cv2.CALIB_USE_INTRINSIC_GUESS | MODEL, criteria=CRITERIA,
        )  # fmt: skip
    except cv2.error as error:
        raise InvalidInputError(
            f"the corners do not determine the cameras: tilt the board in more ways ({error.err})"
        ) from error
    if not rms_px <= MAX_RMS_PX:
        raise misfit(rms_px)
    found = StereoCalibration((K0, K1), (D0.ravel(), D1.ravel()), from_rotation(R, t_m.ravel()), size_px)
    errors = _errors(found, both, board, (alone[0][0], alone[1][0]))
    return replace(found, errors=errors, n_pairs=len(both[0]), left_out=left_out)


def _one_camera(
    boards: Sequence[Array], corners: Sequence[Array], size_px: tuple[int, int]
) -> tuple[float, FloatArray, FloatArray]:
    """rms [px], K (3, 3) and distortion of one camera alone."""
    _, K, D, turns, shifts, *_ = cv2.calibrateCamera(
        boards, corners, size_px, None, None, flags=MODEL, criteria=CRITERIA
    )
    expected = [
        cv2.projectPoints(b, r, t, K, D)[0].reshape(-1, 2) for b, r, t in zip(boards, turns, shifts, strict=True)
    ]
    return _rms(np.stack(expected) - np.stack(corners)), K, D


def _rms(off_px: FloatArray) -> float:
    """Root of the mean squared length of vectors (..., 2)."""
    return float(np.sqrt((off_px**2).sum(axis=-1).mean()))


def _errors(
    calibration: StereoCalibration, corners: tuple[Array, Array], board: Chessboard, rms_px: tuple[float, float]
) -> CalibrationErrors:
    left, right = calibration.rectified_points(*corners)
    rows_px = np.abs(left[:, 1] - right[:, 1])
    disparity_px = left[:, 0] - right[:, 0]
    camera = calibration.rectification().camera
    depth_m = camera.depth_m(np.where(disparity_px > 0, disparity_px, np.nan))
    points_m = np.column_stack([(left - [camera.cx_px, camera.cy_px]) / camera.focal_px, np.ones(len(left))])
    grid_m = (points_m * depth_m[:, None]).reshape(-1, board.rows, board.columns, 3)
    edges = [np.linalg.norm(np.diff(grid_m, axis=a), axis=-1).ravel() / board.square_m for a in (1, 2)]
    edge = np.concatenate(edges)
    return CalibrationErrors(
        rms_px=rms_px,
        stereo_rms_px=_stereo_rms(calibration, corners, board),
        epipolar_mean_px=float(rows_px.mean()),
        epipolar_p95_px=float(np.percentile(rows_px, 95)),
        square_edge_mean=float(edge.mean()),
        square_edge_sd=float(edge.std()),
    )


def _stereo_rms(calibration: StereoCalibration, corners: tuple[Array, Array], board: Chessboard) -> float:
    """rms [px] of the corners of both cameras, when the right one sees each board where the left one found it."""
    (K0, K1), (D0, D1), T = calibration.K, calibration.distortion, calibration.T_right_left
    off_px = []
    for left, right in zip(*corners, strict=True):
        _, turn, shift = cv2.solvePnP(board.corners_m, left, K0, D0)
        T_left_board = from_rotation(Rotation.from_rotvec(turn.ravel()).as_matrix(), shift.ravel())
        T_right_board = T @ T_left_board
        seen = cv2.projectPoints(board.corners_m, turn, shift, K0, D0)[0].reshape(-1, 2)
        turn_right = Rotation.from_matrix(T_right_board[:3, :3]).as_rotvec()
        seen_right = cv2.projectPoints(board.corners_m, turn_right, T_right_board[:3, 3], K1, D1)[0].reshape(-1, 2)
        off_px.append(np.stack([seen - left, seen_right - right]))
    return _rms(np.stack(off_px))


def _common_size(named: Sequence[tuple[str, tuple[Image, Image]]]) -> tuple[int, int]:
    """(width, height) of all images."""
    if not named:
        raise InvalidInputError("there are no pairs to calibrate from")
    first_name, (first, _) = named[0]
    for name, pair in named:
        for side, image in zip(("left", "right"), pair, strict=True):
            if image.ndim != 2 or image.dtype != np.uint8:
                raise InvalidInputError(
                    f"{name}: the {side} image must be (H, W) uint8, not {image.shape} {image.dtype}"
                )
            if image.shape != first.shape:
                (h, w), (h0, w0) = image.shape, first.shape
                raise InvalidInputError(
                    f"{name}: the {side} image is {w}x{h} px, the left one of {first_name} {w0}x{h0}"
                )
    return first.shape[1], first.shape[0]
