"""What both images show, and what is hidden in one: the labellings of the left and the right image, compared.

A left pixel x of label d is the right pixel x - d. If that one has the same label, both agree. If it has a larger
one, something nearer stands there: x may be hidden. If it has a smaller one, the right image sees through x: it
cannot have label d. J. Sun, Y. Li, S. B. Kang and H.-Y. Shum, "Symmetric Stereo Matching for Occlusion Handling",
CVPR 2005 (the visibility constraint).
"""

import numpy as np
from numba import njit

from ...geometry import Array


@njit(cache=True, nogil=True)
def agreement(left: Array, right: Array, tolerance: int, out: Array) -> None:
    """Write into out (H, W) bool where left labels (H, W) and right labels differ by the tolerance at most."""
    height, width = left.shape
    for y in range(height):
        for x in range(width):
            d = left[y, x]
            out[y, x] = x >= d and abs(np.int64(right[y, x - d]) - d) <= tolerance


@njit(cache=True, nogil=True)
def fill_from_farther(agreed: Array, labels: Array) -> None:
    """Give each pixel that is not agreed the smaller of the nearest agreed labels left and right on its row."""
    height, width = labels.shape
    for y in range(height):
        x, before = 0, -1
        while x < width:
            if agreed[y, x]:
                before, x = labels[y, x], x + 1
                continue
            end = x
            while end < width and not agreed[y, end]:
                end += 1
            after = labels[y, end] if end < width else before
            value = after if before < 0 else min(before, after)
            if value >= 0:
                labels[y, x:end] = value
            x = end


@njit(cache=True, nogil=True)
def constrain(costs: Array, right: Array, agreed: Array, rule: tuple[int, int, int]) -> None:
    """Change costs (H, W, D) uint16 in place where not agreed (H, W), after the labels right (H, W) of the other image.

    rule: tolerance, the cost of a label that would be hidden, the least cost of one that would be seen through.
    """
    tolerance, hidden, through = rule
    height, width, count = costs.shape
    for y in range(height):
        for x in range(width):
            if agreed[y, x]:
                continue
            for d in range(count):
                nearer = np.int64(right[y, x - d]) - d if x >= d else count
                if nearer > tolerance:
                    costs[y, x, d] = hidden
                elif nearer < -tolerance:
                    costs[y, x, d] = max(costs[y, x, d], through)


@njit(cache=True, nogil=True)
def hidden_pixels(labels: Array, tolerance: int, out: Array) -> None:
    """Write into out (H, W) bool which pixels are hidden in the other image if labels (H, W) are right.

    Hidden: beyond its edge, or where a pixel whose label is larger by more than the tolerance falls on the same one.
    """
    height, width = labels.shape
    nearest = np.empty(width, np.int64)
    for y in range(height):
        nearest[:] = -1
        for x in range(width):
            if x >= labels[y, x]:
                nearest[x - labels[y, x]] = max(nearest[x - labels[y, x]], labels[y, x])
        for x in range(width):
            out[y, x] = x < labels[y, x] or nearest[x - labels[y, x]] > labels[y, x] + tolerance
