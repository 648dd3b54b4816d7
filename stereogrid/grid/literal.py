"""The literal reading of the paper: every ray updates every cell that it crosses, and all of them add up.

Slow, and overconfident where errors go together; kept to be compared with. A NumPy twin stands in tests/unit/grid.
"""

import math

import numpy as np
from numba import njit

from ..geometry import Array
from ..sensor_model import KernelModel
from .blocks import BLOCK

SQRT_HALF = math.sqrt(0.5)
SQRT_2PI = math.sqrt(2 * math.pi)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def evidence(u: float, half: float, model: KernelModel) -> float:
    """Log-odds that one reading adds to a cell u sigmas behind the surface, half a cell being `half` sigmas."""
    p_free, p_occupied, prior, printed, _, _ = model
    if printed:
        # Eqs. 11 and 12 as they stand, k = cell; what exceeds 1 cannot be fused and is cut off just below it.
        side = p_free if u < 0 else 0.5
        peak = 0.5 + 2 * half / SQRT_2PI
        p = side + (peak - side) * math.exp(-0.5 * u * u)
        p = min(p, 1 - 1e-6)
        return math.log(p / (1 - p)) + math.log(prior / (1 - prior))
    odds = prior / (1 - prior)
    hit, passed = p_occupied / (1 - p_occupied) / odds, p_free / (1 - p_free) / odds
    within, before = 0.5 * math.erfc(-(u + half) * SQRT_HALF), 0.5 * math.erfc(-(u - half) * SQRT_HALF)
    return math.log(passed + (hit - passed) * within - (hit - 1) * before)


@njit(cache=True, nogil=True, error_model="numpy")
def sum_rays(
    lookup: Array, origin: Array, pose: Array, camera: Array, image: Array, model: KernelModel, out: Array
) -> None:
    """Adds to out (B, 8, 8, 8), NaN = untouched, the evidence of every valid pixel for every cell on its ray.

    lookup (X, Y, Z) int64 gives a block's row in out, -1 = not in view; origin (3,) int64 is the block index of
    lookup[0, 0, 0]; pose (4, 4) T_world_cam; camera: focal, cx, cy, focal * baseline, cell, largest range; image
    (H, W, 2): d and d / dd, NaN = no match; model: kernel_parameters(). Cells are visited in order along the ray
    (Amanatides and Woo 1987), up to where nothing more is learnt behind the measured surface; each is judged at the
    point of the ray nearest to its centre.
    """
    focal, cx, cy, focal_baseline, cell, range_max = camera
    free, reach, reach_behind = evidence(-1e6, 0.0, model), model[4], model[5]
    step, cross = np.empty(3, np.int64), np.empty(3)
    stride, at, direction = np.empty(3), np.empty(3, np.int64), np.empty(3)
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            disparity, ratio = image[row, column, 0], image[row, column, 1]
            if not disparity > 0:
                continue
            x, y = (column - cx) / focal, (row - cy) / focal
            norm = math.sqrt(x * x + y * y + 1)
            measured = focal_baseline / disparity * norm
            sigma = measured / ratio
            for axis in range(3):
                direction[axis] = (pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2]) / norm
                at[axis] = math.floor(pose[axis, 3] / cell)
                step[axis] = 1 if direction[axis] > 0 else -1
                stride[axis] = cell / abs(direction[axis])
                ahead = (at[axis] + (direction[axis] > 0)) * cell - pose[axis, 3]
                cross[axis] = ahead / direction[axis] if direction[axis] != 0 else np.inf
            end = min(measured + 0.5 * cell + reach_behind * sigma, range_max)
            entry = 0.0
            while entry < end:
                axis = 0 if cross[0] < cross[1] else 1
                if cross[2] < cross[axis]:
                    axis = 2
                along = 0.0
                for other in range(3):
                    along += direction[other] * ((at[other] + 0.5) * cell - pose[other, 3])
                if cell <= along <= range_max:
                    u, half = (along - measured) / sigma, 0.5 * cell / sigma
                    _add(lookup, origin, at, free if u <= -half - reach else evidence(u, half, model), out)
                entry = cross[axis]
                cross[axis] += stride[axis]
                at[axis] += step[axis]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add(lookup: Array, origin: Array, at: Array, gain: float, out: Array) -> None:
    a, b, c = at[0] // BLOCK - origin[0], at[1] // BLOCK - origin[1], at[2] // BLOCK - origin[2]
    if 0 <= a < lookup.shape[0] and 0 <= b < lookup.shape[1] and 0 <= c < lookup.shape[2]:
        block = lookup[a, b, c]
        if block >= 0:
            old = out[block, at[0] % BLOCK, at[1] % BLOCK, at[2] % BLOCK]
            out[block, at[0] % BLOCK, at[1] % BLOCK, at[2] % BLOCK] = gain if np.isnan(old) else old + gain
