"""How uncertain a window's disparity is, from its texture."""

import cv2
import numpy as np

from ..observation import FloatImage, Image

FLOOR_PX = 0.3
"""What remains on perfect texture: sub-pixel interpolation and the window's own bias."""
GREY_NOISE = 1.0
"""Standard deviation of the noise of a grey value in either image, in grey levels; hence 2 n^2 between the two."""
LARGEST_PX = 4.0


def disparity_sigma_px(left: Image, block_px: int) -> FloatImage:
    """Standard deviation of the disparity (H, W) [px] of windows of block_px on the left image (H, W).

    sigma^2 = floor^2 + 2 n^2 / sum over the window of (dI/dx)^2: the variance of a least-squares shift between
    two windows with grey noise n (Matthies, Kanade and Szeliski 1989), and a floor that texture cannot lower.
    """
    gradient = cv2.Sobel(left, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
    energy = cv2.boxFilter(np.square(gradient), cv2.CV_32F, (block_px, block_px), normalize=False)
    sigma = np.sqrt(FLOOR_PX**2 + 2 * GREY_NOISE**2 / np.maximum(energy, 1e-6))
    bounded: FloatImage = np.minimum(sigma, LARGEST_PX).astype(np.float32)
    return bounded
