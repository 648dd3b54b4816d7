"""The rectified stereo pair, and how a real, distorted pair becomes one."""

from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InvalidInputError
from .geometry import FloatArray, as_floats, as_pose, from_rotation

SIDES = ("left", "right")
DISTORTION_SIZES = (4, 5, 8, 12, 14)
"""How many coefficients OpenCV's pinhole distortion may have."""
MOST_PX = 8192
"""Of the width and height of pictures that are rectified: maps of as many pixels are made for it."""


@dataclass(frozen=True)
class StereoCamera:
    """A rectified pair of identical pinhole cameras; the frame `cam` is the left one's.

    focal_px, cx_px, cy_px [px]; baseline_m > 0 [m], the right camera's place on +x; width_px, height_px.
    Pixel centres are at integers.
    """

    focal_px: float
    cx_px: float
    cy_px: float
    baseline_m: float
    width_px: int
    height_px: int

    def __post_init__(self) -> None:
        for name in ("width_px", "height_px", "focal_px", "baseline_m"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InvalidInputError(f"{name} must be positive and finite, not {value}")
        for name in ("cx_px", "cy_px"):
            if not np.isfinite(getattr(self, name)):
                raise InvalidInputError(f"{name} must be finite, not {getattr(self, name)}")

    def __repr__(self) -> str:
        return (
            f"StereoCamera({self.width_px} x {self.height_px} px, focal {self.focal_px:.2f} px, centre "
            f"({self.cx_px:.2f}, {self.cy_px:.2f}) px, baseline {self.baseline_m:.4f} m)"
        )

    @classmethod
    def from_projections(cls, P_left: ArrayLike, P_right: ArrayLike, size_px: tuple[int, int]) -> "StereoCamera":
        """From the two (3, 4) projection matrices of a rectified pair (KITTI, ROS CameraInfo.p).

        size_px is (width, height). The right matrix holds -focal * baseline in its fourth column.
        """
        P0, P1 = (_projection(P, side) for P, side in ((P_left, "left"), (P_right, "right")))
        if P0[0, 0] <= 0:
            raise InvalidInputError(f"the left projection matrix has the focal length P[0, 0] = {P0[0, 0]:g}, not > 0")
        if not np.allclose(P0[:, :3], P1[:, :3], atol=1e-3):
            raise InvalidInputError("the projection matrices do not belong to one rectified pair: P[:, :3] differ")
        if not np.isclose(P0[0, 0], P0[1, 1], rtol=1e-6):
            raise InvalidInputError(f"pixels are not square after rectification: {P0[0, 0]} and {P0[1, 1]}")
        baseline_m = float((P0[0, 3] - P1[0, 3]) / P0[0, 0])
        width_px, height_px = size_px
        return cls(float(P0[0, 0]), float(P0[0, 2]), float(P0[1, 2]), baseline_m, width_px, height_px)

    @property
    def K(self) -> FloatArray:
        """Intrinsic matrix (3, 3) [px]."""
        return np.array([[self.focal_px, 0, self.cx_px], [0, self.focal_px, self.cy_px], [0, 0, 1.0]])

    @property
    def P(self) -> tuple[FloatArray, FloatArray]:
        """Projection matrices (3, 4) of the left and the right camera from points in cam [m] to pixels."""
        left = np.hstack([self.K, np.zeros((3, 1))])
        right = left.copy()
        right[0, 3] = -self.focal_px * self.baseline_m
        return left, right

    @property
    def Q(self) -> FloatArray:
        """(4, 4): Q @ (x, y, disparity, 1) are homogeneous points in cam [m]; as cv2.reprojectImageTo3D takes it."""
        Q = np.zeros((4, 4))
        Q[0, 0] = Q[1, 1] = 1
        Q[:3, 3] = -self.cx_px, -self.cy_px, self.focal_px
        Q[3, 2] = 1 / self.baseline_m
        return Q

    @property
    def focal_baseline_px_m(self) -> float:
        """focal * baseline [px m]: depth is this over disparity (Eq. 4)."""
        return self.focal_px * self.baseline_m

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width), as NumPy counts."""
        return self.height_px, self.width_px

    @cached_property
    def ray_directions(self) -> FloatArray:
        """(H, W, 3): the point at depth 1 on each pixel's ray, in cam; its norm is range / depth (Eqs. 9, 10)."""
        x, y = np.meshgrid(np.arange(self.width_px), np.arange(self.height_px))
        return np.stack(
            [(x - self.cx_px) / self.focal_px, (y - self.cy_px) / self.focal_px, np.ones(self.shape)], axis=-1
        )

    def depth_m(self, disparity_px: ArrayLike) -> FloatArray:
        """Depth z [m] of disparities [px], any shape. Eq. 4, with d = x_left - x_right > 0."""
        depth: FloatArray = self.focal_baseline_px_m / as_floats(disparity_px)
        return depth

    def disparity_px(self, depth_m: ArrayLike) -> FloatArray:
        """Disparity [px] of depths [m], any shape: Eq. 4 the other way."""
        return self.depth_m(depth_m)

    def project(self, points_cam: ArrayLike) -> FloatArray:
        """(N, 3): column, row of the left image and disparity [px] of points (N, 3) in cam with z > 0 [m]."""
        points = as_floats(points_cam)
        z = points[:, 2]
        column = self.focal_px * points[:, 0] / z + self.cx_px
        row = self.focal_px * points[:, 1] / z + self.cy_px
        return np.stack([column, row, self.focal_baseline_px_m / z], axis=1)

    def back_project(self, disparity_px: ArrayLike) -> FloatArray:
        """Points (N, 3) in cam of the N valid pixels of a disparity image (H, W) [m]. Eqs. 4 to 6."""
        d = as_floats(disparity_px)
        if d.shape != self.shape:
            raise InvalidInputError(f"the disparity image is {d.shape}, the camera {self.shape}")
        valid = d > 0
        points: FloatArray = self.ray_directions[valid] * self.depth_m(d[valid])[:, None]
        return points


def _projection(P: ArrayLike, side: str) -> FloatArray:
    matrix = as_floats(P)
    if matrix.shape != (3, 4):
        raise InvalidInputError(f"the {side} projection matrix must be (3, 4), not {matrix.shape}")
    if not np.isfinite(matrix).all():
        raise InvalidInputError(f"the {side} projection matrix contains NaN or infinity")
    return matrix


def _intrinsics(K: ArrayLike, distortion: ArrayLike, side: str) -> tuple[FloatArray, FloatArray]:
    matrix, coefficients = as_floats(K), as_floats(distortion).reshape(-1, 1)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise InvalidInputError(f"the {side} intrinsics must be (3, 3) and finite, not {matrix.shape}")
    if coefficients.size not in DISTORTION_SIZES or not np.isfinite(coefficients).all():
        raise InvalidInputError(
            f"the {side} distortion must be {', '.join(map(str, DISTORTION_SIZES))} finite numbers as OpenCV "
            f"orders them, not {coefficients.ravel().tolist()}"
        )
    return matrix, coefficients


def _rotation(R: ArrayLike, side: str) -> FloatArray:
    matrix = as_floats(R)
    if matrix.shape != (3, 3):
        raise InvalidInputError(f"the {side} R must be (3, 3), not {matrix.shape}")
    return as_pose(from_rotation(matrix), f"the {side} R")[:3, :3]


def _check_size(size_px: tuple[int, int]) -> None:
    if not all(0 < each <= MOST_PX for each in size_px):
        raise InvalidInputError(
            f"pictures of {size_px[0]} x {size_px[1]} px; 1 to {MOST_PX} px a side can be rectified"
        )


@dataclass(frozen=True)
class RigMatrices:
    """What ROS calls K (3, 3), D, R (3, 3) and P (3, 4) of the (left, right) camera, whose pictures are of size_px."""

    K: tuple[FloatArray, FloatArray]
    distortion: tuple[FloatArray, FloatArray]
    R: tuple[FloatArray, FloatArray]
    P: tuple[FloatArray, FloatArray]
    size_px: tuple[int, int]


@dataclass(frozen=True)
class Rectification:
    """Maps a raw, distorted pair to a rectified one.

    camera: the rectified pair. R_rect_left (3, 3): p_rect = R_rect_left @ p_left for the raw left optical frame.
    matrices: what it was made from; they are of the raw pictures.
    """

    camera: StereoCamera
    R_rect_left: FloatArray
    maps_left: tuple[NDArray[np.float32], NDArray[np.float32]] = field(repr=False)
    maps_right: tuple[NDArray[np.float32], NDArray[np.float32]] = field(repr=False)
    matrices: RigMatrices

    @classmethod
    def from_calibration(
        cls,
        K: tuple[ArrayLike, ArrayLike],
        distortion: tuple[ArrayLike, ArrayLike],
        T_right_left: FloatArray,
        size_px: tuple[int, int],
    ) -> "Rectification":
        """From (left, right) intrinsics (3, 3), OpenCV distortions, T_right_left (4, 4) and (width, height).

        Invalid pixels are cropped away (alpha = 0). Raises InvalidInputError when a number is missing, the right
        camera is not to the right of the left one, or pictures are of no size up to MOST_PX.
        """
        _check_size(size_px)
        (K0, D0), (K1, D1) = (_intrinsics(*each) for each in zip(K, distortion, SIDES, strict=True))
        T = as_pose(T_right_left, "T_right_left")
        if not T[:3, 3].any():
            raise InvalidInputError("the two cameras stand at one place: T_right_left has no translation")
        # OpenCV 5 wants the translation as (3, 1), not (3,).
        R_right_left, t_m = np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3:4])
        R0, R1, P0, P1, *_ = cv2.stereoRectify(K0, D0, K1, D1, size_px, R_right_left, t_m, alpha=0)
        if P1[0, 3] >= 0:
            raise InvalidInputError(f"the right camera is not to the right: baseline {-P1[0, 3] / P1[0, 0]:.4f} m")
        return cls.from_matrices((K0, K1), (D0, D1), (R0, R1), (P0, P1), size_px)

    @classmethod
    def from_matrices(
        cls,
        K: tuple[ArrayLike, ArrayLike],
        distortion: tuple[ArrayLike, ArrayLike],
        R: tuple[ArrayLike, ArrayLike],
        P: tuple[ArrayLike, ArrayLike],
        size_px: tuple[int, int],
        raw_shape: tuple[int, int] | None = None,
    ) -> "Rectification":
        """From what ROS calls K (3, 3), D, R (3, 3) and P (3, 4) of the (left, right) camera, and (width, height).

        raw_shape: (height, width) of the raw images, where they are not as large as the rectified ones.
        Raises InvalidInputError when a number is missing, these are not the matrices of one pair, or pictures are of no
        size up to MOST_PX.
        """
        raw_px = size_px if raw_shape is None else (raw_shape[1], raw_shape[0])
        for each in (size_px, raw_px):
            _check_size(each)
        camera = StereoCamera.from_projections(*P, size_px)
        turns = [_rotation(each, side) for each, side in zip(R, SIDES, strict=True)]
        numbers = [_intrinsics(*each) for each in zip(K, distortion, SIDES, strict=True)]
        left, right = (
            cv2.initUndistortRectifyMap(*each, turn, as_floats(projection), size_px, cv2.CV_32FC1)
            for each, turn, projection in zip(numbers, turns, P, strict=True)
        )
        (K0, D0), (K1, D1) = numbers
        matrices = RigMatrices((K0, K1), (D0, D1), (turns[0], turns[1]), (as_floats(P[0]), as_floats(P[1])), raw_px)
        return cls(camera, turns[0], tuple(left), tuple(right), matrices)

    @property
    def raw_shape(self) -> tuple[int, int]:
        """(height, width) of the raw images."""
        return self.matrices.size_px[1], self.matrices.size_px[0]

    def rectify(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """The rectified pair, each (H, W) uint8."""
        for side, image in (("left", left), ("right", right)):
            if image.shape[:2] != self.raw_shape:
                raise InvalidInputError(f"the {side} image is {image.shape[:2]}, the calibration {self.raw_shape}")
        return (
            cv2.remap(left, *self.maps_left, cv2.INTER_LINEAR),
            cv2.remap(right, *self.maps_right, cv2.INTER_LINEAR),
        )
