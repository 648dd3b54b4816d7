"""What OpenCV's two matchers share: padding, units, and the checks that OpenCV itself leaves out."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from ..observation import Disparity, Image, check_pair
from .correlation import error_correlation_px
from .images import is_blank, nothing_known
from .sigma import disparity_sigma_px

FIXED_POINT = 16
"""OpenCV's disparities are integers in sixteenths of a pixel."""


def check_options(num_disparities: int, block_px: int, *, smallest_block_px: int) -> None:
    """Raise InvalidInputError for option values that OpenCV would refuse or misread."""
    if num_disparities <= 0 or num_disparities % 16:
        raise InvalidInputError(f"num_disparities must be a positive multiple of 16, not {num_disparities}")
    if block_px < smallest_block_px or block_px % 2 == 0 or block_px > 255:
        raise InvalidInputError(f"block_px must be odd and {smallest_block_px} to 255, not {block_px}")


def check_size(image: Image, num_disparities: int, block_px: int) -> None:
    """Raise InvalidInputError for an image on which OpenCV would fail or read out of bounds."""
    height, width = image.shape
    if width <= num_disparities + block_px or height <= block_px:
        raise InvalidInputError(
            f"an image of {width}x{height} px is too small for {num_disparities} disparities and a block of "
            f"{block_px} px: expected more than {num_disparities + block_px} columns and {block_px} rows"
        )


def match_padded(
    algorithm: Any, left: Image, right: Image, *, num_disparities: int, block_px: int, name: str
) -> Disparity:
    """Run a cv2 matcher so that no columns are lost; NaN where nothing matched or the match is out of the image.

    name: the matcher's in MATCHERS, whose sigma and correlation length serve.
    """
    check_pair(left, right)
    check_size(left, num_disparities, block_px)
    if is_blank(left, right):
        return nothing_known(left, matcher=name)
    # OpenCV gives no disparity for the first num_disparities columns: give it as many that do not count.
    padded = [cv2.copyMakeBorder(i, 0, 0, num_disparities, 0, cv2.BORDER_REPLICATE) for i in (left, right)]
    raw: NDArray[np.int16] = algorithm.compute(*padded)[:, num_disparities:]
    disparity_px = raw.astype(np.float32) / np.float32(FIXED_POINT)
    column = np.arange(left.shape[1], dtype=np.float32)
    disparity_px[(disparity_px <= 0) | (disparity_px > column)] = np.nan
    sigma_px = disparity_sigma_px(left, right, disparity_px, matcher=name)
    return Disparity(disparity_px, sigma_px, error_correlation_px(name))
