"""Means of the costs along the row, over the pixels that look like the one in the middle.

The weights fall with the change of intensity and with the distance (K.-J. Yoon and I. S. Kweon, "Adaptive
Support-Weight Approach for Correspondence Search", IEEE PAMI 2006). Only along the row: the paths of paths.py join
the rows, and a window that is high as well would make steps of slanted floors. NumPy twins stand in the tests.
"""

import numpy as np
from numba import njit

from ...geometry import Array

SCALE = 8
"""Means are kept in eighths of the unit of the cost, so that rounding does not show between pixels."""
SMALLEST = 0.02
"""A weight below it ends the window on that side: what lies beyond an edge of the image need not be visited."""


@njit(cache=True, nogil=True)
def tap_weights(row: Array, tables: tuple[Array, Array], out: Array) -> None:
    """Write into out (W, 2 reach + 1) float32 how much the pixels from -reach to +reach count for each of a row.

    row (W, channels) uint8; tables: the weight of a change of intensity 0 .. 255 and of a distance 0 .. reach. The
    change is the largest on the way, and half of it if only from one pixel to the next. 0 outside the image.
    """
    by_change, by_distance = tables
    width, reach = len(row), len(by_distance) - 1
    out[:] = 0
    for x in range(width):
        out[x, reach] = 1
        for side in (-1, 1):
            worst = np.int64(0)
            for k in range(1, reach + 1):
                u = x + side * k
                if u < 0 or u >= width:
                    break
                for c in range(row.shape[1]):
                    worst = max(worst, abs(np.int64(row[u, c]) - np.int64(row[x, c])))
                    worst = max(worst, abs(np.int64(row[u, c]) - np.int64(row[u - side, c])) // 2)
                if by_change[worst] == 0:
                    break
                out[x, reach + side * k] = by_change[worst] * by_distance[k]


@njit(cache=True, nogil=True)
def read_line(costs: Array, mirrored: bool, beyond: int, out: Array) -> None:
    """Copy a row (W, D) of left costs to out (W, D) float32; mirrored: as the right image's, where x - d is x."""
    width, count = costs.shape
    for x in range(width):
        if not mirrored:
            for d in range(count):
                out[x, d] = np.float32(costs[x, d])
            continue
        shown = min(count, width - x)
        for d in range(shown):
            out[x, d] = np.float32(costs[x + d, d])
        for d in range(shown, count):
            out[x, d] = np.float32(beyond)


@njit(cache=True, nogil=True)
def line_means(
    costs: Array, image: Array, tables: tuple[Array, Array], view: tuple[bool, int, float], out: Array
) -> None:
    """Write into out (H, W, D) uint16 the weighted means of the costs (H, W, D) uint8 along the rows, times the gain.

    image (H, W, channels) gives the weights of tables; view: whether that image is the right one (mirrored costs),
    the cost of what the other image does not show, gain.
    """
    height, width, count = costs.shape
    mirrored, beyond, gain = view
    reach = len(tables[1]) - 1
    weights = np.empty((width, 2 * reach + 1), np.float32)
    line, mean = np.empty((width, count), np.float32), np.empty(count, np.float32)
    for y in range(height):
        tap_weights(image[y], tables, weights)
        read_line(costs[y], mirrored, beyond, line)
        for x in range(width):
            mean[:] = 0
            total = np.float32(0)
            for k in range(max(-reach, -x), min(reach, width - 1 - x) + 1):
                weight = weights[x, reach + k]
                if weight == 0:
                    continue
                total += weight
                tap = line[x + k]
                for d in range(count):
                    mean[d] += weight * tap[d]
            share = np.float32(gain) / total
            for d in range(count):
                out[y, x, d] = np.uint16(mean[d] * share + np.float32(0.5))


def weight_tables(reach_px: int, intensity_scale: float, distance_scale_px: float) -> tuple[Array, Array]:
    """(256,) and (reach + 1,) float32 weights exp(-value / scale); a change that hardly counts does not at all."""
    by_change = np.exp(-np.arange(256) / intensity_scale)
    by_change[by_change < SMALLEST] = 0
    by_distance = np.exp(-np.arange(reach_px + 1) / distance_scale_px)
    return by_change.astype(np.float32), by_distance.astype(np.float32)
