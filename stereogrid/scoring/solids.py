"""Which cell centres lie inside closed solids, where nothing can ever be seen."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..geometry import FloatArray
from .kernels import flip_above_crossings

Faces = NDArray[np.int64]

COLUMN_OFFSET = np.array([1.0e-5, 0.618e-5])
"""Where the columns stand off the centres [cells], so that none passes through an edge aligned with the grid.
It is ten times less than what makes a cell OCCUPIED, so no label hangs on it."""


def inside_solids(vertices: FloatArray, faces: Faces, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    """(nx, ny, nz) True where a cell's centre is inside a solid; vertices (V, 3) in cells from the corner.

    Only watertight bodies count. Of those that enclose a centre the smallest decides: a solid when its
    normals point out, a room when they point in. So a shell with a cavity, and furniture in a room,
    come out right.
    """
    inside = np.zeros(shape, dtype=np.bool_)
    bodies = [vertices[body] for body in closed_bodies(vertices, faces)]
    volumes = [_signed_volume(triangles) for triangles in bodies]
    for n in np.argsort(-np.abs(volumes), kind="stable"):
        _paint(inside, bodies[n], volumes[n] > 0)
    return inside


def closed_bodies(vertices: FloatArray, faces: Faces) -> list[Faces]:
    """The watertight bodies of a mesh, each as its faces (F, 3).

    Bodies are parts connected through vertices as the mesh indexes them. What is not closed so is tried again
    with equal vertices merged, for meshes whose faces do not share vertices. Parts left open are no bodies.
    """
    closed, rest = _split_closed(faces)
    if len(rest) == 0:
        return closed
    _, merged = np.unique(vertices.round(6), axis=0, return_inverse=True)
    # NumPy 2.0 alone returns the inverse in two dimensions.
    first_of = np.zeros(len(vertices), dtype=np.int64)
    first_of[merged.ravel()] = np.arange(len(vertices))
    seamless, _ = _split_closed(first_of[merged.ravel()][rest])
    return closed + seamless


def _split_closed(faces: Faces) -> tuple[list[Faces], Faces]:
    """(closed bodies, faces of the others); closed = every edge belongs to an even number of faces."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    size = int(faces.max(initial=-1)) + 1
    links = coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), shape=(size, size))
    _, body_of_vertex = connected_components(links.tocsr(), directed=False)
    body = body_of_vertex[faces[:, 0]]
    unique_edges, uses = np.unique(edges, axis=0, return_counts=True)
    is_open = np.zeros(size, dtype=np.bool_)
    is_open[body_of_vertex[unique_edges[uses % 2 == 1, 0]]] = True
    closed = faces[~is_open[body]]
    order = np.argsort(body[~is_open[body]], kind="stable")
    starts = np.flatnonzero(np.diff(body[~is_open[body]][order])) + 1
    bodies = np.split(closed[order], starts) if len(closed) else []
    return bodies, faces[is_open[body]]


def _signed_volume(triangles: FloatArray) -> float:
    """Volume of a closed body (F, 3, 3), negative when its normals point in."""
    a, b, c = (triangles - triangles[0, 0]).swapaxes(0, 1)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def _paint(inside: NDArray[np.bool_], triangles: FloatArray, value: bool) -> None:
    """Set inside to value at the centres that the body encloses (an odd number of its faces lie below)."""
    shape = np.array(inside.shape)
    low = np.clip(np.floor(triangles.min(axis=(0, 1))).astype(np.int64), 0, shape)
    high = np.clip(np.ceil(triangles.max(axis=(0, 1))).astype(np.int64), 0, shape)
    if (low >= high).any():
        return
    extent = high - low
    flips = np.zeros((extent[0], extent[1], extent[2] + 1), dtype=np.uint8)
    flip_above_crossings(triangles - low, COLUMN_OFFSET, flips)
    enclosed = np.bitwise_xor.accumulate(flips[:, :, :-1], axis=2).astype(np.bool_)
    inside[low[0] : high[0], low[1] : high[1], low[2] : high[2]][enclosed] = value
