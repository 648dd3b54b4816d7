"""Triangle meshes as textured solids: tubes, blobs and whatever else no box and no drum can be."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from stereogrid.geometry import FloatArray

from .solids import Face, Solid

IntArray = NDArray[np.int64]


class Skin(NamedTuple):
    """What M triangles show. names (M,). st (M, 3, 2): wanted texture coordinates of their corners [m], right and
    down seen from outside, or None for the world's axes. sizes_m (M, 2): of the texture's tile, or None for its own."""

    names: Sequence[str]
    st: FloatArray | None = None
    sizes_m: FloatArray | None = None


def skinned(name: str, vertices_m: FloatArray, triangles: IntArray, skin: Skin, *, soft: bool = False) -> Solid:
    """The closed body of triangles (M, 3) over vertices_m (V, 3), counterclockwise seen from outside.

    A face maps its texture rigidly, in its plane: it is turned and shifted to where the wanted coordinates are met
    best; what is bent shows seams of millimetres.
    """
    corners = vertices_m[triangles]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    s = _upright(normals) if skin.st is None else _along(corners, normals, skin.st)
    t = cross(s, normals)
    origins = np.zeros((len(triangles), 2))
    if skin.st is not None:
        middle = corners.mean(axis=1)
        reached = np.stack([(s * middle).sum(axis=1), (t * middle).sum(axis=1)], axis=1)
        origins = reached - skin.st.mean(axis=1)
    sizes = [None] * len(triangles) if skin.sizes_m is None else skin.sizes_m.tolist()
    rows = zip(triangles.tolist(), s.tolist(), t.tolist(), skin.names, origins.tolist(), sizes, strict=True)
    faces = tuple(
        Face((c[0], c[1], c[2]), (u[0], u[1], u[2]), (v[0], v[1], v[2]), n, (o[0], o[1]), z and (z[0], z[1]))
        for c, u, v, n, o, z in rows
    )
    return Solid(name, vertices_m, faces, soft=soft)


def tube(name: str, line_m: FloatArray, radii_m: FloatArray, texture: str, *, sides: int = 8) -> Solid:
    """A round, tapered pole along a line of K points (K, 3) with radii_m (K,); flat lids close it."""
    rings = _rings(line_m, radii_m, sides)
    vertices = rings.reshape(-1, 3)
    lower, j = (a.ravel() for a in np.meshgrid(np.arange(len(line_m) - 1), np.arange(sides), indexing="ij"))
    a, b = lower * sides + j, lower * sides + (j + 1) % sides
    c, d = b + sides, a + sides
    walls = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3)
    fan = np.stack([np.zeros(sides - 2, np.int64), np.arange(1, sides - 1), np.arange(2, sides)], axis=1)
    triangles = np.concatenate([walls, fan[:, ::-1], fan + (len(line_m) - 1) * sides])

    height = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    pitch = 2 * np.pi * float(radii_m.mean()) / sides
    right = np.stack([j, j + 1, j + 1, j, j + 1, j], axis=1).reshape(-1, 3) * pitch
    up = np.stack([lower, lower, lower + 1, lower, lower + 1, lower + 1], axis=1).reshape(-1, 3)
    st = np.stack([right, -height[up]], axis=-1)
    # Lids are small or under ground: any axes will do.
    lids = vertices[triangles[len(walls) :]][..., :2]
    st = np.concatenate([st, lids * [1.0, -1.0]])
    return skinned(name, vertices, triangles, Skin([texture] * len(triangles), st))


def blob(
    rng: np.random.Generator,
    name: str,
    center_m: FloatArray,
    radii_m: FloatArray,
    texture: str,
    *,
    rough: tuple[float, float] = (0.12, 0.1),
    boxy: float = 0.0,
) -> Solid:
    """A lumpy ball of 320 faces, radii_m (3,) along x, y, z [m]; boxy: 0 is a ball, 1 a box, as hedges are clipped.

    rough: by what share of the radius its surface goes in and out, in wide swells and from corner to corner: the
    latter makes facets that catch the light as sprays of leaves do.
    """
    unit, triangles = _ball()
    swell = np.ones(len(unit))
    for k in range(7):
        wave = rng.normal(0, 1.6 + 0.5 * k, 3)
        swell += rough[0] / np.sqrt(3.5) * np.sin(unit @ wave + rng.uniform(0, 2 * np.pi))
    swell += rough[1] * rng.uniform(-1.7, 1.7, len(unit))
    swell *= np.abs(unit).max(axis=1) ** -boxy
    vertices = unit * np.clip(swell, 0.45, 1.7)[:, None] * radii_m + center_m
    return skinned(name, vertices, triangles, Skin([texture] * len(triangles)))


def prism(name: str, bottom_m: FloatArray, top_m: FloatArray, skin: tuple[str, FloatArray]) -> Solid:
    """A body between two polygons of K corners (K, 3), both counterclockwise seen from above, cut into triangles.

    skin: the texture, and the coordinates (K, 2) [m] of its top's corners; the sides take theirs from the rim.
    """
    count = len(top_m)
    texture, st_top = skin
    fan = np.stack([np.zeros(count - 2, np.int64), np.arange(1, count - 1), np.arange(2, count)], axis=1)
    j = np.arange(count)
    after = (j + 1) % count
    first = np.stack([j, after, after + count], axis=1)
    second = np.stack([j, after + count, j + count], axis=1)
    triangles = np.concatenate([fan + count, fan[:, ::-1], first, second])
    rim = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.roll(top_m, -1, axis=0) - top_m, axis=1))])
    depth = (top_m - bottom_m)[:, 2]
    low, high = np.stack([rim[:-1], depth], axis=1), np.stack([rim[:-1], 0 * depth], axis=1)
    low_after, high_after = np.stack([rim[1:], depth[after]], axis=1), np.stack([rim[1:], 0 * depth], axis=1)
    st = np.concatenate(
        [
            st_top[fan],
            st_top[fan[:, ::-1]] * [-1.0, 1.0],
            np.stack([low, low_after, high_after], axis=1),
            np.stack([low, high_after, high], axis=1),
        ]
    )
    return skinned(name, np.concatenate([bottom_m, top_m]), triangles, Skin([texture] * len(triangles), st))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products (..., 3); NumPy's own takes several times as long for the few hundred rows of a body."""
    product: FloatArray = a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]
    return product


def hull(name: str, points_m: FloatArray, texture: str) -> Solid:
    """The convex body about points (K, 3)."""
    body = trimesh.Trimesh(points_m, process=False).convex_hull
    triangles = np.asarray(body.faces, dtype=np.int64)
    return skinned(name, np.asarray(body.vertices), triangles, Skin([texture] * len(triangles)))


@cache
def _ball() -> tuple[FloatArray, IntArray]:
    """Corners (162, 3) on the unit sphere and the 320 triangles between them."""
    sphere = trimesh.creation.icosphere(subdivisions=2)
    return np.asarray(sphere.vertices), np.asarray(sphere.faces, dtype=np.int64)


def _rings(line_m: FloatArray, radii_m: FloatArray, sides: int) -> FloatArray:
    """(K, sides, 3): circles square to the line, not twisted along it, counterclockwise seen from its end."""
    tangents = np.gradient(line_m, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    across = np.array([1.0, 0.0, 0.0]) if abs(tangents[0, 0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for point, tangent, radius in zip(line_m, tangents, radii_m, strict=True):
        across = across - (across @ tangent) * tangent
        across /= np.linalg.norm(across)
        up = cross(tangent, across)
        rings.append(point + radius * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * up))
    return np.array(rings)


def _along(corners: FloatArray, normals: FloatArray, st: FloatArray) -> FloatArray:
    """Unit axes s (M, 3) in the planes that follow the wanted coordinates st (M, 3, 2) best, without shear."""
    edges = corners[:, 1:] - corners[:, :1]
    wanted = st[:, 1:] - st[:, :1]
    gram = np.einsum("mik,mjk->mij", edges, edges)
    # Gradients of s and t in the plane: the rows of pinv(edges) wanted.
    gradients = np.einsum("mij,mic->mcj", np.linalg.solve(gram, edges), wanted)
    gradients /= np.linalg.norm(gradients, axis=2, keepdims=True) + 1e-12
    s = gradients[:, 0] + cross(normals, gradients[:, 1])
    size = np.linalg.norm(s, axis=1, keepdims=True)
    # Coordinates that are mirrored, or that do not vary, say nothing of how a texture lies.
    told = size > 1e-3
    axes: FloatArray = np.where(told, s / np.where(told, size, 1.0), _upright(normals))
    return axes


def _upright(normals: FloatArray) -> FloatArray:
    """Axes s (M, 3) that keep a texture upright on what stands, and along x on what lies."""
    up = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[0.0, 1.0, 0.0]])
    s = cross(up, normals)
    axes: FloatArray = s / np.linalg.norm(s, axis=1, keepdims=True)
    return axes
