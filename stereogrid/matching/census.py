"""Images as the matchers of our own see them: in grey, by census; and whether what was matched looks alike at all.

Census: R. Zabih and J. Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..geometry import Array
from ..observation import Image
from .images import WINDOW_COLUMNS, WINDOW_ROWS, grey_of

Mask = NDArray[np.bool_]

CENSUS_COLUMNS, CENSUS_ROWS = WINDOW_COLUMNS, WINDOW_ROWS
"""The census window [px]: 62 comparisons, which fit into one uint64."""
LIKE_BITS = 16
"""Of the 62 bits so many may differ between pixels that are alike."""


class Side(NamedTuple):
    """One of the images: (H, W, channels) uint8, its grey (H, W) and the census of that (H, W)."""

    image: Image
    grey: Image
    census: NDArray[np.uint64]


def side_of(image: Image) -> Side:
    """An image (H, W, channels) with what is made of it."""
    grey = grey_of(image)
    return Side(image, grey, census_of(grey))


def census_of(grey: Image) -> NDArray[np.uint64]:
    """The census (H, W) uint64 of a grey image (H, W) uint8, its edges repeated outwards."""
    v, u = CENSUS_ROWS // 2, CENSUS_COLUMNS // 2
    bits = np.empty(grey.shape, np.uint64)
    census(cv2.copyMakeBorder(grey, v, v, u, u, cv2.BORDER_REPLICATE), CENSUS_COLUMNS, CENSUS_ROWS, bits)
    return bits


@njit(cache=True, nogil=True)
def census(padded: Array, columns: int, rows: int, out: Array) -> None:
    """Write into out (H, W) uint64 which pixels of the window are darker than its centre, a bit each.

    padded: the grey image, (H + rows - 1, W + columns - 1) uint8.
    """
    height, width = out.shape
    for y in range(height):
        for x in range(width):
            out[y, x] = 0
        for v in range(rows):
            for u in range(columns):
                if v == rows // 2 and u == columns // 2:
                    continue
                for x in range(width):
                    darker = padded[y + v, x + u] < padded[y + rows // 2, x + columns // 2]
                    out[y, x] = (out[y, x] << np.uint64(1)) | np.uint64(darker)


@njit(cache=True, nogil=True, inline="always")
def ones(bits: np.uint64) -> np.uint64:
    """How many bits are set: the sum in a tree, by pairs, nibbles and bytes."""
    bits = bits - ((bits >> np.uint64(1)) & np.uint64(0x5555555555555555))
    bits = (bits & np.uint64(0x3333333333333333)) + ((bits >> np.uint64(2)) & np.uint64(0x3333333333333333))
    bits = (bits + (bits >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (bits * np.uint64(0x0101010101010101)) >> np.uint64(56)


@njit(cache=True, nogil=True)
def alike(left: Array, right: Array, labels: Array, most: int, out: Array) -> None:
    """Write into out (H, W) bool where at most so many bits of the census left and right - label differ."""
    height, width = labels.shape
    for y in range(height):
        for x in range(width):
            u = x - labels[y, x]
            out[y, x] = u >= 0 and ones(left[y, x] ^ right[y, max(u, 0)]) <= most


def shares_around(
    sides: list[Side], labels: NDArray[np.int32], agreed: Mask, around_px: int
) -> tuple[NDArray[np.float32], ...]:
    """Of the window around each pixel (H, W), the share that agreed and is alike at its label, and that just agreed."""
    like = np.empty(labels.shape, bool)
    alike(sides[0].census, sides[1].census, labels, LIKE_BITS, like)
    return tuple(
        cv2.blur(mask.astype(np.float32), (around_px, around_px), borderType=cv2.BORDER_REFLECT)
        for mask in (like & agreed, agreed)
    )
