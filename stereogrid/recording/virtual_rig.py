"""A virtual stereo rig in place of a depth camera: the disparities and the right picture that its depths stand for."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..camera import StereoCamera
from ..geometry import FloatArray
from ..observation import Disparity, Image

SIGMA_PER_M = 0.05 / (585 * 0.06)
"""A Kinect errs by this times the square of the depth [1/m], 1.42 mm at 1 m (Khoshelham, Elberink, Sensors 12, 2012):
by the same disparity everywhere: .05 px of a rig with its 585 px of focal length and a baseline of 6 cm."""
WINDOW_PX = 9.0
"""Side of the window that a Kinect matches its pattern by; within it errors go together."""
SAME_SURFACE_PX = 1.0
"""Neighbours whose disparities differ by more are taken to lie on different surfaces."""


def sensor_sigma_px(camera: StereoCamera) -> float:
    """Standard deviation of measured depths, as disparities of this rig [px]: d = f b / z, so f b sigma_z / z^2."""
    return camera.focal_baseline_px_m * SIGMA_PER_M


def measured_disparity(
    camera: StereoCamera, depth_m: FloatArray, noise_px: float = 0.0, rng: np.random.Generator | None = None
) -> Disparity:
    """What the rig would measure of a depth image (H, W) [m], NaN = unknown.

    noise_px: of a normal noise from rng, independent from pixel to pixel, on top of the depth camera's own. sigma_px
    holds both, and so does correlation_px: L^2 / A is the variance of a window's mean for either.
    """
    disparity_px, sensor_px = camera.disparity_px(depth_m), sensor_sigma_px(camera)
    if noise_px and rng is not None:
        disparity_px = with_noise(disparity_px, noise_px, rng)
    variance = sensor_px**2 + noise_px**2
    area_px = ((sensor_px * WINDOW_PX) ** 2 + noise_px**2) / variance
    return Disparity(disparity_px.astype(np.float32), np.float32(math.sqrt(variance)), math.sqrt(area_px))  # type: ignore[arg-type]


def with_noise(disparity_px: FloatArray, noise_px: float, rng: np.random.Generator) -> FloatArray:
    """Disparities (H, W) with normal noise of noise_px [px], independent from pixel to pixel; NaN where not > 0."""
    noisy_px: FloatArray = disparity_px + rng.normal(0, noise_px, disparity_px.shape)
    noisy_px[~(noisy_px > 0)] = np.nan
    return noisy_px


def right_view(left: Image, disparity_px: NDArray[np.float32]) -> Image:
    """The right picture (H, W) that belongs to a left one and its disparities (H, W), NaN = unknown. Synthetic.

    Each pixel moves left by its disparity; where several arrive, the nearest is seen. An unknown disparity is taken to
    be that of the farther of its two neighbours in the row. What the left camera does not see, behind things and beyond
    its edge, shows the background beside it, mirrored.
    """
    right, nearest_px = left.copy(), np.zeros(left.shape, np.float32)
    known_px = np.ascontiguousarray(disparity_px, np.float32).copy()
    _fill_unknown(known_px)
    _move(left, known_px, right, nearest_px)
    _fill_unseen(right, nearest_px)
    return right


@njit(cache=True, nogil=True)
def _fill_unknown(disparity_px: NDArray[np.float32]) -> None:
    """A run of NaN in a row becomes the smaller of the disparities before and after it; a row of NaN stays."""
    height, width = disparity_px.shape
    for row in range(height):
        column = 0
        while column < width:
            start = column
            while column < width and np.isnan(disparity_px[row, column]):
                column += 1
            before = disparity_px[row, start - 1] if start > 0 else np.float32(np.inf)
            after = disparity_px[row, column] if column < width else np.float32(np.inf)
            if min(before, after) < np.inf:
                disparity_px[row, start:column] = min(before, after)
            column += 1


@njit(cache=True, nogil=True)
def _move(
    left: NDArray[np.uint8],
    disparity_px: NDArray[np.float32],
    right: NDArray[np.uint8],
    nearest_px: NDArray[np.float32],
) -> None:
    """Draw the surface between each two neighbours of one surface into right; nearest_px: the disparity drawn."""
    height, width = left.shape
    for row in range(height):
        for column in range(width - 1):
            first, step = disparity_px[row, column], disparity_px[row, column + 1] - disparity_px[row, column]
            if not abs(step) <= SAME_SURFACE_PX:
                continue
            start, long = column - first, 1 - step
            for at in range(max(math.ceil(start), 0), min(math.floor(start + long), width - 1) + 1):
                share = (at - start) / long if long > 0 else 0.0
                if first + share * step > nearest_px[row, at]:
                    nearest_px[row, at] = first + share * step
                    grey = (1 - share) * left[row, column] + share * left[row, column + 1]
                    right[row, at] = np.uint8(grey + 0.5)


@njit(cache=True, nogil=True)
def _fill_unseen(right: NDArray[np.uint8], nearest_px: NDArray[np.float32]) -> None:
    """Each run of a row that nothing was drawn to shows what is beside it on its farther side, mirrored."""
    height, width = right.shape
    for row in range(height):
        column = 0
        while column < width:
            start = column
            while column < width and nearest_px[row, column] == 0:
                column += 1
            before = nearest_px[row, start - 1] if start > 0 else np.float32(np.inf)
            after = nearest_px[row, column] if column < width else np.float32(np.inf)
            for k in range(column - start if min(before, after) < np.inf else 0):
                if before <= after:
                    right[row, start + k] = right[row, max(start - 1 - k, 0)]
                else:
                    right[row, column - 1 - k] = right[row, min(column + k, width - 1)]
            column += 1
