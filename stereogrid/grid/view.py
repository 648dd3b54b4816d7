"""Which blocks an observation may change, and what it costs to hold them."""

import numpy as np
from numba import njit

from ..camera import StereoCamera
from ..geometry import Array, FloatArray, transform
from .blocks import BLOCK
from .hashing import FREE_SLOT, add_rows


def blocks_in_view(camera: StereoCamera, T_world_cam: FloatArray, cell_m: float, *, max_range_m: float) -> Array:
    """Indices (B, 3) int64, sorted, of all blocks that meet the left camera's view up to max_range_m."""
    block_m = BLOCK * cell_m
    corners = _corner_rays(camera)
    world = transform(T_world_cam, np.vstack([np.zeros((1, 3)), max_range_m * corners]))
    low = np.floor(world.min(axis=0) / block_m).astype(np.int64)
    high = np.floor(world.max(axis=0) / block_m).astype(np.int64)
    normals = np.cross(corners, np.roll(corners, -1, axis=0))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # The sides of the view in world: a block is out when its sphere is wholly outside of one.
    sides = np.empty((4, 4))
    sides[:, :3] = normals @ T_world_cam[:3, :3].T
    sides[:, 3] = -sides[:, :3] @ T_world_cam[:3, 3]
    blocks: Array = list_blocks(np.stack([low, high]), T_world_cam[:3, 3].copy(), sides, (block_m, max_range_m))
    return blocks


def blocks_in_views(camera: StereoCamera, poses: FloatArray, cell_m: float, *, max_range_m: float) -> Array:
    """As blocks_in_view, of all the blocks that meet any of the views from poses (K, 4, 4): sorted for one pose."""
    views = [blocks_in_view(camera, pose, cell_m, max_range_m=max_range_m) for pose in poses]
    if len(views) == 1:
        return views[0]
    found = np.concatenate(views)
    slots = np.full(1 << (2 * len(found)).bit_length(), FREE_SLOT, dtype=np.int32)
    blocks = np.empty_like(found)
    count = add_rows(found, slots, blocks, 0, np.empty(len(found), dtype=np.int64))
    return blocks[:count]


@njit(cache=True, nogil=True, error_model="numpy")
def list_blocks(box: Array, eye_m: Array, sides: Array, sizes: tuple[float, float]) -> Array:
    """The blocks (B, 3) int64 of box (2, 3) whose spheres are within the range and inside of the sides (4, 4).

    Spheres near an edge of the view may pass though they miss it. sizes: edge of a block, largest range [m].
    """
    block_m, range_m = sizes
    radius_m = block_m * np.sqrt(3.0) / 2
    size = box[1] - box[0] + 1
    found = np.empty((size[0] * size[1] * size[2], 3), np.int64)
    count = 0
    for i in range(box[0, 0], box[1, 0] + 1):
        x = (i + 0.5) * block_m
        for j in range(box[0, 1], box[1, 1] + 1):
            y = (j + 0.5) * block_m
            for k in range(box[0, 2], box[1, 2] + 1):
                z = (k + 0.5) * block_m
                square = (x - eye_m[0]) ** 2 + (y - eye_m[1]) ** 2 + (z - eye_m[2]) ** 2
                seen = square <= (range_m + radius_m) ** 2
                for n in range(4):
                    side = sides[n, 0] * x + sides[n, 1] * y + sides[n, 2] * z + sides[n, 3]
                    seen = seen and side >= -radius_m
                if seen:
                    found[count, 0], found[count, 1], found[count, 2] = i, j, k
                    count += 1
    return found[:count].copy()


def view_volume_m3(camera: StereoCamera, max_range_m: float) -> float:
    """Volume of the pyramid that the left camera sees up to depth max_range_m [m^3]."""
    return camera.width_px * camera.height_px / camera.focal_px**2 * max_range_m**3 / 3


def _corner_rays(camera: StereoCamera) -> FloatArray:
    """Points at depth 1 on the rays of the image's four outer corners (4, 3), in cam."""
    columns = np.array([-0.5, camera.width_px - 0.5, camera.width_px - 0.5, -0.5])
    rows = np.array([-0.5, -0.5, camera.height_px - 0.5, camera.height_px - 0.5])
    x, y = (columns - camera.cx_px) / camera.focal_px, (rows - camera.cy_px) / camera.focal_px
    return np.stack([x, y, np.ones(4)], axis=1)
