"""How far corners are from where a calibration expects them, and which pairs are far worse than the others."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InvalidInputError
from ..geometry import FloatArray, from_rotation
from .chessboard import Chessboard
from .rig import Both, CalibrationErrors, StereoCalibration

FAR = 3.0
"""A pair is far off when its rms is over this many times the median of all pairs' ..."""
FAR_AT_LEAST_PX = 0.5
"""... and more than this."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """off_px (left, right): (M, N, 2) each, expected - seen, when the right camera sees each board where the left one
    found it. rows_px (M, N): rows of rectified corners, left - right. edges (M, K): measured edges of the squares over
    their true length."""

    off_px: Both
    rows_px: FloatArray
    edges: FloatArray

    @property
    def rms_px(self) -> FloatArray:
        """(M,) of each pair, both pictures together."""
        return pair_rms_px(self.off_px)

    def errors(self, rms_px: tuple[float, float]) -> CalibrationErrors:
        """The sum of it; rms_px of each camera alone."""
        rows_px = np.abs(self.rows_px)
        return CalibrationErrors(
            rms_px=rms_px,
            stereo_rms_px=float(np.sqrt((self.rms_px**2).mean())),
            epipolar_mean_px=float(rows_px.mean()),
            epipolar_p95_px=float(np.percentile(rows_px, 95)),
            square_edge_mean=float(self.edges.mean()),
            square_edge_sd=float(self.edges.std()),
        )


def residuals(calibration: StereoCalibration, corners: Both, board: Chessboard) -> Residuals:
    """Of corners (left, right), (M, N, 2) each [px], N in the order of `Chessboard.corners_m`."""
    off_px = stereo_off_px(calibration.K, calibration.distortion, calibration.T_right_left, corners, board)
    left, right = calibration.rectified_points(*corners)
    m, n, _ = corners[0].shape
    camera = calibration.rectification().camera
    disparity_px = left[:, 0] - right[:, 0]
    if not (disparity_px > 0).all():
        raise InvalidInputError("the corners do not fit: some lie behind the cameras; are left and right swapped?")
    points = np.column_stack([(left - [camera.cx_px, camera.cy_px]) / camera.focal_px, np.ones(m * n)])
    grid_m = (points * camera.depth_m(disparity_px)[:, None]).reshape(m, board.rows, board.columns, 3)
    edges = [(np.linalg.norm(np.diff(grid_m, axis=a), axis=-1) / board.square_m).reshape(m, -1) for a in (1, 2)]
    return Residuals(off_px, (left[:, 1] - right[:, 1]).reshape(m, n), np.concatenate(edges, axis=1))


def stereo_off_px(K: Both, distortion: Both, T_right_left: FloatArray, corners: Both, board: Chessboard) -> Both:
    """Residuals.off_px of a rig that need not be a possible one."""
    off_px: tuple[list[FloatArray], list[FloatArray]] = [], []
    for left, right in zip(*corners, strict=True):
        T_left_board = board_pose(K[0], distortion[0], left, board)
        for side, (seen, T) in enumerate(((left, T_left_board), (right, T_right_left @ T_left_board))):
            turn = Rotation.from_matrix(T[:3, :3]).as_rotvec()
            expected = cv2.projectPoints(board.corners_m, turn, T[:3, 3], K[side], distortion[side])[0]
            off_px[side].append(expected.reshape(-1, 2) - seen)
    return np.stack(off_px[0]), np.stack(off_px[1])


def pair_rms_px(off_px: Both) -> FloatArray:
    """(M,): root of the mean squared length of Residuals.off_px, both pictures of a pair together."""
    rms_px: FloatArray = np.sqrt(np.mean([(off**2).sum(axis=-1) for off in off_px], axis=(0, 2)))
    return rms_px


def board_pose(K: FloatArray, distortion: FloatArray, corners: FloatArray, board: Chessboard) -> FloatArray:
    """T_cam_board (4, 4) of the board whose corners (N, 2) [px] a camera sees."""
    _, turn, shift = cv2.solvePnP(board.corners_m, corners, K, distortion)
    return from_rotation(Rotation.from_rotvec(turn.ravel()).as_matrix(), shift.ravel())


def far_pairs(names: Sequence[str], rms_px: FloatArray) -> dict[str, str]:
    """Those of the pairs, (M,), that are far worse than the others, and by how much: a line for each."""
    median = float(np.median(rms_px))
    return {
        name: f"{name}: its corners are off by {rms:.2f} px rms, {rms / max(median, 0.01):.0f} times as far as usual"
        for name, rms in zip(names, rms_px, strict=True)
        if rms > max(FAR * median, FAR_AT_LEAST_PX)
    }
