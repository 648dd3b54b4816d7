"""A good labelling to start from: sequential tree-reweighted message passing, then one match a right pixel.

Kolmogorov, "Convergent tree-reweighted message passing for energy minimization" (PAMI 2006), on the energy without
uniqueness; labels 0 .. L - 1 and, last, unmatched.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...geometry import Array
from .cost import NO_ASSIGNMENT, Energy
from .moves import UNMATCHED

NEVER = 1 << 16
"""Cost of a match outside the right image: more than any other."""


class Grid(NamedTuple):
    """What the sweeps read and write; pairs are for horizontal and for vertical edges.

    cost (H, W, L) int32; edge (H, W) bool: the left image is flat there; penalty (H, W + L) int32: lambda of the right
    image's edges, columns reversed so that labels run forward; message (H, W, L + 1) int32: on the edge to the right
    of a pixel or below it; other: lambda at an edge of the left image.
    """

    cost: Array
    edge: tuple[Array, Array]
    penalty: tuple[Array, Array]
    message: tuple[Array, Array]
    other: np.int32


def good_start(energy: Energy, sweeps: int = 2) -> NDArray[np.int16]:
    """A labelling (H, W) int16 of low energy, no right pixel twice."""
    cost = np.ascontiguousarray(np.moveaxis(energy.cost, 0, 2)).astype(np.int32)
    cost[cost == NO_ASSIGNMENT] = NEVER
    height, width, count = cost.shape
    right, below = 1, 4  # bits of flat_edges
    grid = Grid(
        cost,
        ((energy.left_flat & right) > 0, (energy.left_flat & below) > 0),
        (_penalties(energy, right, count), _penalties(energy, below, count)),
        (np.zeros((height, width, count + 1), np.int32), np.zeros((height, width, count + 1), np.int32)),
        np.int32(energy.lambda2),
    )
    for _ in range(sweeps):
        _sweep(grid, True)
        _sweep(grid, False)
    label = np.empty((height, width), np.int16)
    _choose(grid, label)
    return label


def _penalties(energy: Energy, bit: int, count: int) -> NDArray[np.int32]:
    flat = (energy.right_flat[:, ::-1] & bit) > 0
    penalty = np.full((flat.shape[0], flat.shape[1] + count), energy.lambda2, np.int32)
    penalty[:, : flat.shape[1]] = np.where(flat, energy.lambda1, energy.lambda2)
    return penalty


@njit(cache=True, nogil=True)
def _sweep(grid: Grid, forward: bool) -> None:
    """Pass messages from each pixel to those that come after it, row by row."""
    height, width, count = grid.cost.shape
    total, part = np.empty(count + 1, np.int32), np.empty(count + 1, np.int32)
    for i in range(height):
        y = i if forward else height - 1 - i
        for j in range(width):
            x = j if forward else width - 1 - j
            _gather(grid, y, x, total)
            for axis in range(2):
                ey, ex = (y, x) if forward else (y - (axis == 1), x - (axis == 0))
                if ey < 0 or ex < 0 or (axis == 0 and ex + 1 >= width) or (axis == 1 and ey + 1 >= height):
                    continue
                message = grid.message[axis][ey, ex]
                for d in range(count + 1):
                    part[d] = (total[d] >> 1) - message[d]
                # The right edge of match d is at column ex - d, or with columns reversed at width - 1 - ex + d.
                _send(part, grid.penalty[axis][ey, width - 1 - ex :], (grid.edge[axis][ey, ex], grid.other), message)


@njit(cache=True, nogil=True)
def _gather(grid: Grid, y: int, x: int, total: Array) -> None:
    height, width, count = grid.cost.shape
    for d in range(count):
        total[d] = grid.cost[y, x, d]
    total[count] = 0
    for axis in range(2):
        for back in range(2):
            ey, ex = y - (axis == 1) * back, x - (axis == 0) * back
            if ey >= 0 and ex >= 0 and (axis == 1 or ex + 1 < width) and (axis == 0 or ey + 1 < height):
                message = grid.message[axis][ey, ex]
                for d in range(count + 1):
                    total[d] += message[d]


@njit(cache=True, nogil=True)
def _send(part: Array, penalty: Array, left: tuple[bool, np.int32], message: Array) -> None:
    """message[d'] = min over d of part[d] + lambda(d) + lambda(d') where they differ; its minimum is made 0."""
    (flat, other), count = left, part.size - 1
    least = part[count]
    for d in range(count):
        least = min(least, part[d] + (penalty[d] if flat else other))
    lowest = least
    for d in range(count):
        value = min(part[d], least + (penalty[d] if flat else other))
        message[d] = value
        lowest = min(lowest, value)
    for d in range(count):
        message[d] -= lowest
    message[count] = least - lowest


@njit(cache=True, nogil=True)
def _choose(grid: Grid, label: Array) -> None:
    """Labels one by one, each the best given those before it and the messages of those after it; then made unique."""
    height, width, count = grid.cost.shape
    total = np.empty(count + 1, np.int32)
    for y in range(height):
        for x in range(width):
            for d in range(count):
                total[d] = grid.cost[y, x, d]
            total[count] = 0
            for axis in range(2):
                if (axis == 0 and x + 1 < width) or (axis == 1 and y + 1 < height):
                    message = grid.message[axis][y, x]
                    for d in range(count + 1):
                        total[d] += message[d]
                ey, ex = y - (axis == 1), x - (axis == 0)
                if ey >= 0 and ex >= 0:
                    _add_differences(grid, (axis, ey, ex), label[ey, ex], total)
            best = np.argmin(total)
            label[y, x] = best if best < count and best <= x else UNMATCHED
        _make_unique(label[y])


@njit(cache=True, nogil=True)
def _add_differences(grid: Grid, edge: tuple[int, int, int], given: int, total: Array) -> None:
    """Add lambda to the labels that differ from the one given at the other end of the edge (axis, row, column)."""
    (axis, ey, ex), count = edge, total.size - 1
    penalty = grid.penalty[axis][ey, grid.cost.shape[1] - 1 - ex :]
    flat = grid.edge[axis][ey, ex]
    own = np.int32(0)
    if given >= 0:
        own = penalty[given] if flat else grid.other
    for d in range(count):
        if d != given:
            total[d] += own + (penalty[d] if flat else grid.other)
    if given >= 0:
        total[count] += own


@njit(cache=True, nogil=True)
def _make_unique(label: Array) -> None:
    """Of two matches of a right pixel the nearer stays: the farther surface is the one that may be hidden."""
    owner = np.full(label.size, UNMATCHED, np.int32)
    for x in range(label.size):
        if label[x] >= 0:
            q = x - label[x]
            if owner[q] >= 0:  # of the same right pixel, the match further to the right is the nearer one
                label[owner[q]] = UNMATCHED
            owner[q] = x
