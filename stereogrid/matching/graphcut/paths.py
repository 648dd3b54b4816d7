"""Semi-global aggregation of costs along eight paths: the start of the graph cuts.

H. Hirschmueller, "Stereo Processing by Semiglobal Matching and Mutual Information", IEEE PAMI 2008, Eq. 13, with
penalties that depend on the intensity step as in Mei et al. 2011.
"""

import numpy as np
from numba import njit

from ...geometry import Array

UNREACHED = 40000
"""More than any path costs, and with a penalty less than 2^16."""
PATHS = 8
"""Both sweeps together: what a total is to be divided by for the mean of the paths."""


@njit(cache=True, nogil=True, inline="always")
def step(cost: Array, before: Array, small: int, large: int, after: Array, total: Array) -> None:
    """One pixel of a path: after = cost + the cheapest way from before; adds it to total (D,).

    before, after (D + 3,): costs at 1 .. D, very large ones on both sides, their minimum at D + 2.
    """
    count = len(cost)
    lowest = before[count + 2]
    cap, rise = np.uint16(lowest + np.uint16(large)), np.uint16(small)
    least = np.uint16(65535)
    for d in range(count):
        beside = np.uint16(min(before[d], before[d + 2]) + rise)
        value = np.uint16(np.uint16(min(min(before[d + 1], cap), beside) - lowest) + cost[d])
        after[d + 1] = value
        total[d] = np.uint16(total[d] + value)
        least = min(least, value)
    after[count + 2] = least


@njit(cache=True, nogil=True, inline="always")
def is_edge(image: Array, a: tuple[int, int], b: tuple[int, int], edge: int) -> bool:
    """Whether any channel of image (H, W, channels) changes by edge or more between the pixels a and b."""
    for c in range(image.shape[2]):
        if abs(np.int64(image[a[0], a[1], c]) - np.int64(image[b[0], b[1], c])) >= edge:
            return True
    return False


@njit(cache=True, nogil=True)
def sweep(costs: Array, image: Array, rule: tuple[int, int, int, int], forward: bool, total: Array) -> None:
    """Add to total (H, W, D) uint16 the path costs from the left and the three pixels above (or, backward, mirrored).

    costs (H, W, D) uint16; image (H, W, channels) uint8; rule: the penalty of a step of one label, of more labels,
    the intensity step from which both are lower, and by how many times.
    """
    height, width, count = costs.shape
    small, large, edge, times = rule
    lines = np.full((2, 4, width + 2, count + 3), UNREACHED, np.uint16)
    lines[:, :, :, 1 : count + 1] = 0
    lines[:, :, :, count + 2] = 0
    way = 1 if forward else -1
    for i in range(height):
        y = i if forward else height - 1 - i
        now, last = lines[i % 2], lines[1 - i % 2]
        for j in range(width):
            x = j if forward else width - 1 - j
            for k in range(4):
                fy, fx = (y, x - way) if k == 0 else (y - way, x + k - 2)
                p1, p2 = small, large
                if 0 <= fy < height and 0 <= fx < width and is_edge(image, (y, x), (fy, fx), edge):
                    p1, p2 = small // times, large // times
                before = now[0, fx + 1] if k == 0 else last[k, fx + 1]
                step(costs[y, x], before, p1, p2, now[k, x + 1], total[y, x])
