"""Which blocks an observation may change, and what it costs to hold them."""

import numpy as np

from ..camera import StereoCamera
from ..geometry import Array, FloatArray, inverse, transform
from .kernels import BLOCK


def blocks_in_view(camera: StereoCamera, T_world_cam: FloatArray, cell_m: float, *, max_range_m: float) -> Array:
    """Indices (B, 3) int64, sorted, of all blocks that meet the left camera's view up to max_range_m."""
    block_m = BLOCK * cell_m
    corners = np.vstack([np.zeros((1, 3)), max_range_m * _corner_rays(camera)])
    world = transform(T_world_cam, corners)
    low = np.floor(world.min(axis=0) / block_m).astype(np.int64)
    high = np.floor(world.max(axis=0) / block_m).astype(np.int64)
    axes = [np.arange(a, b + 1) for a, b in zip(low, high, strict=True)]
    blocks = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    centres_cam = transform(inverse(T_world_cam), (blocks + 0.5) * block_m)
    seen = _spheres_in_view(camera, centres_cam, radius_m=block_m * np.sqrt(3) / 2, max_range_m=max_range_m)
    return blocks[seen]


def view_volume_m3(camera: StereoCamera, max_range_m: float) -> float:
    """Volume of the pyramid that the left camera sees up to depth max_range_m [m^3]."""
    return camera.width_px * camera.height_px / camera.focal_px**2 * max_range_m**3 / 3


def _corner_rays(camera: StereoCamera) -> FloatArray:
    """Points at depth 1 on the rays of the image's four outer corners (4, 3), in cam."""
    columns = np.array([-0.5, camera.width_px - 0.5, camera.width_px - 0.5, -0.5])
    rows = np.array([-0.5, -0.5, camera.height_px - 0.5, camera.height_px - 0.5])
    x, y = (columns - camera.cx_px) / camera.focal_px, (rows - camera.cy_px) / camera.focal_px
    return np.stack([x, y, np.ones(4)], axis=1)


def _spheres_in_view(camera: StereoCamera, centres_cam: FloatArray, *, radius_m: float, max_range_m: float) -> Array:
    """(N,) whether spheres (N, 3) in cam meet the view; spheres near an edge of it may pass though they miss it."""
    corners = _corner_rays(camera)
    normals = np.cross(corners, np.roll(corners, -1, axis=0))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inside = (centres_cam @ normals.T >= -radius_m).all(axis=1)
    near_enough = np.linalg.norm(centres_cam, axis=1) <= max_range_m + radius_m
    seen: Array = inside & near_enough
    return seen
