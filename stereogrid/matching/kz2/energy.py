"""The energy of a labelling, in the units of the reference: 0 when nothing is matched."""

import numpy as np
from numba import njit

from ...geometry import Array
from .cost import Energy


@njit(cache=True, nogil=True)
def total_energy(energy: Energy, label: Array) -> np.int64:
    """E of labels (H, W) int16, unmatched < 0; a neighbour whose match would leave the image counts nothing."""
    height, width = label.shape
    total = np.int64(0)
    for y in range(height):
        for x in range(width):
            d = label[y, x]
            if d < 0:
                continue
            total += energy.cost[d, y, x]
            flat = energy.left_flat[y, x] & energy.right_flat[y, x - d]
            for arc in range(4):
                ny, nx = y + (arc == 2) - (arc == 3), x + (arc == 0) - (arc == 1)
                if 0 <= ny < height and d <= nx < width and label[ny, nx] != d:
                    total += energy.lambda1 if (flat >> arc) & 1 else energy.lambda2
    return total
