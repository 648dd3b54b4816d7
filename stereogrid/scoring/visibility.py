"""The visible set V: what a perfect stereo camera could have seen from the true poses."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import FloatArray, as_pose, from_rotation, inverse, transform
from .casting import RayCaster
from .kernels import Eyes, see_cells
from .labels import INTERIOR, CellLabels

if TYPE_CHECKING:
    import trimesh

FloatImage = NDArray[np.float32]

RAYS_PER_CELL = 2
"""Rays of a depth image across one cell at the largest range."""


@dataclass(frozen=True)
class VisibleSet:
    """What was there to be seen, cell by cell of a CellLabels; each array (nx, ny, nz).

    nearest_m float32: smallest depth at which both eyes saw the cell [m], infinity where they never did.
    in_view bool: within the images and the range of some observation, occluded or not.
    """

    nearest_m: NDArray[np.float32]
    in_view: NDArray[np.bool_]

    @property
    def mask(self) -> NDArray[np.bool_]:
        """(nx, ny, nz) True for the cells of V."""
        return np.isfinite(self.nearest_m)


def visible_cells(
    labels: CellLabels,
    mesh: "trimesh.Trimesh",
    camera: StereoCamera,
    poses: NDArray[Any],
    *,
    max_range_m: float,
    progress: Callable[[int, int], object] | None = None,
) -> VisibleSet:
    """The cells whose centre some observation sees in both images, within max_range_m of the left eye [m].

    poses (M, 4, 4): true T_world_cam. Seen = the first hit on the ray to the centre is no nearer than the
    centre by sqrt(3) / 2 of a cell, so that a surface does not hide its own cells. INTERIOR cells are never
    seen. Depth images of the mesh stand for the rays: two a cell at max_range_m, more when nearer; on one
    surface they are interpolated exactly, an occluder's edge is off by a quarter of a cell at most.
    progress(done, total) is called after each pose. Raises InvalidInputError on a bad pose or range,
    MissingExtraError without embreex.
    """
    if not (np.isfinite(max_range_m) and max_range_m > 0):
        raise InvalidInputError(f"max_range_m must be positive and finite, not {max_range_m}")
    checked = [as_pose(T, f"pose {n}") for n, T in enumerate(poses)]
    cell_px = camera.focal_px * labels.cell_m / max_range_m
    # What is finer than the camera's own pixels, the camera does not see.
    caster = _DepthCaster(mesh, camera, pitch_px=max(1.0, cell_px / RAYS_PER_CELL))
    eyes = _eyes(caster, max_range_m, slack_m=math.sqrt(3) / 2 * labels.cell_m)
    nearest_m = np.full(labels.label.shape, np.inf, dtype=np.float32)
    cells = labels.label == INTERIOR, nearest_m, np.zeros(labels.label.shape, dtype=np.bool_)
    for n, T_world_cam in enumerate(checked):
        box = _frustum_box(labels, camera, T_world_cam, max_range_m)
        see_cells(cells, box, _cell_to_cam(labels, T_world_cam), eyes, caster.inverse_depths(T_world_cam))
        if progress is not None:
            progress(n + 1, len(checked))
    return VisibleSet(nearest_m, cells[2])


def _eyes(caster: "_DepthCaster", max_range_m: float, slack_m: float) -> Eyes:
    c = caster.camera
    pixels = (c.focal_px, c.cx_px, c.cy_px, c.baseline_m, float(c.width_px), float(c.height_px))
    return Eyes(*(float(value) for value in (*pixels, *caster.pitch_px, max_range_m, slack_m)))


def _cell_to_cam(labels: CellLabels, T_world_cam: FloatArray) -> FloatArray:
    """(3, 4) affine map from a cell's index in the box to its centre in cam [m]."""
    T_world_box = from_rotation(np.eye(3) * labels.cell_m, (labels.origin_index + 0.5) * labels.cell_m)
    return (inverse(T_world_cam) @ T_world_box)[:3]


def _frustum_box(
    labels: CellLabels, camera: StereoCamera, T_world_cam: FloatArray, max_range_m: float
) -> NDArray[np.int64]:
    """(2, 3) first and past-the-last index of the cells that the left image may show within the range."""
    columns = np.array([-0.5, camera.width_px - 0.5])[[0, 1, 0, 1]]
    rows = np.array([-0.5, camera.height_px - 0.5])[[0, 0, 1, 1]]
    x, y = (columns - camera.cx_px) / camera.focal_px, (rows - camera.cy_px) / camera.focal_px
    corners_cam = np.vstack([np.zeros(3), max_range_m * np.stack([x, y, np.ones(4)], axis=1)])
    index = labels.index_of(transform(T_world_cam, corners_cam))
    first, past = np.maximum(index.min(axis=0), 0), np.minimum(index.max(axis=0) + 1, labels.label.shape)
    return np.stack([first, past])


class _DepthCaster:
    """Depth images of a mesh from both eyes, on a lattice of rays that spans the image from edge to edge."""

    def __init__(self, mesh: "trimesh.Trimesh", camera: StereoCamera, *, pitch_px: float) -> None:
        self.camera = camera
        columns = max(2, math.ceil(camera.width_px / pitch_px) + 1)
        rows = max(2, math.ceil(camera.height_px / pitch_px) + 1)
        self._shape = rows, columns
        self.pitch_px = camera.width_px / (columns - 1), camera.height_px / (rows - 1)
        x = (np.linspace(-0.5, camera.width_px - 0.5, columns) - camera.cx_px) / camera.focal_px
        y = (np.linspace(-0.5, camera.height_px - 0.5, rows) - camera.cy_px) / camera.focal_px
        # At depth 1, so that embree, which counts in lengths of the direction, returns depths.
        self._directions_cam = np.stack([*np.meshgrid(x, y), np.ones(self._shape)], axis=-1).reshape(-1, 3)
        self._caster = RayCaster(mesh)

    def inverse_depths(self, T_world_cam: FloatArray) -> tuple[FloatImage, FloatImage]:
        """Inverse depth of the first hits [1/m], (left, right) lattices; about 0 where nothing is hit."""
        directions = (self._directions_cam @ T_world_cam[:3, :3].T).astype(np.float32)
        left, right = (self._cast(T_world_cam, x_m, directions) for x_m in (0.0, self.camera.baseline_m))
        return left, right

    def _cast(self, T_world_cam: FloatArray, x_m: float, directions: FloatImage) -> FloatImage:
        depth_m = self._caster.lengths(transform(T_world_cam, [x_m, 0.0, 0.0]), directions)
        # An eye that touches a surface sees nothing beyond it; the floor keeps the quotient finite.
        inverse_m: FloatImage = np.reciprocal(np.maximum(depth_m, np.float32(1e-6))).reshape(self._shape)
        return inverse_m
