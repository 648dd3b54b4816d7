"""What a calibration of two cameras holds, and what no two cameras side by side can have."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import ArrayLike

from ..camera import Rectification
from ..errors import InvalidInputError
from ..geometry import FloatArray, as_floats, as_pose, from_rotation, rotation_angle_rad

Both = tuple[FloatArray, FloatArray]
"""Something of the left and of the right camera."""

MAX_RMS_PX = 2.0
FIELD_OF_VIEW_DEG = (10.0, 150.0)
MAX_ASPECT = 0.05
MAX_RECTIFYING_TURN_DEG = 20.0
"""A rig whose pictures have to be turned further has no two cameras side by side: the calibration is wrong."""
BASELINE_M = (0.005, 2.0)
"""Who gives the chessboard's squares in millimetres gets a baseline that no robot carries."""


@dataclass(frozen=True)
class CalibrationErrors:
    """How well the corners agree with the calibration.

    rms_px: of the distance of corners from where each camera alone expects them, left and right; stereo_rms_px: the
    same for the pair. epipolar_mean_px, epipolar_p95_px: of |row difference| of rectified corners. square_edge_mean,
    square_edge_sd: measured edges of the squares over their true length.
    """

    rms_px: tuple[float, float]
    stereo_rms_px: float
    epipolar_mean_px: float
    epipolar_p95_px: float
    square_edge_mean: float
    square_edge_sd: float

    def __post_init__(self) -> None:
        if len(self.rms_px) != 2:
            raise InvalidInputError(f"rms_px must be of the left and the right camera, not {self.rms_px}")
        for name, value in vars(self).items():
            if not (np.isfinite(value).all() and np.min(value) >= 0):
                raise InvalidInputError(f"{name} must be finite and >= 0, not {value}")


@dataclass(frozen=True)
class StereoCalibration:
    """A raw pair of cameras. Made only of numbers that a rig of two cameras side by side can have.

    K: (left, right) intrinsics (3, 3) [px]; distortion: (left, right) as OpenCV orders it; T_right_left (4, 4);
    size_px (width, height). errors and n_pairs: of the corners it was made from; left_out: what was not used, and why.
    Raises InvalidInputError, with the reason, for numbers that no such rig has.
    """

    K: Both
    distortion: Both
    T_right_left: FloatArray
    size_px: tuple[int, int]
    errors: CalibrationErrors | None = None
    n_pairs: int = 0
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_right_left", as_pose(self.T_right_left, "T_right_left"))
        for side, K in zip(("left", "right"), self.K, strict=True):
            _check_intrinsics(as_floats(K), self.size_px, side)
        _check_side_by_side(self.T_right_left)
        # Rectification checks the numbers one by one.
        rectified_px = self._rectification.camera.focal_px
        for side, K, distortion in zip(("left", "right"), self.K, self.distortion, strict=True):
            _check_distortion(as_floats(K), as_floats(distortion), self.size_px, side)
        check_rectifying_turn(self._rectification.R_rect_left)
        focal_px = self.K[0][0, 0]
        if not 0.5 < rectified_px / focal_px < 2.0:
            raise InvalidInputError(
                f"rectifying would turn a focal length of {focal_px:.0f} px into {rectified_px:.0f} px: "
                "the distortion or the rotation between the cameras is wrong"
            )
        if self.errors is not None and not self.errors.stereo_rms_px <= MAX_RMS_PX:
            raise misfit(self.errors.stereo_rms_px)

    @property
    def baseline_m(self) -> float:
        """Distance of the two cameras [m]."""
        return float(np.linalg.norm(self.T_right_left[:3, 3]))

    def rectification(self) -> Rectification:
        """What makes rectified pairs of raw ones."""
        return self._rectification

    @cached_property
    def _rectification(self) -> Rectification:
        return Rectification.from_calibration(self.K, self.distortion, self.T_right_left, self.size_px)

    def rectified_points(self, corners_left: ArrayLike, corners_right: ArrayLike) -> Both:
        """Raw corners (..., 2) of both images [px] as points (N, 2) of the rectified images [px]."""
        R0 = self._rectification.R_rect_left
        rotations = R0, R0 @ self.T_right_left[:3, :3].T
        P = self._rectification.camera.K
        left, right = (
            cv2.undistortPoints(as_floats(corners).reshape(-1, 1, 2), K, D, R=R, P=P).reshape(-1, 2)
            for corners, K, D, R in zip((corners_left, corners_right), self.K, self.distortion, rotations, strict=True)
        )
        return left, right


def check_rectifying_turn(R_rect_left: FloatArray) -> None:
    """Raise InvalidInputError for a rotation (3, 3) that rectifies no pair of cameras side by side."""
    turn_deg = np.rad2deg(rotation_angle_rad(from_rotation(R_rect_left)))
    if turn_deg > MAX_RECTIFYING_TURN_DEG:
        raise InvalidInputError(
            f"rectifying would turn the left picture by {turn_deg:.0f} degrees, more than "
            f"{MAX_RECTIFYING_TURN_DEG:g}: these are not two cameras side by side"
        )


def _check_intrinsics(K: FloatArray, size_px: tuple[int, int], side: str) -> None:
    if K.shape != (3, 3) or not np.isfinite(K).all():
        raise InvalidInputError(f"the {side} intrinsics must be (3, 3) and finite, not {K.tolist()}")
    if not np.array_equal([K[1, 0], *K[2]], [0, 0, 0, 1]):
        raise InvalidInputError(
            f"the {side} intrinsics must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]], not {K.tolist()}"
        )
    width, height = size_px
    low, high = (0.5 * width / np.tan(np.deg2rad(angle) / 2) for angle in FIELD_OF_VIEW_DEG[::-1])
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
    if not low <= fx <= high:
        raise InvalidInputError(
            f"the {side} focal length is {fx:.0f} px, for {width} px of width expected {low:.0f} to {high:.0f}"
        )
    if abs(fy / fx - 1) > MAX_ASPECT:
        raise InvalidInputError(f"the {side} pixels are not square: focal lengths {fx:.1f} and {fy:.1f} px")
    if not (width / 4 <= cx <= 3 * width / 4 and height / 4 <= cy <= 3 * height / 4):
        raise InvalidInputError(f"the {side} principal point ({cx:.0f}, {cy:.0f}) is far from the image's middle")


def _check_distortion(K: FloatArray, distortion: FloatArray, size_px: tuple[int, int], side: str) -> None:
    """The radial terms must spread the picture as far as its corners; where they fold it back, OpenCV is silent."""
    corners = np.array([[x, y, 1.0] for x in (0, size_px[0] - 1) for y in (0, size_px[1] - 1)])
    reach = np.linalg.norm((corners @ np.linalg.inv(K).T)[:, :2], axis=1).max()
    k1, k2, k3, k4, k5, k6 = np.pad(np.delete(distortion.ravel(), [2, 3]), (0, 6))[:6]
    r2 = np.linspace(0, 3 * reach, 300) ** 2
    distorted = np.sqrt(r2) * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    folds = np.append(np.nonzero(np.diff(distorted) <= 0)[0], len(r2) - 1)[0]
    if not distorted[folds] >= reach:
        numbers = ", ".join(f"{number:.4g}" for number in distortion.ravel())
        raise InvalidInputError(
            f"the {side} distortion {numbers} folds the picture back on itself before its corners; pairs with the "
            "board nearer to them would tell it better"
        )


def misfit(rms_px: float, far: tuple[str, ...] = ()) -> InvalidInputError:
    """The error for corners that no calibration explains; far: a line for each pair that is far off."""
    return InvalidInputError(
        f"the corners do not fit: rms {rms_px:.2f} px, more than {MAX_RMS_PX:g} px; is the board flat, and are the "
        f"left and the right pictures of the same moments? {'; '.join(far)}".rstrip()
    )


def _check_side_by_side(T_right_left: FloatArray) -> None:
    """The left camera stands at -x of the right one, with its axis nearly parallel."""
    x, y, z = T_right_left[:3, 3]
    if x >= 0:
        raise InvalidInputError(
            f"the right camera is not to the right: baseline {-x * 1000:.1f} mm; are left and right swapped?"
        )
    low, high = BASELINE_M
    if not low <= -x <= high:
        raise InvalidInputError(
            f"the baseline is {-x * 1000:.6g} mm, for two cameras of one robot expected {low * 1000:g} to "
            f"{high * 1000:g}; is the side of the board's squares given in metres?"
        )
    if np.hypot(y, z) > -x * np.tan(np.deg2rad(MAX_RECTIFYING_TURN_DEG)):
        raise InvalidInputError(
            f"the right camera is not beside the left one: it stands at x {-x * 1000:.1f}, y {-y * 1000:.1f}, "
            f"z {-z * 1000:.1f} mm"
        )
