"""Poses as plain 4x4 matrices: `p_a = T_a_b @ p_b`. Frames are named in docs/conventions.md."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from .errors import InvalidInputError

Array = NDArray[Any]
FloatArray = NDArray[np.float64]


def as_floats(values: ArrayLike) -> FloatArray:
    """values as a float64 array of any shape."""
    floats: FloatArray = np.asarray(values, dtype=np.float64)
    return floats


RIGID_TOLERANCE = 1e-4
"""Largest deviation of R R^T from the identity; poses printed with 6 digits stay within it."""


def as_pose(T: ArrayLike, name: str = "pose") -> FloatArray:
    """Return T as a checked (4, 4) float64 rigid transform.

    Raises InvalidInputError when the shape is wrong, a number is not finite, or the matrix is not rigid.
    """
    pose = np.array(T, dtype=np.float64)
    if pose.shape != (4, 4):
        raise InvalidInputError(f"{name} must be a (4, 4) matrix, not {pose.shape}")
    if not np.isfinite(pose).all():
        raise InvalidInputError(f"{name} contains NaN or infinity")
    if max(abs(pose[3, 0]), abs(pose[3, 1]), abs(pose[3, 2]), abs(pose[3, 3] - 1)) > 1e-9:
        raise InvalidInputError(f"{name} must end with the row 0 0 0 1, not {pose[3].tolist()}")
    R = pose[:3, :3]
    deviation = float(np.abs(R @ R.T - np.eye(3)).max())
    if deviation > RIGID_TOLERANCE or np.linalg.det(R) < 0:
        raise InvalidInputError(
            f"{name} is not rigid: its rotation deviates from orthonormal by {deviation:.2g}, "
            f"determinant {np.linalg.det(R):.3g} (expected at most {RIGID_TOLERANCE:g} and +1)"
        )
    return pose


ROUNDING = 0.01
"""Largest deviation of a rotation's numbers from those of the nearest one, in files that round them."""


def nearest_pose(T: ArrayLike, name: str = "pose") -> FloatArray:
    """The pose (4, 4) with the rotation nearest to that of T (3, 4) or (4, 4), as files that round its numbers need it.

    Raises InvalidInputError when a number is not finite or the nearest rotation is farther off than ROUNDING.
    """
    matrix = as_floats(T)
    if matrix.shape not in ((3, 4), (4, 4)) or not np.isfinite(matrix).all():
        raise InvalidInputError(f"{name} must be a finite (3, 4) or (4, 4) matrix")
    u, _, vt = np.linalg.svd(matrix[:3, :3])
    rotation = u @ vt
    off = float(np.abs(rotation - matrix[:3, :3]).max())
    if off > ROUNDING or not np.linalg.det(rotation) > 0:
        raise InvalidInputError(f"{name} is no rotation and position: it is off by {off:.2g}")
    if matrix.shape == (4, 4) and np.abs(matrix[3] - [0, 0, 0, 1]).max() > 1e-6:
        raise InvalidInputError(f"{name} must end with the row 0 0 0 1, not {matrix[3].tolist()}")
    return from_rotation(rotation, matrix[:3, 3])


COVARIANCE_TOLERANCE = 1e-6
"""How far a covariance may be from symmetric and from positive semidefinite, relative: it may be float32."""


def as_covariance(values: ArrayLike, size: int, name: str = "covariance") -> FloatArray:
    """Values as a finite, symmetric, positive semidefinite (size, size) matrix; raises InvalidInputError otherwise."""
    matrix = np.array(values, dtype=np.float64)
    if matrix.shape != (size, size):
        raise InvalidInputError(f"{name} must be ({size}, {size}), not {matrix.shape}")
    if not np.isfinite(matrix).all():
        raise InvalidInputError(f"{name} must be finite, without NaN or infinity")
    tolerance = COVARIANCE_TOLERANCE * float(np.abs(matrix).max())
    asymmetry = float(np.abs(matrix - matrix.T).max())
    if asymmetry > tolerance:
        raise InvalidInputError(f"{name} must be symmetric; it is off by {asymmetry:.3g}")
    matrix = 0.5 * matrix + 0.5 * matrix.T
    least = float(np.linalg.eigvalsh(matrix)[0])
    if least < -tolerance:
        raise InvalidInputError(f"{name} must be positive semidefinite; it has the eigenvalue {least:.3g}")
    return matrix


def from_rotation(R: ArrayLike, t_m: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """The (4, 4) pose of a (3, 3) rotation and a translation (3,) [m]."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = t_m
    return T


def from_yaw(yaw_rad: float, t_m: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """The (4, 4) pose turned by yaw_rad about z, then shifted by t_m (3,) [m]."""
    return from_rotation(Rotation.from_euler("z", yaw_rad).as_matrix(), t_m)


def from_quaternion_wxyz(wxyz: ArrayLike, t_m: ArrayLike) -> FloatArray:
    """The (4, 4) pose of a quaternion (4,) in the order w, x, y, z and a translation (3,) [m]."""
    w, x, y, z = np.asarray(wxyz, dtype=np.float64)
    return from_rotation(Rotation.from_quat([x, y, z, w]).as_matrix(), t_m)


def quaternion_wxyz(T: FloatArray) -> FloatArray:
    """The quaternion (4,) w, x, y, z (w >= 0) of the rotation of a (4, 4) pose."""
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True)
    return np.array([w, x, y, z])


def inverse(T_a_b: FloatArray) -> FloatArray:
    """T_b_a (4, 4), the exact inverse of a rigid T_a_b."""
    R = T_a_b[:3, :3].T
    return from_rotation(R, -R @ T_a_b[:3, 3])


def transform(T_a_b: FloatArray, points_b: ArrayLike) -> FloatArray:
    """Points (..., 3) of frame b in frame a [m]. Eq. 7 as one matrix: p_world = T_world_cam p_cam."""
    moved: FloatArray = as_floats(points_b) @ T_a_b[:3, :3].T + T_a_b[:3, 3]
    return moved


def yaw_rad(T: FloatArray) -> float:
    """Heading of the x axis of a (4, 4) pose about z, in (-pi, pi] [rad]."""
    return float(np.arctan2(T[1, 0], T[0, 0]))


def rotation_angle_rad(T: FloatArray) -> float:
    """The angle of the rotation of a (4, 4) pose, in [0, pi] [rad]."""
    return float(Rotation.from_matrix(T[:3, :3]).magnitude())


def between(T_start: FloatArray, T_end: FloatArray, share: ArrayLike) -> FloatArray:
    """Poses (..., 4, 4) at a share (...), 0 to 1, of the way from T_start to T_end (..., 4, 4).

    Moved on a straight line, turned evenly on the shortest way.
    """
    part = as_floats(share)[..., None]
    R_start = Rotation.from_matrix(T_start[..., :3, :3])
    turn = (R_start.inv() * Rotation.from_matrix(T_end[..., :3, :3])).as_rotvec()
    T = T_start.copy()
    T[..., :3, :3] = (R_start * Rotation.from_rotvec(turn * part)).as_matrix()
    T[..., :3, 3] = (1 - part) * T_start[..., :3, 3] + part * T_end[..., :3, 3]
    return T


def look_at(eye_m: FloatArray, target_m: FloatArray) -> FloatArray:
    """The pose (4, 4) of an optical frame (x right, y down, z forward) at eye_m that looks at target_m, z up."""
    z = (target_m - eye_m) / np.linalg.norm(target_m - eye_m)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T[:3, 3] = eye_m
    return T


R_BASE_OPTICAL: FloatArray = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of an optical frame (x right, y down, z forward) in a body frame (x forward, y left, z up)."""
