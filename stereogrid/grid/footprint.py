"""Where a block of cells falls in the image, and what the pyramid's nodes there have in common.

The sweep has these compiled into its kernel, and Numba's cache does not notice when another file changes: after a
change here, remove the package's __pycache__.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from ..geometry import Array
from .blocks import BLOCK, CELLS


@njit(cache=True, nogil=True, error_model="numpy")
def to_cam(pose: Array, i: int, j: int, k: int, cell: float) -> tuple[float, float, float]:
    """The centre of the first cell of a block, in cam."""
    x, y, z = (i * BLOCK + 0.5) * cell, (j * BLOCK + 0.5) * cell, (k * BLOCK + 0.5) * cell
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def cell_offsets(pose: Array, cell: float) -> Array:
    """(3, 512) float32: from the first cell of a block to each, in cam."""
    offsets = np.empty((3, CELLS), np.float32)
    for axis in range(3):
        for c in range(CELLS):
            i, j, k = c // (BLOCK * BLOCK), c // BLOCK % BLOCK, c % BLOCK
            offsets[axis, c] = (pose[axis, 0] * i + pose[axis, 1] * j + pose[axis, 2] * k) * cell
    return offsets


@njit(cache=True, nogil=True, error_model="numpy")
def rectangle(corner: Any, offsets: Array, camera: Any, scale: float, size: Any, rect: Array) -> bool:
    """Fill rect with the first and last row and column of the nodes that a block's cells read; first > last: none.

    Returns whether all of its cells are in the image.
    """
    focal, cx, cy, width, height = camera
    left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    last = BLOCK - 1
    for n in range(8):
        c = (n & 1) * last + (n >> 1 & 1) * last * BLOCK + (n >> 2) * last * BLOCK * BLOCK
        depth = corner[2] + offsets[2, c]
        u, v = focal * (corner[0] + offsets[0, c]) / depth + cx, focal * (corner[1] + offsets[1, c]) / depth + cy
        left, right, top, bottom = min(left, u), max(right, u), min(top, v), max(bottom, v)
    if right < -0.5 or left >= width - 0.5 or bottom < -0.5 or top >= height - 0.5:
        rect[0], rect[1] = 1, 0
        return False
    # A node to spare on each side: the cells are projected again in float32.
    rect[0] = min(max(math.floor((top + 0.5) * scale - 0.51), 0), size[0] - 2)
    rect[1] = min(math.floor((bottom + 0.5) * scale - 0.49) + 1, size[0] - 1)
    rect[2] = min(max(math.floor((left + 0.5) * scale - 0.51), 0), size[1] - 2)
    rect[3] = min(math.floor((right + 0.5) * scale - 0.49) + 1, size[1] - 1)
    rect[1], rect[3] = max(rect[1], rect[0] + 1), max(rect[3], rect[2] + 1)
    edge = 1e-3
    return left >= edge - 0.5 and right < width - 0.5 - edge and top >= edge - 0.5 and bottom < height - 0.5 - edge


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz"})
def extent(windows: Array, first: int, w: int, rect: Array, depths: Any) -> Any:
    """The least depth up to which the windows of rect show free space, the largest from which they say nothing, and
    whether each of them has a reading. Ends early where depths (from, to) are neither free nor hidden as a whole.
    """
    least, most, fewest = np.float32(np.inf), np.float32(-np.inf), np.float32(np.inf)
    for row in range(rect[0], rect[1]):
        begin, end = first + row * w + rect[2], first + row * w + rect[3]
        of_row = windows[begin:end]
        for n in range(len(of_row)):
            least = min(least, of_row[n, 0])
            most = max(most, of_row[n, 1])
            fewest = min(fewest, of_row[n, 1])
        if depths[0] <= most and depths[1] > least:
            break
    return least, most, fewest > 0
