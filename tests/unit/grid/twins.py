"""NumPy twins of the grid's Numba kernels: the same meaning, written in metres from the formulas of sensor_model.

They take the kernels' arguments and write into `out` as the kernels do. Nothing here is shared with the kernels
but the size of a block.
"""

import numpy as np

from stereogrid import as_printed
from stereogrid.grid.kernels import BLOCK
from stereogrid.sensor_model import SensorModel, log_odds, occupancy_probability


def gain(range_m, measured_m, sigma_m, cell_m, parameters):
    """Log-odds that a reading adds to cells at range_m on its ray. Eqs. 3, 11 and 12, corrected or in print."""
    p_free, p_occupied, prior, printed = parameters[:4]
    if not printed:
        model = SensorModel(p_free=p_free, p_occupied=p_occupied, prior=prior)
        p = occupancy_probability(range_m, measured_m, sigma_m, cell_m=cell_m, model=model)
        return log_odds(p) - log_odds(prior)
    p = as_printed.occupancy_probability(range_m, measured_m, sigma_m, k_m=cell_m, p_min=p_free)
    return as_printed.fuse(0.0, np.minimum(p, 1 - 1e-6), prior)


def points_in_cam(points, pose):
    return (points - pose[:3, 3]) @ pose[:3, :3]


def sweep_cells(blocks, pose, camera, image, model, out):
    focal, cx, cy, focal_baseline, cell_m, max_range_m = camera
    height, width = image.shape[:2]
    place = np.stack(np.meshgrid(*[np.arange(BLOCK)] * 3, indexing="ij"), axis=-1)
    centres = ((blocks * BLOCK)[:, None, None, None] + place + 0.5) * cell_m
    cells = points_in_cam(centres, pose)
    depth = cells[..., 2]
    in_front = depth >= cell_m
    safe = np.where(in_front, depth, 1.0)
    column, row = focal * cells[..., 0] / safe + cx, focal * cells[..., 1] / safe + cy
    seen = in_front & (column >= -0.5) & (column < width - 0.5) & (row >= -0.5) & (row < height - 0.5)
    range_m = np.linalg.norm(cells, axis=-1)
    seen &= range_m <= max_range_m
    pixel = image[np.floor(row[seen] + 0.5).astype(int), np.floor(column[seen] + 0.5).astype(int)].astype(np.float64)
    disparity, ratio = pixel[:, 0], pixel[:, 1]
    measured_m = focal_baseline / disparity * range_m[seen] / depth[seen]
    sigma_m = measured_m / ratio
    behind_m = range_m[seen] - measured_m
    reach_m = 0.5 * cell_m + model[4] * sigma_m
    learnt = gain(range_m[seen], measured_m, sigma_m, cell_m, model)
    prior = model[2]
    learnt[behind_m <= -reach_m] = log_odds(model[0]) + (log_odds(prior) if model[3] else -log_odds(prior))
    found = out[seen]
    written = behind_m < 0.5 * cell_m + model[5] * sigma_m
    found[written] = learnt[written]
    out[seen] = found


def _row(lookup, origin, cell):
    block = np.asarray(cell) // BLOCK - origin
    if (block < 0).any() or (block >= lookup.shape).any():
        return -1
    return lookup[tuple(block)]


def vote_hits(lookup, origin, pose, camera, image, model, out):
    focal, cx, cy, focal_baseline, cell_m, max_range_m = camera
    for row, column in np.argwhere(image[..., 0] > 0):
        disparity, ratio = image[row, column].astype(np.float64)
        depth = focal_baseline / disparity
        point = np.array([(column - cx) * depth / focal, (row - cy) * depth / focal, depth])
        range_m = np.linalg.norm(point)
        if range_m > max_range_m:
            continue
        cell = np.floor((pose[:3, :3] @ point + pose[:3, 3]) / cell_m).astype(int)
        at = (_row(lookup, origin, cell), *(cell % BLOCK))
        if at[0] >= 0:
            vote = gain(range_m, range_m, range_m / ratio, cell_m, model)
            out[at] = vote if np.isnan(out[at]) else max(out[at], np.float32(vote))


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


def add_evidence(rows, out, log_odds, n_updates, clamp):
    for row, new in zip(rows, out, strict=True):
        learnt = ~np.isnan(new)
        log_odds[row][learnt] = np.clip(log_odds[row][learnt] + new[learnt], -clamp, clamp)
        n_updates[row][learnt] = np.minimum(n_updates[row][learnt].astype(int) + 1, 65535)
