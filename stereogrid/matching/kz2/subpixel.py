"""Disparities between the labels, from how well windows match one label to either side."""

import cv2
import numpy as np

from ...observation import FloatImage, Image
from .solve import LabelImage

WINDOW_PX = 7
"""Side of the windows that are compared: wide enough for the noise, narrow enough for a slant."""


def between_labels(label: LabelImage, left: Image, right: Image) -> FloatImage:
    """Disparity (H, W) [px] of labels (H, W) on grey images (H, W): at most half a label away; NaN where unmatched.

    The minimum of a parabola through the mean squared differences of windows at the labels - 1, + 0 and + 1.
    """
    matched, column = label >= 0, np.arange(label.shape[1])
    row = np.arange(label.shape[0])[:, None]
    costs = []
    for step in (-1, 0, 1):
        other = right[row, np.clip(column - label - step, 0, label.shape[1] - 1)]
        squared = np.where(matched, np.square(left.astype(np.float32) - other), 0)
        costs.append(cv2.boxFilter(squared, cv2.CV_32F, (WINDOW_PX, WINDOW_PX)))
    below, here, above = costs
    curvature = np.maximum(below - 2 * here + above, 1e-3)
    shift = np.clip((below - above) / (2 * curvature), -0.5, 0.5)
    shift[(here > below) & (here > above)] = 0
    disparity_px: FloatImage = np.where(matched, label + shift, np.nan).astype(np.float32)
    return disparity_px
