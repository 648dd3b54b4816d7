"""The hits of an observation: how far each errs from the true point of its pixel, and what is claimed of that."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_covariance, as_floats, as_pose, transform
from ..observation import Disparity, Truth
from ..sensor_model import depth_sigma_m, range_and_sigma_m, widened_sigma_px

STEP_PX = 8
"""Every 8th pixel of every 8th row: neighbours err together, and say no more."""
MISMATCH_PX = 3.0
"""A disparity that errs by more is of another surface; no Gaussian of a match's sigma has such tails."""
LEAST_COSINE = 1e-6
"""A ray that grazes a surface more meets it anywhere."""
NOTHING_M = 1e-9
"""Rounding: an error across the ray that is no larger is none."""


@dataclass(frozen=True)
class Hits:
    """The N sampled hits of one observation, and what is claimed of their errors.

    origin_m (3,): the claimed eye in world. ray (N, 3): unit vectors in world along the claimed rays. range_m (N,): as
    measured. along_m (N,): error of the point along the ray, infinite where nothing is there to be seen; along_sigma_m
    (N,): dl. across_m, across_sigma_m (N,): across it, NaN where no covariance is claimed. mismatch (N,) bool.
    covariance (6, 6): of the pose, None where none is claimed.
    """

    origin_m: FloatArray
    ray: FloatArray
    range_m: FloatArray
    along_m: FloatArray
    along_sigma_m: FloatArray
    across_m: FloatArray
    across_sigma_m: FloatArray
    mismatch: NDArray[np.bool_]
    covariance: FloatArray | None = None

    def slant_sigma_m(self, normal: FloatArray) -> FloatArray:
        """The sigma (N,) of where the rays meet surfaces with unit normals (N, 3), which may be moved across them [m].

        A surface askew to its ray is met nearer or farther when it is moved across the ray: what counts is the error
        along the normal, over the cosine between the two. NaN where no covariance is claimed.
        """
        if self.covariance is None:
            return np.full(len(self.range_m), np.nan)
        cosine = np.einsum("ni,ni->n", normal, self.ray)
        slanted = normal / np.where(np.abs(cosine) < LEAST_COSINE, LEAST_COSINE, cosine)[:, None]
        arm_m = self.range_m[:, None] * self.ray
        on_slant = _covariance(_motion_of(slanted, arm_m), self.covariance)
        # The match's own error is along the ray, and counts in full whatever the slant.
        match = self.along_sigma_m**2 - _covariance(self.ray, self.covariance[:3, :3])
        return np.sqrt(np.maximum(match + on_slant, 0.0))


@dataclass(frozen=True)
class Sampling:
    """Which hits are judged: every step_px-th pixel of every step_px-th row, no deeper than max_range_m [m]."""

    step_px: int = STEP_PX
    max_range_m: float = np.inf

    def __post_init__(self) -> None:
        if not (isinstance(self.step_px, int) and self.step_px >= 1):
            raise InvalidInputError(f"step_px must be a whole number from 1 up, not {self.step_px}")
        if not self.max_range_m > 0:
            raise InvalidInputError(f"max_range_m must be positive, not {self.max_range_m}")

    def of(self, image: Array) -> Array:
        """The sampled pixels of an image (H, W, ...)."""
        chosen = slice(self.step_px // 2, None, self.step_px)
        return image[chosen, chosen]


def measure_hits(
    camera: StereoCamera,
    disparity: Disparity,
    T_world_cam: ArrayLike,
    truth: Truth,
    *,
    sampling: Sampling | None = None,
    motion_sigma_m: float = 0.0,
    motion_rule: str = "rss",
    pose_covariance: ArrayLike | None = None,
) -> Hits:
    """The errors of the hits of an observation that claims to be seen from T_world_cam (4, 4), and their bounds.

    truth: the true pose and depth; NaN depth = nothing there, so that every hit is wrong. What the map was told of the
    pose's error, as OccupancyGrid.integrate takes it: motion_sigma_m and motion_rule, or pose_covariance (6, 6), or
    neither. Raises InvalidInputError for both, and for what does not fit.
    """
    sampling = sampling or Sampling()
    pose, true_depth_m = as_pose(T_world_cam, "T_world_cam"), _checked_depth(camera, disparity, truth)
    covariance = _checked_covariance(pose_covariance, motion_sigma_m)
    d, true_m = as_floats(sampling.of(disparity.disparity_px)), as_floats(sampling.of(true_depth_m))
    hit = camera.depth_m(d) <= sampling.max_range_m
    d, true_m, towards = d[hit], true_m[hit], as_floats(sampling.of(camera.ray_directions))[hit]
    sigma_px = widened_sigma_px(
        camera, d, sampling.of(disparity.sigma_px)[hit], motion_sigma_m=motion_sigma_m, motion_rule=motion_rule
    )
    points_cam = towards * camera.depth_m(d)[:, None]
    range_m, sigma_m = range_and_sigma_m(points_cam, depth_sigma_m(camera, points_cam[:, 2], sigma_px))
    ray = points_cam @ pose[:3, :3].T / range_m[:, None]
    true_m[~(true_m > 0)] = np.inf  # nothing there: infinitely far
    error_m = transform(pose, points_cam) - _true_points_m(towards, true_m, truth)
    along_m = np.where(np.isinf(true_m), np.inf, np.einsum("ni,ni->n", error_m, ray))
    across_m = across_sigma_m = np.full(len(d), np.nan)
    if covariance is not None:
        # A turn moves nothing along the ray.
        sigma_m = np.sqrt(sigma_m**2 + _covariance(ray, covariance[:3, :3]))
        across_m, across_sigma_m = _across(error_m, ray, range_m, covariance)
    mismatch = ~(np.abs(d - camera.disparity_px(true_m)) <= MISMATCH_PX) | np.isinf(true_m)
    return Hits(pose[:3, 3], ray, range_m, along_m, sigma_m, across_m, across_sigma_m, mismatch, covariance)


def _true_points_m(towards: FloatArray, true_m: FloatArray, truth: Truth) -> FloatArray:
    """Points (N, 3) in world at true depths (N,) [m] on rays through (N, 3) at depth 1 in cam, NaN where infinite."""
    depth_m = np.where(np.isinf(true_m), np.nan, true_m)
    return transform(truth.T_world_cam, towards * depth_m[:, None])


def _across(
    error_m: FloatArray, ray: FloatArray, range_m: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Errors (N,) across the rays and their sigmas [m], along the axis on which the covariance (6, 6) is largest.

    One axis, not an ellipse: of a pose that errs in x, y and heading the ellipse is flat on a level ray, and a test
    against its short axis would be one of rounding. An error that is not claimed (a tilt) has no part in it.
    """
    level = np.stack([-ray[:, 1], ray[:, 0], np.zeros(len(ray))], axis=1)
    length = np.linalg.norm(level, axis=1, keepdims=True)
    # A ray straight up or down has no side: any will do.
    level = np.where(length > NOTHING_M, level / np.maximum(length, NOTHING_M), [1.0, 0.0, 0.0])
    upright = np.cross(ray, level)
    aside, up = (_motion_of(axis, range_m[:, None] * ray) for axis in (level, upright))
    s11, s12, s22 = (_covariance(a, covariance, b) for a, b in ((aside, aside), (aside, up), (up, up)))
    angle = 0.5 * np.arctan2(2 * s12, s11 - s22)
    variance = 0.5 * (s11 + s22) + np.hypot(0.5 * (s11 - s22), s12)
    axis = np.cos(angle)[:, None] * level + np.sin(angle)[:, None] * upright
    across_m = np.einsum("ni,ni->n", error_m, axis)
    across_m[np.abs(across_m) <= NOTHING_M] = 0.0
    return across_m, np.sqrt(np.maximum(variance, 0.0))


def _motion_of(axis: FloatArray, arm_m: FloatArray) -> FloatArray:
    """(N, 6): times the pose's error it is the motion, along axes (N, 3), of points at arms (N, 3) from the eye.

    For a small turn w moves such a point by w x arm, along the axis by w . (arm x axis).
    """
    return np.hstack([axis, np.cross(arm_m, axis)])


def _covariance(a: FloatArray, covariance: FloatArray, b: FloatArray | None = None) -> FloatArray:
    """a C b (N,) of rows a and b (N, k), b = a where not given."""
    products: FloatArray = ((a @ covariance) * (a if b is None else b)).sum(axis=1)
    return products


def _checked_depth(camera: StereoCamera, disparity: Disparity, truth: Truth) -> NDArray[np.float32]:
    if truth.depth_m is None:
        raise InvalidInputError("the bound test needs the true depth image, which this truth does not hold")
    for name, image in (("disparity", disparity.disparity_px), ("true depth", truth.depth_m)):
        if image.shape != camera.shape:
            raise InvalidInputError(f"the {name} image is {image.shape}, the camera {camera.shape}")
    return truth.depth_m


def _checked_covariance(covariance: ArrayLike | None, motion_sigma_m: float) -> FloatArray | None:
    if not (np.isfinite(motion_sigma_m) and motion_sigma_m >= 0):
        raise InvalidInputError(f"motion_sigma_m must be >= 0 and finite, not {motion_sigma_m}")
    if covariance is None:
        return None
    if motion_sigma_m:
        raise InvalidInputError("the error of a pose is motion_sigma_m or pose_covariance, not both")
    return as_covariance(covariance, 6, "pose_covariance")
