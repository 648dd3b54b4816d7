"""Small cameras, poses and disparity images whose maps are known beforehand."""

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.grid.cells import ONE
from stereogrid.observation import Disparity
from stereogrid.sensor_model import SensorModel, log_odds

CAMERA = StereoCamera(focal_px=60, cx_px=39.5, cy_px=29.5, baseline_m=0.1, width_px=80, height_px=60)
FORWARD = from_rotation(R_BASE_OPTICAL)
"""T_world_cam of a camera at the origin that looks along x, z up."""


def random_pose(rng, spread_m=1.0):
    """Any rotation, any place: no ray lies on a boundary between cells."""
    return from_rotation(Rotation.random(random_state=rng).as_matrix(), rng.uniform(-spread_m, spread_m, 3))


def random_disparity(rng, camera=CAMERA, *, missing=0.2):
    """Smooth surfaces with jumps between 0.7 and 4 m, NaN patches, and a sigma that varies from pixel to pixel."""
    smooth = gaussian_filter(rng.standard_normal(camera.shape), 6)
    inverse_depth = np.interp(smooth, [smooth.min(), smooth.max()], [1 / 4, 1 / 0.7])
    d = camera.focal_baseline_px_m * np.where(smooth > np.median(smooth), inverse_depth, 0.5 * inverse_depth)
    hole = gaussian_filter(rng.standard_normal(camera.shape), 2)
    d[hole < np.quantile(hole, missing)] = np.nan
    return Disparity(d.astype(np.float32), rng.uniform(0.05, 0.8, camera.shape).astype(np.float32))


def constant_disparity(d_px, sigma_px, camera=CAMERA):
    """A wall across the view, parallel to the image."""
    return Disparity(np.full(camera.shape, d_px, np.float32), np.float32(sigma_px))


def no_disparity(camera=CAMERA):
    return Disparity(np.full(camera.shape, np.nan, np.float32), np.float32(0.3))


def ground_disparity(camera, T_world_cam, ground_z_m, *, sigma_px, rng):
    """The plane z = ground_z_m with noise of sigma_px that is the same over a matching window; NaN above."""
    rays = camera.ray_directions @ T_world_cam[:3, :3].T
    down = rays[..., 2] < -1e-6
    depth = (ground_z_m - T_world_cam[2, 3]) / np.where(down, rays[..., 2], -1.0)
    noise = gaussian_filter(rng.standard_normal(camera.shape), 3)
    d = camera.focal_baseline_px_m / depth + sigma_px * noise / noise.std()
    d[~down | (d < 0.3)] = np.nan
    return Disparity(d.astype(np.float32), np.float32(sigma_px))


def contents(grid):
    """Cells (N, 3) in lexical order, log-odds (N,) and update counts (N,) of all that the map knows."""
    cells, log_odds = grid.blocks.known()
    order = np.lexsort(cells.T[::-1])
    cells = cells[order]
    return cells, log_odds[order], grid.blocks.at(cells)[1]


# Maps of 0.1 m cells, seen up to 3 m

MODEL = SensorModel(max_range_m=3.0)
FREE_GAIN = np.float32(round((log_odds(MODEL.p_free) - log_odds(MODEL.prior)) * ONE) / ONE)
"""In whole units of the fixed point, as the grid adds it."""


def empty(**options):
    return OccupancyGrid(**{"cell_m": 0.1, "model": MODEL, **options})


def mapped(poses, disparities, **options):
    grid = empty(**options)
    for pose, disparity in zip(poses, disparities, strict=True):
        grid.integrate(CAMERA, disparity, pose)
    return grid


def wall(depth_m, sigma_px=0.1):
    return constant_disparity(CAMERA.focal_baseline_px_m / depth_m, sigma_px)


def drive(seed, n=3):
    rng = np.random.default_rng(seed)
    return [random_pose(rng) for _ in range(n)], [random_disparity(rng) for _ in range(n)]
