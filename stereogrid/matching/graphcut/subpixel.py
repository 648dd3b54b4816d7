"""Disparities between the labels, from the costs beside the best label, evened along surfaces."""

import numpy as np
from numba import njit

from ...geometry import Array
from ...observation import FloatImage, Image

REACH_PX = 5
"""How far pixels are evened with each other."""
STEP_PX = 1.0
"""A larger step from one pixel to the next is an edge of depth."""
GREY_SCALE = 20.0
"""On which the weight falls with the change of grey."""


@njit(cache=True, nogil=True)
def fit(costs: Array, labels: Array, fitted: Array, out: Array) -> None:
    """Write into out (H, W) float32 the labels, moved by up to 1/2 where fitted (H, W): to the costs' minimum.

    With r <= 1 the ratio of the rises to both sides, the move is 1/2 - (r + r^2) / 4 to the side of the smaller rise:
    between the parabola and two equal slopes, both of which pull towards the labels (the functions of I. Haller and
    S. Nedevschi, "Design of Interpolation Functions for Subpixel-Accuracy Stereo-Vision Systems", IEEE TIP 2012).
    """
    height, width, count = costs.shape
    for y in range(height):
        for x in range(width):
            d = labels[y, x]
            out[y, x] = d
            if not fitted[y, x] or d == 0 or d == count - 1:
                continue
            below = np.int64(costs[y, x, d - 1]) - np.int64(costs[y, x, d])
            above = np.int64(costs[y, x, d + 1]) - np.int64(costs[y, x, d])
            if below < 0 or above < 0 or below + above == 0:
                continue
            ratio = min(below, above) / max(below, above)
            move = 0.5 - 0.25 * (ratio + ratio * ratio)
            out[y, x] = d + (move if above < below else -move)


@njit(cache=True, nogil=True)
def smooth_lines(disparity: Array, image: Array, rule: tuple[int, float, Array], out: Array) -> None:
    """Write into out (N, W) float32 the means of disparity (N, W) along the lines, as far as its surface goes.

    rule: reach, largest step from one pixel to the next on a surface, weight (256,) of a change of image (N, W) uint8.
    Pixels count in pairs, as far to the left as to the right, so that a slant stays as it is.
    """
    reach, step, by_change = rule
    count, width = disparity.shape
    for i in range(count):
        for x in range(width):
            total, weights = disparity[i, x], np.float32(1)
            for k in range(1, min(reach, x, width - 1 - x) + 1):
                a, b = x - k, x + k
                if (
                    abs(disparity[i, a] - disparity[i, a + 1]) > step
                    or abs(disparity[i, b] - disparity[i, b - 1]) > step
                ):
                    break
                change = abs(np.int64(image[i, a]) - np.int64(image[i, x]))
                change = max(change, abs(np.int64(image[i, b]) - np.int64(image[i, x])))
                weight = by_change[change]
                total += weight * (disparity[i, a] + disparity[i, b])
                weights += 2 * weight
            out[i, x] = total / weights


def smoothed(disparity_px: FloatImage, grey: Image) -> FloatImage:
    """The disparity (H, W) evened along the rows and the columns, within surfaces of like grey (H, W)."""
    by_change = np.exp(-np.arange(256) / GREY_SCALE).astype(np.float32)
    for _ in range(2):
        evened = np.empty_like(disparity_px)
        smooth_lines(disparity_px, grey, (REACH_PX, STEP_PX, by_change), evened)
        disparity_px, grey = np.ascontiguousarray(evened.T), np.ascontiguousarray(grey.T)
    return disparity_px
