"""From pictures of a chessboard to a calibration."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_floats, from_rotation, inverse
from ..observation import Image
from .chessboard import Chessboard
from .residuals import far_pairs, pair_rms_px, residuals, stereo_off_px
from .rig import MAX_RMS_PX, StereoCalibration, misfit
from .views import MIN_PAIRS, BoardViews, check_enough, find_views

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
    named = zip(names or [f"pair {n}" for n in range(1, len(pairs) + 1)], pairs, strict=True)
    return calibrate_views(find_views(named, board))


def calibrate_corners(
    corners_left: ArrayLike,
    corners_right: ArrayLike,
    board: Chessboard,
    size_px: tuple[int, int],
    left_out: tuple[str, ...] = (),
) -> StereoCalibration:
    """The same from the corners (M, N, 2) of M pairs [px], N in the order of `Chessboard.corners_m`."""
    left, right = as_floats(corners_left), as_floats(corners_right)
    if left.shape != right.shape or left.ndim != 3 or left.shape[1:] != (len(board.corners_m), 2):
        raise InvalidInputError(
            f"expected corners (M, {len(board.corners_m)}, 2) of both cameras, not {left.shape} and {right.shape}"
        )
    if len(left) < MIN_PAIRS:
        raise InvalidInputError(f"{len(left)} pairs are too few to calibrate from: {MIN_PAIRS} are needed")
    names = tuple(f"pair {n}" for n in range(1, len(left) + 1))
    return calibrate_views(BoardViews(board, size_px, names, (left, right), left_out))


def calibrate_views(views: BoardViews) -> StereoCalibration:
    """The same from the views that find_views found. Where pairs that are far off spoil it, the error names them."""
    check_enough(views)
    left, right = views.corners[0].astype(np.float32), views.corners[1].astype(np.float32)
    boards = [views.board.corners_m.astype(np.float32)] * len(left)
    try:
        alone = [_one_camera(boards, list(corners), views.size_px) for corners in (left, right)]
        # Copies, since OpenCV writes into what it is given.
        K0, D0, K1, D1 = (array.copy() for each in alone for array in (each.K, each.distortion))
        rms_px, K0, D0, K1, D1, R, t_m, *_ = cv2.stereoCalibrate(
            boards, list(left), list(right), K0, D0, K1, D1, views.size_px,
            flags=cv2.CALIB_USE_INTRINSIC_GUESS | MODEL, criteria=CRITERIA,
        )  # fmt: skip
    except cv2.error as error:
        raise InvalidInputError(
            f"the corners do not determine the cameras: tilt the board in more ways ({error.err})"
        ) from error
    if not rms_px <= MAX_RMS_PX:
        raise misfit(rms_px, tuple(_odd_pairs(views, alone).values()))
    found = StereoCalibration((K0, K1), (D0.ravel(), D1.ravel()), from_rotation(R, t_m.ravel()), views.size_px)
    errors = residuals(found, views.corners, views.board).errors((alone[0].rms_px, alone[1].rms_px))
    return replace(found, errors=errors, n_pairs=len(views.names), left_out=views.left_out)


def without_far_pairs(views: BoardViews) -> BoardViews:
    """The views without the pairs that are far worse than the others, which become left_out. Needs some to be left."""
    for _ in range(len(views.names)):
        check_enough(views)
        try:
            found = calibrate_views(views)
        except InvalidInputError:
            far = _odd_pairs(views)
        else:
            far = far_pairs(views.names, residuals(found, views.corners, views.board).rms_px)
        if not far:
            break
        views = views.without(far, far.values())
    return views


@dataclass(frozen=True, eq=False)
class _Alone:
    """One camera's own calibration; poses: T_cam_board (4, 4) of each view."""

    rms_px: float
    K: FloatArray
    distortion: FloatArray
    poses: list[FloatArray]


def _one_camera(boards: Sequence[Array], corners: Sequence[Array], size_px: tuple[int, int]) -> _Alone:
    _, K, D, turns, shifts, *_ = cv2.calibrateCamera(
        boards, corners, size_px, None, None, flags=MODEL, criteria=CRITERIA
    )
    expected = [
        cv2.projectPoints(b, r, t, K, D)[0].reshape(-1, 2) for b, r, t in zip(boards, turns, shifts, strict=True)
    ]
    poses = [
        from_rotation(Rotation.from_rotvec(turn.ravel()).as_matrix(), shift.ravel())
        for turn, shift in zip(turns, shifts, strict=True)
    ]
    return _Alone(_rms(np.stack(expected) - np.stack(corners)), K, D, poses)


def _rms(off_px: FloatArray) -> float:
    """Root of the mean squared length of vectors (..., 2)."""
    return float(np.sqrt((off_px**2).sum(axis=-1).mean()))


def _odd_pairs(views: BoardViews, alone: Sequence[_Alone] | None = None) -> dict[str, str]:
    """The pairs that contradict the others, found without a fit that they would spoil: far_pairs of the rig that most
    pairs agree with, among those that one pair each tells of."""
    if alone is None:
        boards = [views.board.corners_m.astype(np.float32)] * len(views.names)
        alone = [_one_camera(boards, list(each.astype(np.float32)), views.size_px) for each in views.corners]
    left, right = alone
    best: FloatArray | None = None
    for T_left_board, T_right_board in zip(left.poses, right.poses, strict=True):
        T_right_left = T_right_board @ inverse(T_left_board)
        off_px = stereo_off_px(
            (left.K, right.K), (left.distortion, right.distortion), T_right_left, views.corners, views.board
        )
        rms_px = pair_rms_px(off_px)
        if best is None or np.median(rms_px) < np.median(best):
            best = rms_px
    return {} if best is None else far_pairs(views.names, best)
