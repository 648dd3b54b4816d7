"""NumPy twins of the grid's Numba kernels: the same meaning, written in metres from the formulas of sensor_model.

Nothing here is shared with the kernels but the size of a block.
"""

import numpy as np

from stereogrid import as_printed
from stereogrid.grid.blocks import BLOCK
from stereogrid.sensor_model import SensorModel, likelihood_ratio, log_odds, occupancy_probability


def gain(range_m, measured_m, sigma_m, cell_m, parameters):
    """Log-odds that a reading adds to cells at range_m on its ray. Eqs. 3, 11 and 12, corrected or in print."""
    p_free, p_occupied, prior, printed = parameters[:4]
    if not printed:
        model = SensorModel(p_free=p_free, p_occupied=p_occupied, prior=prior)
        p = occupancy_probability(range_m, measured_m, sigma_m, cell_m=cell_m, model=model)
        return log_odds(p) - log_odds(prior)
    p = as_printed.occupancy_probability(range_m, measured_m, sigma_m, k_m=cell_m, p_min=p_free)
    return as_printed.fuse(0.0, np.minimum(p, 1 - 1e-6), prior)


def _row(lookup, origin, cell):
    block = np.asarray(cell) // BLOCK - origin
    if (block < 0).any() or (block >= lookup.shape).any():
        return -1
    return lookup[tuple(block)]


def sum_rays(lookup, origin, pose, camera, image, model, out):
    """Finds the cells of a ray from its sorted crossings with all planes between cells."""
    focal, cx, cy, focal_baseline, cell_m, max_range_m = camera
    eye = pose[:3, 3]
    for row, column in np.argwhere(image[..., 0] > 0):
        disparity, ratio = image[row, column].astype(np.float64)
        ray = np.array([(column - cx) / focal, (row - cy) / focal, 1.0])
        norm = np.linalg.norm(ray)
        measured_m = focal_baseline / disparity * norm
        sigma_m = measured_m / ratio
        reach_m = 0.5 * cell_m + model[4] * sigma_m
        end_m = min(measured_m + 0.5 * cell_m + model[5] * sigma_m, max_range_m)
        direction = pose[:3, :3] @ ray / norm
        crossings = [0.0]
        for axis in range(3):
            low, high = sorted((eye[axis], eye[axis] + end_m * direction[axis]))
            planes = np.arange(np.ceil(low / cell_m), np.floor(high / cell_m) + 1) * cell_m
            crossings.extend((planes - eye[axis]) / direction[axis])
        borders = np.append(np.sort(crossings), end_m)
        middles = (borders[1:] + borders[:-1]) / 2
        for cell in np.floor((eye + middles[:, None] * direction) / cell_m).astype(int):
            along_m = ((cell + 0.5) * cell_m - eye) @ direction
            at = (_row(lookup, origin, cell), *(cell % BLOCK))
            if at[0] >= 0 and cell_m <= along_m <= max_range_m:
                learnt = gain(along_m, measured_m, sigma_m, cell_m, model)
                if along_m - measured_m <= -reach_m:
                    learnt = log_odds(model[0]) + (log_odds(model[2]) if model[3] else -log_odds(model[2]))
                out[at] = learnt if np.isnan(out[at]) else out[at] + np.float32(learnt)


# The pyramid and the sweep


def merged_node(children, *, gate_sigmas, slope):
    """(d, sigma, variance between the children, pixels) of up to four children (d, sigma, _, pixels); d = 0: none."""
    near = max(child[0] for child in children)
    kept = [c for c in children if c[3] and c[0] >= near - gate_sigmas * c[1] - slope * near]
    if not kept:
        return 0.0, 0.0, 0.0, 0
    d, sigma, _, pixels = np.array(kept, dtype=np.float64).T
    mean = np.average(d, weights=pixels)
    return mean, np.average(sigma, weights=pixels), np.average((d - mean) ** 2, weights=pixels), pixels.sum()


def levels(disparity_px, sigma_px, focal_px, *, gate_sigmas, steepest):
    """The levels of the pyramid, finest first, each (h, w, 4) of (d, sigma, variance, pixels)."""
    valid = disparity_px > 0
    bottom = np.stack([np.where(valid, a, 0) for a in (disparity_px, sigma_px, 0 * sigma_px, valid * 1.0)], axis=-1)
    found = [np.nan_to_num(bottom).astype(np.float64)]
    while min(found[-1].shape[:2]) >= 8:
        below = found[-1]
        h, w = below.shape[:2]
        slope = steepest / focal_px * 2 ** len(found)
        up = np.zeros(((h + 1) // 2, (w + 1) // 2, 4))
        for row, column in np.ndindex(up.shape[:2]):
            rows, columns = ([2 * n, min(2 * n + 1, size - 1)] for n, size in ((row, h), (column, w)))
            children = [below[r, c] for r in rows for c in columns]
            up[row, column] = merged_node(children, gate_sigmas=gate_sigmas, slope=slope)
        found.append(up)
    return found


def bfloat16(x):
    """x to the nearest bfloat16, as the pyramid stores it."""
    bits = (np.asarray(x, np.float32).view(np.int32) + 0x8000) & -65536
    return bits.astype(np.int32).view(np.float32).astype(np.float64)


def readings(level, camera, model, *, correlation_px, eps_m, relief_of_noise, least_certainty, motion_rule="rss"):
    """d, width of d and relief of d of the nodes of a level, each (h, w) [px]; NaN where invalid."""
    d, sigma, between, pixels = np.moveaxis(level, -1, 0)
    looks = np.maximum(pixels / correlation_px**2, 1)
    of_child = np.maximum(pixels / 4 / correlation_px**2, 1)
    motion = eps_m * d**2 / camera.focal_baseline_px_m
    width = sigma / np.sqrt(looks)
    width = width + motion if motion_rule == "linear" else np.hypot(width, motion)
    noise = (relief_of_noise[0] + relief_of_noise[1] * (1 - 1 / looks)) * sigma**2 / of_child
    relief = 2 * np.sqrt(np.maximum(between - noise, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        q, r = bfloat16(d / width), bfloat16(relief / width)
        valid = d >= least_certainty * width
        return [np.where(valid & (d > 0), each, np.nan) for each in (d, d / q, r * d / q)]


def sweep(cells, camera, T_world_cam, level_readings, model, *, cell_m, correlation_px, exponent, reach_behind):
    """Evidence [nat] (N,) of one observation for cells (N, 3), NaN where nothing is learnt."""
    points = ((cells + 0.5) * cell_m - T_world_cam[:3, 3]) @ T_world_cam[:3, :3]
    ranges = np.linalg.norm(points, axis=1)
    z = np.maximum(points[:, 2], cell_m)
    u, v = (camera.focal_px * points[:, a] / z + c for a, c in ((0, camera.cx_px), (1, camera.cy_px)))
    seen = (points[:, 2] >= cell_m) & (ranges <= model.max_range_m)
    seen &= (u >= -0.5) & (u < camera.width_px - 0.5) & (v >= -0.5) & (v < camera.height_px - 0.5)
    side_px = camera.focal_px * cell_m / z
    level_of = np.clip(np.floor(np.log2(side_px)), 0, len(level_readings) - 1).astype(int)
    found = np.full(len(cells), np.nan)
    for level in np.unique(level_of[seen]):
        mine = np.flatnonzero(seen & (level_of == level))
        evidence = _at_level(
            level_readings[level],
            (u[mine], v[mine]),
            2**level,
            side_px[mine],
            (ranges[mine], z[mine]),
            camera,
            model,
            cell_m,
            reach_behind,
        )
        found[mine] = max(1.0, 2 * 4**level / correlation_px**2) ** exponent * evidence
    return found


def _at_level(reading, pixels, node_px, side_px, depths, camera, model, cell_m, reach_behind):
    (d, width, relief), (u, v), (ranges, z) = reading, pixels, depths
    column, row = (
        np.clip(np.floor((x + 0.5) / node_px - 0.5), 0, size - 2).astype(int)
        for x, size in ((u, d.shape[1]), (v, d.shape[0]))
    )
    shares = [overlaps(x, node_px, n, side_px / node_px) for x, n in ((v, row), (u, column))]
    total, weight, known = np.zeros(len(u)), np.zeros(len(u)), np.zeros(len(u), bool)
    for i, j in np.ndindex(2, 2):
        at = row + i, column + j
        valid = ~np.isnan(d[at])
        measured = camera.focal_baseline_px_m / d[at] * ranges / z
        sigma_m = measured * width[at] / d[at]
        # The surface reaches over the relief: a cell as much larger would hold it as surely.
        grown_m = cell_m + 2 * relief[at] / width[at] * sigma_m
        ratio = likelihood_ratio(ranges, measured, sigma_m, cell_m=grown_m, model=model)
        shown = valid & ((ranges - measured) / sigma_m - grown_m / 2 / sigma_m <= reach_behind)
        share = valid * np.maximum(shares[0][i] * shares[1][j], 0.01)
        total += share * np.where(shown, np.nan_to_num(ratio), 1)
        weight += share
        known |= shown
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(known, np.log(total / weight), np.nan)


def overlaps(x_px, node_px, first, side):
    """Shares (2, N) of a footprint of `side` nodes around x_px that lie in node `first` and the next along an axis."""
    middle = (x_px + 0.5) / node_px - 0.5 - first
    inside = np.clip(middle, 0, 1)
    half = np.maximum(side, 1.0) / 2
    lengths = [
        np.clip(np.minimum(inside + half, n + 0.5) - np.maximum(inside - half, n - 0.5), 0, None) for n in (0, 1)
    ]
    return np.array(lengths) / np.sum(lengths, axis=0)


# The mean over poses


def mean_over_poses(told, weights, weight):
    """Evidence [nat] (N,) of the mean ratio of poses that tell (K, N) [nat], NaN = nothing; nothing where all do."""
    # Ratios of e^128 are no trouble to float64.
    ratios = np.exp(np.where(np.isnan(told), 0.0, told))
    return np.where(np.isnan(told).all(axis=0), np.nan, weight * np.log(np.asarray(weights) @ ratios))
