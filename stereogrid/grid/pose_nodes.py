"""Where a camera of an uncertain pose may stand, as a few poses with weights, and what is left along each ray.

A heading error, or one to the side, moves all that an observation shows across the image: it is the same for all of
its pixels, so no width of a single reading can stand for it. A few poses stand for what moves the image by more than
a fraction of a cell; the rest is an error along the rays, as eps of Eq. 13.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry import FloatArray, as_floats

LEAST_CELLS = 0.25
"""Where the image's content errs by less than this many cells, one pose is enough."""
MOST_NODES = 9
"""On an axis: larger errors than these can hold have their poses farther apart than a cell."""
REACH = 2.0
"""The outermost nodes of an axis before they are matched to the variance [sigmas]."""
ROUND = 1e-6
"""A covariance whose principal axes differ by less than this, relative, has none."""


@dataclass(frozen=True)
class PoseNodes:
    """The poses T_world_cam (K, 4, 4) that stand for a pose and its covariance, their weights (K,), of sum 1; and the
    covariance (3, 3) [m^2], along the axes of cam, of what these poses leave of the position's error.
    """

    poses: FloatArray
    weights: FloatArray
    left_m2: FloatArray

    def __len__(self) -> int:
        return len(self.poses)


def pose_nodes(T_world_cam: FloatArray, covariance: FloatArray, *, reference_m: float, cell_m: float) -> PoseNodes:
    """The nodes of a pose (4, 4) whose covariance (6, 6) is that of OccupancyGrid.integrate.

    What the error moves to the right and down at reference_m before the camera has two principal axes. On each, a few
    nodes stand for its normal distribution, and each node for the pose error expected there (the regression of the
    error on what is seen of it), without its part along the optical axis: that stays an error along the rays.
    """
    right, down, forward = T_world_cam[:3, :3].T
    moved = np.array([[*right, *(reference_m * down)], [*down, *(-reference_m * right)]])
    # Displacements along the principal axes, as rows that take a pose error: they are independent of each other.
    moved = _principal(moved @ covariance @ moved.T) @ moved
    sigmas_m = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", moved, covariance, moved), 0.0))
    left, axes = np.eye(3, 6), []
    for row, sigma_m in zip(moved, sigmas_m, strict=True):
        places, weights = quadrature(sigma_m / cell_m)
        expected = np.zeros(6)
        if len(places) > 1:
            expected = covariance @ row / sigma_m
            expected[:3] -= forward * (forward @ expected[:3])
            left -= np.outer(expected[:3], row / sigma_m)
        axes.append([(place * expected, weight) for place, weight in zip(places, weights, strict=True)])
    nodes = [(a + b, v * w) for (a, v), (b, w) in product(*axes)]
    in_cam = T_world_cam[:3, :3].T @ left
    poses = np.stack([_shifted(T_world_cam, error) for error, _ in nodes])
    return PoseNodes(poses, np.array([weight for _, weight in nodes]), in_cam @ covariance @ in_cam.T)


def quadrature(sigma_cells: float) -> tuple[FloatArray, FloatArray]:
    """Places (n,) [sigmas] and weights (n,) of a standard normal distribution: mean 0, variance 1, sum 1.

    The fewest whose distance is a cell or less, 1 where the error is small, MOST_NODES at most.
    """
    if sigma_cells <= LEAST_CELLS:
        return np.zeros(1), np.ones(1)
    for n in range(2, MOST_NODES + 1):
        places = np.linspace(-REACH, REACH, n)
        weights = np.exp(-0.5 * places**2)
        weights /= weights.sum()
        places /= np.sqrt(weights @ places**2)
        if (places[1] - places[0]) * sigma_cells <= 1:
            break
    return places, weights


def _principal(S: FloatArray) -> FloatArray:
    """The principal axes of a covariance (2, 2), as rows; those of the image where rounding alone would choose."""
    across, difference = 2 * S[0, 1], S[0, 0] - S[1, 1]
    if np.hypot(across, difference) <= ROUND * (S[0, 0] + S[1, 1]):
        return np.eye(2)
    angle = 0.5 * np.arctan2(across, difference)
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def _shifted(T_world_cam: FloatArray, error: FloatArray) -> FloatArray:
    """The pose (4, 4) of a camera that errs by (6,): position [m] and turn about the camera [rad], axes of world."""
    T = T_world_cam.copy()
    if error.any():
        T[:3, :3] = Rotation.from_rotvec(error[3:]).as_matrix() @ T[:3, :3]
        T[:3, 3] += error[:3]
    return as_floats(T)
