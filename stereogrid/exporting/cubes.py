"""The occupied cells as one mesh: the faces that no other occupied cell covers, with shared corners."""

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InvalidInputError
from ..geometry import Array
from ..grid import OccupancyGrid
from .points import colours, occupied_cells

if TYPE_CHECKING:
    import trimesh

MOST_KEYS = 2**62


def cube_mesh(grid: OccupancyGrid, threshold: float) -> "trimesh.Trimesh":
    """The outer faces of the cells with p > threshold in world [m], two triangles each, coloured by height."""
    import trimesh

    cells, _ = occupied_cells(grid, threshold)
    corners, quads = outer_faces(cells)
    corners_m = corners * grid.cell_m
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return trimesh.Trimesh(corners_m, faces, vertex_colors=colours(corners_m[:, 2]), process=False, validate=False)


def outer_faces(cells: Array) -> tuple[Array, Array]:
    """Corners (V, 3) int64 in units of a cell, and the four (F, 4) of each face, counter-clockwise from outside."""
    origin = cells.min(axis=0) - 1
    extent = [int(each) for each in cells.max(axis=0) - origin + 2]
    if extent[0] * extent[1] * extent[2] >= MOST_KEYS:
        raise InvalidInputError(f"the map is too wide to be drawn: its occupied cells span {extent} cells")
    strides = np.array([extent[1] * extent[2], extent[2], 1])
    keys = np.sort((cells - origin) @ strides)
    quads = []
    for axis in range(3):
        u, v = strides[(axis + 1) % 3], strides[(axis + 2) % 3]
        low = keys[~_held(keys - strides[axis], keys)]
        high = keys[~_held(keys + strides[axis], keys)] + strides[axis]
        quads.append(low[:, None] + np.array([0, v, u + v, u]))
        quads.append(high[:, None] + np.array([0, u, u + v, v]))
    corner_keys, corner_of = np.unique(np.concatenate(quads), return_inverse=True)
    corners = np.stack([corner_keys // strides[0], corner_keys // strides[1] % extent[1], corner_keys % extent[2]], -1)
    return corners + origin, corner_of.reshape(-1, 4)


def _held(keys: Array, among: Array) -> Array:
    """(N,) True where keys (N,) stand among a sorted array."""
    at = np.minimum(np.searchsorted(among, keys), len(among) - 1)
    held: Array = among[at] == keys
    return held
