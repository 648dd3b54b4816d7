"""Edges of depth, moved to where the image has its edge: a weighted median of the labels around them.

Z. Ma, K. He, Y. Wei, J. Sun and E. Wu, "Constant Time Weighted Median Filtering for Stereo Matching and Beyond",
ICCV 2013 (here by counting, for the window is small and only pixels near an edge of depth are asked).
"""

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...geometry import Array
from ...observation import Image

REACH_PX, GREY_SCALE, DISTANCE_SCALE_PX = 4, 8.0, 3.0
"""The window, and the scales on which a weight falls with the change of grey and with each coordinate."""


@njit(cache=True, nogil=True)
def weighted_medians(labels: Array, grey: Array, asked: Array, tables: tuple[Array, Array, Array], out: Array) -> None:
    """Write into out (H, W) int32 the weighted median of the labels (H, W) around each pixel asked (H, W).

    grey (H, W) uint8; tables: the weight of a change of grey 0 .. 255, of a distance 0 .. reach along a coordinate,
    and room (D,) float32 for the weight of each label, zeros. Other pixels of out stay as they were.
    """
    by_change, by_distance, of_label = tables
    height, width = labels.shape
    reach = len(by_distance) - 1
    for y in range(height):
        top, bottom = max(0, y - reach), min(height, y + reach + 1)
        for x in range(width):
            if not asked[y, x]:
                continue
            total, least, most = np.float32(0), labels[y, x], labels[y, x]
            for v in range(top, bottom):
                for u in range(max(0, x - reach), min(width, x + reach + 1)):
                    change = abs(np.int64(grey[v, u]) - np.int64(grey[y, x]))
                    weight = by_change[change] * by_distance[abs(v - y)] * by_distance[abs(u - x)]
                    of_label[labels[v, u]] += weight
                    total += weight
                    least, most = min(least, labels[v, u]), max(most, labels[v, u])
            out[y, x] = take_median(of_label, least, most, total)


@njit(cache=True, nogil=True)
def take_median(of_label: Array, least: int, most: int, total: float) -> int:
    """The first label from least to most with half of the total weight up to it; sets those weights to 0."""
    below, median = np.float32(0), -1
    for d in range(least, most + 1):
        below += of_label[d]
        of_label[d] = 0
        if median < 0 and 2 * below >= total:
            median = d
    return median if median >= 0 else most


def straighten(labels: NDArray[np.int32], grey: Image, count: int, tolerance: int) -> NDArray[np.bool_]:
    """Replace, in place, labels (H, W) below count that differ from their median by more than the tolerance.

    Returns which (H, W) were replaced.
    """
    window = np.ones((2 * REACH_PX + 1, 2 * REACH_PX + 1), np.uint8)
    exact = labels.astype(np.float32)
    asked = cv2.dilate(exact, window) - cv2.erode(exact, window) > tolerance
    medians = labels.copy()
    by_change = np.exp(-np.arange(256) / GREY_SCALE).astype(np.float32)
    by_distance = np.exp(-np.arange(REACH_PX + 1) / DISTANCE_SCALE_PX).astype(np.float32)
    weighted_medians(labels, grey, asked, (by_change, by_distance, np.zeros(count, np.float32)), medians)
    replaced: NDArray[np.bool_] = np.abs(medians - labels) > tolerance
    labels[replaced] = medians[replaced]
    return replaced
