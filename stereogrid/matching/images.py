"""The two images of a pair: checked, in grey, in the same tones."""

from numbers import Integral
from typing import Any

import cv2
import numpy as np

from ..errors import InvalidInputError
from ..observation import Disparity, Image, check_pair
from .correlation import error_correlation_px

WINDOW_COLUMNS, WINDOW_ROWS = 9, 7
"""An image must hold the search and a window so large [px]."""
LARGEST_GAIN = 2.0
"""Beyond it, the images show different things rather than the same in other tones."""
LIKE_GAIN, LIKE_OFFSET = 0.03, 3.0
"""By so much the spread (a share) and the mean (grey levels) of two views differ in any case."""


def check_num_disparities(num_disparities: Any) -> None:
    """Raise InvalidInputError unless it is an integer of at least 1."""
    if isinstance(num_disparities, bool) or not isinstance(num_disparities, Integral):
        raise InvalidInputError(f"num_disparities must be an integer, not {num_disparities!r}")
    if num_disparities < 1:
        raise InvalidInputError(f"num_disparities must be at least 1, not {num_disparities}")


def check_images(left: Any, right: Any, num_disparities: int) -> tuple[Image, Image]:
    """Both images as (H, W, channels); raises InvalidInputError unless they are alike and wider than the search."""
    in_colour = all(isinstance(i, np.ndarray) and i.ndim == 3 and i.shape[2] == 3 for i in (left, right))
    check_pair(*((left[..., 0], right[..., 0]) if in_colour else (left, right)))
    height, width = left.shape[:2]
    if width <= num_disparities + WINDOW_COLUMNS or height < WINDOW_ROWS:
        raise InvalidInputError(
            f"an image of {width}x{height} px is too small for {num_disparities} disparities: expected more than "
            f"{num_disparities + WINDOW_COLUMNS} columns and at least {WINDOW_ROWS} rows"
        )
    first, second = (np.ascontiguousarray(i.reshape(height, width, -1)) for i in (left, right))
    return first, second


def is_blank(left: Image, right: Image) -> bool:
    """Whether one of the images is even all over, as a covered lens makes it: then nothing can be known."""
    return any(bool((image == image[:1, :1]).all()) for image in (left, right))


def nothing_known(image: Image, *, matcher: str) -> Disparity:
    """What a matcher of this name finds where nothing matches, for images (H, W) or (H, W, channels)."""
    unknown = np.full(image.shape[:2], np.nan, np.float32)
    return Disparity(unknown, unknown, error_correlation_px(matcher))


def grey_of(image: Image) -> Image:
    """(H, W) grey of an image (H, W, 1) or (H, W, 3) in BGR."""
    grey: Image = image[..., 0] if image.shape[2] == 1 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return grey


def toned_as(left: Image, right: Image) -> Image:
    """The right image (H, W, channels) with the mean and the spread of the left one: two cameras, two exposures.

    Only what exceeds the difference between any two views is taken off, so that like images stay as they are.
    """
    gain = 1 + beyond(float(left.std()) / max(float(right.std()), 1e-3) - 1, LIKE_GAIN)
    gain = min(max(gain, 1 / LARGEST_GAIN), LARGEST_GAIN)
    mean = float(right.mean()) + beyond(float(left.mean()) - float(right.mean()), LIKE_OFFSET)
    table = np.clip(np.rint(gain * (np.arange(256) - float(right.mean())) + mean), 0, 255).astype(np.uint8)
    toned: Image = table[right]
    return toned


def beyond(value: float, usual: float) -> float:
    """What of a value exceeds the usual, to either side."""
    return max(abs(value) - usual, 0.0) * (1.0 if value > 0 else -1.0)
