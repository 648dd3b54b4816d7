"""The hot loops of the map, in disparity space. NumPy twins stand in tests/unit/grid.

For a cell at depth z on the ray of a pixel with disparity d and width dd, (z - z_p) / dz_p of Eqs. 8 to 12 is
u = (d / dd) (d z / (f b) - 1): no division is left for the cell, and dd may carry eps of Eq. 13.

All of them stand in this file: Numba's cache does not notice when a function inlined from another file changes.
"""

import math

import numpy as np
from numba import njit

from ..geometry import Array
from ..sensor_model import KernelModel

BLOCK = 16
"""Cells along the edge of a block."""

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
    side = p_free if u < 0 else prior
    gap = max(abs(u) - half, 0.0)
    weight = math.exp(-0.5 * gap * gap)
    hit = 0.5 * (math.erf((u + half) * SQRT_HALF) - math.erf((u - half) * SQRT_HALF))
    p = (1 - weight) * side + weight * (prior + (p_occupied - prior) * hit)
    return math.log(p / (1 - p)) - math.log(prior / (1 - prior))


@njit(cache=True, nogil=True, error_model="numpy")
def sweep_cells(blocks: Array, pose: Array, camera: Array, image: Array, model: KernelModel, out: Array) -> None:
    """Write into out (B, 16, 16, 16) the evidence that the pixel under each cell's centre has for the cell.

    blocks (B, 3) int64 block indices; pose (4, 4) T_world_cam; camera: focal, cx, cy, focal * baseline, cell,
    largest range; image (H, W, 2): d and d / dd, NaN = no match; model: kernel_parameters().
    Cells out of view, on unmatched pixels or hidden stay as they are.
    """
    focal, cx, cy, focal_baseline, cell, range_max = camera
    height, width = image.shape[:2]
    free, reach, reach_behind = evidence(-1e6, 0.0, model), model[4], model[5]
    for b in range(len(blocks)):
        for i in range(BLOCK):
            x = (blocks[b, 0] * BLOCK + i + 0.5) * cell - pose[0, 3]
            for j in range(BLOCK):
                y = (blocks[b, 1] * BLOCK + j + 0.5) * cell - pose[1, 3]
                for k in range(BLOCK):
                    z = (blocks[b, 2] * BLOCK + k + 0.5) * cell - pose[2, 3]
                    depth = pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z
                    if depth < cell:
                        continue
                    scale = focal / depth
                    column = scale * (pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z) + cx
                    row = scale * (pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z) + cy
                    if not (-0.5 <= column < width - 0.5 and -0.5 <= row < height - 0.5):
                        continue
                    square_range = x * x + y * y + z * z
                    if square_range > range_max * range_max:
                        continue
                    pixel = image[int(row + 0.5), int(column + 0.5)]
                    disparity, ratio = pixel[0], pixel[1]
                    u = ratio * (disparity * depth / focal_baseline - 1)
                    # Half a cell in sigmas along the ray: dl = (f b / d) (dd / d) range / depth.
                    half = 0.5 * cell * ratio * disparity * depth / (focal_baseline * math.sqrt(square_range))
                    if u <= -half - reach:
                        out[b, i, j, k] = free
                    elif u < half + reach_behind:
                        out[b, i, j, k] = evidence(u, half, model)


@njit(cache=True, nogil=True, error_model="numpy")
def vote_hits(
    lookup: Array, origin: Array, pose: Array, camera: Array, image: Array, model: KernelModel, out: Array
) -> None:
    """Let each match vote for the cell that its point falls in: the strongest vote of a cell replaces weaker evidence.

    A near cell covers many pixels and the sweep reads one; a ray that grazes a floor may pass over the one
    that hits it. lookup (X, Y, Z) int64 gives a block's row in out, -1 = not in view; origin (3,) int64 is the
    block index of lookup[0, 0, 0]; the rest as in sweep_cells.
    """
    focal, cx, cy, focal_baseline, cell, range_max = camera
    height, width = image.shape[:2]
    for row in range(height):
        for column in range(width):
            disparity, ratio = image[row, column, 0], image[row, column, 1]
            if not disparity > 0:
                continue
            depth = focal_baseline / disparity
            x, y = (column - cx) / focal * depth, (row - cy) / focal * depth
            range_m = math.sqrt(x * x + y * y + depth * depth)
            if range_m > range_max:
                continue
            i = math.floor((pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * depth + pose[0, 3]) / cell)
            j = math.floor((pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * depth + pose[1, 3]) / cell)
            k = math.floor((pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * depth + pose[2, 3]) / cell)
            a, b, c = i // BLOCK - origin[0], j // BLOCK - origin[1], k // BLOCK - origin[2]
            if not (0 <= a < lookup.shape[0] and 0 <= b < lookup.shape[1] and 0 <= c < lookup.shape[2]):
                continue
            block = lookup[a, b, c]
            if block < 0:
                continue
            vote = evidence(0.0, 0.5 * cell * ratio / range_m, model)
            old = out[block, i % BLOCK, j % BLOCK, k % BLOCK]
            if not old >= vote:
                out[block, i % BLOCK, j % BLOCK, k % BLOCK] = vote


@njit(cache=True, nogil=True, error_model="numpy")
def add_evidence(rows: Array, out: Array, log_odds: Array, n_updates: Array, clamp: float) -> None:
    """Eq. 3: add block n of out, NaN = nothing learnt, to block rows[n] of log_odds, within +-clamp; count."""
    for n in range(len(rows)):
        old, new, count = log_odds[rows[n]], out[n], n_updates[rows[n]]
        for i in range(BLOCK):
            for j in range(BLOCK):
                for k in range(BLOCK):
                    if not np.isnan(new[i, j, k]):
                        old[i, j, k] = min(max(old[i, j, k] + new[i, j, k], -clamp), clamp)
                        count[i, j, k] = min(count[i, j, k] + 1, 65535)


@njit(cache=True, nogil=True, error_model="numpy")
def sum_rays(
    lookup: Array, origin: Array, pose: Array, camera: Array, image: Array, model: KernelModel, out: Array
) -> None:
    """The literal reading of the paper: every ray updates every cell that it crosses, and all of them add up.

    Adds to out (B, 16, 16, 16), NaN = untouched, the evidence of every valid pixel for every cell on its ray.

    Arguments as in vote_hits. Cells are visited in order along the ray (Amanatides and Woo 1987), up to
    where nothing more is learnt behind the measured surface; each is judged at the point of the ray nearest to
    its centre.
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
