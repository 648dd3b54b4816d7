"""What matching a pixel costs: census and absolute difference, joined as in AD-Census.

X. Mei, X. Sun, M. Zhou, S. Jiao, H. Wang and X. Zhang, "On Building an Accurate Stereo Matching System on Graphics
Hardware", ICCV Workshops 2011. NumPy twins stand in the tests.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...geometry import Array
from ..census import CENSUS_COLUMNS, CENSUS_ROWS, ones

WORST = 254
"""The largest cost of a pixel: half of it each from census and from the difference."""


@njit(cache=True, nogil=True)
def match_costs(left: tuple[Array, Array], right: tuple[Array, Array], table: Array, beyond: int, out: Array) -> None:
    """Write into out (H, W, D) uint8 what it costs that left (y, x) is right (y, x - d).

    left, right: an image (H, W, channels) uint8 and its census; table (63, 256): the cost of that many unlike bits
    and that grey difference; beyond: the cost of d > x, which the right image does not show.
    """
    (grey_left, census_left), (grey_right, census_right) = left, right
    height, width, count = out.shape
    channels = grey_left.shape[2]
    for y in range(height):
        for x in range(width):
            bits = census_left[y, x]
            shown = min(count, x + 1)
            for d in range(shown):
                unlike = ones(bits ^ census_right[y, x - d])
                difference = np.int64(0)
                for k in range(channels):
                    difference += abs(np.int64(grey_left[y, x, k]) - np.int64(grey_right[y, x - d, k]))
                out[y, x, d] = table[unlike, difference // channels]
            for d in range(shown, count):
                out[y, x, d] = beyond


def cost_table(census_scale: float, grey_scale: float) -> NDArray[np.uint8]:
    """(63, 256) cost of (unlike bits, grey difference): each term saturates as 1 - exp(-value / scale)."""
    unlike = 1 - np.exp(-np.arange(CENSUS_COLUMNS * CENSUS_ROWS) / census_scale)
    difference = 1 - np.exp(-np.arange(256) / grey_scale)
    table: NDArray[np.uint8] = np.rint(WORST / 2 * (unlike[:, None] + difference)).astype(np.uint8)
    return table
