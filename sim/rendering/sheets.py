"""Where light is baked: on every face, or on the ground as a whole, a sheet of texels over its texture coordinates."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray

from ..scene.scene import World
from .casting import Target
from .shapes import Bodies
from .sky import sun_of
from .vectors import lengths_along

TEXEL_M = 0.10
SKY_TEXEL_M, GROUND_TEXEL_M = 0.15, 0.20
"""Under a sky, of the light from everywhere; the sun's shadows are finer by the sheet's zoom."""
SUN_TEXEL_M = 0.04
STEPS_M = (8.0, 16.0)
"""Under a sky texels double in size beyond each of these distances from the path; those of the ground do not."""
MOST_A_SHEET = 8000
"""Coarse texels; under a sky those of larger sheets are larger."""
SMALL_M2 = 0.02
"""A sheet of less area than this has no zoom: a leaf is lit or not."""
MOST_TEXELS = 8_000_000
CHUNK = 1 << 18
MIN_DET = 1e-3

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Grid:
    """M sheets. of_face (F,): the sheet of each face; face (M,): the first face of each.

    low, size (M, 2) [m] by s, t; counts (M, 2): columns, rows of coarse texels; zoom (M,): fine texels to a coarse
    one, along a side, a power of two. frames (M, 3, 3), rows: what s, t and the offset of the plane add to a point.
    middle (M, 2): mean of the corners' s, t. n_static: so many belong to the world itself.
    """

    of_face: IntArray
    face: IntArray
    low: FloatArray
    size: FloatArray
    counts: IntArray
    zoom: IntArray
    frames: FloatArray
    middle: FloatArray
    n_static: int


@dataclass(frozen=True)
class Spots:
    """N texels' middles: sheet (N,), cell (N, 2), points (N, 3) [m], true normals and shown, smooth ones (N, 3)."""

    sheet: IntArray
    cell: IntArray
    points: FloatArray
    normals: FloatArray
    smooth: FloatArray


class Ground:
    """The tops of the solids that are seen from above, where sheets are found by casting rays down on them."""

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        self._targets = {int(k): Target(bodies, bodies.surface == k) for k in np.unique(bodies.surface) if k >= 0}
        shapes = bodies.shapes
        counts = np.diff(shapes.starts)
        top = np.repeat(bodies.surface >= 0, counts)
        normals = np.repeat(shapes.normals, counts, axis=0)
        sums = np.zeros_like(shapes.vertices)
        np.add.at(sums, shapes.corners[top], normals[top])
        self._vertex_normals = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)

    def drop(self, points: FloatArray, surface: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points (N, 3) with their z on the surface (N,), its normals there and its smooth normals."""
        points, faces = points.copy(), np.full(len(points), -1, np.int32)
        shapes = self._bodies.shapes
        for k, target in self._targets.items():
            chosen = np.flatnonzero(surface == k)
            start = points[chosen]
            start[:, 2] = shapes.vertices[:, 2].max() + 1.0
            for nudge in (0.0, 1e-3, -1e-3):
                # A ray may slip through between two triangles.
                missed = faces[chosen] < 0
                at = start[missed] + [nudge, 0.7 * nudge, 0.0]
                faces[chosen[missed]] = target.first_faces(at, np.tile([0.0, 0.0, -1.0], (len(at), 1)))
            faces[chosen[faces[chosen] < 0]] = np.flatnonzero(self._bodies.surface == k)[0]
        normals = shapes.normals[faces]
        points[:, 2] = (shapes.offsets[faces] - (normals[:, :2] * points[:, :2]).sum(axis=1)) / normals[:, 2]
        return points, normals, self._smooth(points, faces)

    def _smooth(self, points: FloatArray, faces: NDArray[np.int32]) -> FloatArray:
        """Normals (N, 3) between those of the first three corners of each face, by their shares seen from above."""
        shapes = self._bodies.shapes
        corners = shapes.corners[shapes.starts[faces][:, None] + np.arange(3)]
        a, b, c = np.moveaxis(shapes.vertices[corners][..., :2], 1, 0)
        p = points[:, :2]
        shares = np.stack([_area(b - p, c - p), _area(c - p, a - p), _area(a - p, b - p)], axis=1)
        shares = np.clip(shares / _area(b - a, c - a)[:, None], 0, 1)
        smooth = np.einsum("nk,nkc->nc", shares, self._vertex_normals[corners])
        smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
        return np.asarray(smooth)


def _area(a: FloatArray, b: FloatArray) -> FloatArray:
    """Twice the signed areas (N,) of triangles with the sides (N, 2)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def lay_out(world: World, bodies: Bodies) -> Grid:
    """A sheet for every face or surface. Raises InvalidInputError where texture axes do not span a face."""
    shapes = bodies.shapes
    n_faces = len(shapes.normals)
    key = np.arange(n_faces)
    for k in np.unique(bodies.surface[bodies.surface >= 0]):
        key[bodies.surface == k] = np.argmax(bodies.surface == k)
    face, of_face = np.unique(key, return_inverse=True)
    low, high, middle = _bounds(bodies, of_face, len(face))
    ground = bodies.surface[face] >= 0
    size, frames = np.maximum(high - low, 1e-9), _frames(bodies, face, ground)
    static = int(np.searchsorted(face, bodies.face_starts[1]))
    texel = np.where(ground, GROUND_TEXEL_M, TEXEL_M if world.sky is None else SKY_TEXEL_M)
    zoom = np.ones_like(face)
    least = np.where(np.arange(len(face)) < static, 2 if world.sky is None else 1, 1)
    if world.sky is not None:
        points = np.einsum("na,nak->nk", np.column_stack([middle, bodies.shapes.offsets[face]]), frames)
        away = _distance_to_path(points[:, :2], world.waypoints_m) - 0.5 * np.linalg.norm(size, axis=1)
        growth = np.where(ground, 1.0, 2.0 ** np.searchsorted(STEPS_M, away))
        texel = np.maximum(growth * texel, np.where(ground, 0.0, np.sqrt(size.prod(axis=1) / MOST_A_SHEET)))
        if world.sky.sun_power > 0:
            facing = lengths_along(bodies.shapes.normals[face], sun_of(world.sky)) > 0
            lit = (np.arange(len(face)) < static) & (ground | (facing & (size.prod(axis=1) > SMALL_M2)))
            zoom[lit] = 2 ** np.ceil(np.log2(texel[lit] / (growth * SUN_TEXEL_M)[lit])).astype(np.int64)
    counts = np.maximum(np.ceil(size / texel[:, None]).astype(np.int64), least[:, None])
    return Grid(of_face, face, low, size, counts, _affordable(zoom, counts, ground), frames, middle, static)


def spots(grid: Grid, bodies: Bodies, ground: Ground, *, sheets: slice, fine: bool) -> Iterator[Spots]:
    """The texels of some sheets, coarse or fine, sheet after sheet and row after row, in chunks."""
    counts = grid.counts * (grid.zoom[:, None] if fine else 1)
    ends = np.cumsum(counts.prod(axis=1)[sheets])
    first = sheets.start or 0
    for begin in range(0, int(ends[-1]) if len(ends) else 0, CHUNK):
        k = np.arange(begin, min(begin + CHUNK, int(ends[-1])))
        sheet = np.searchsorted(ends, k, side="right")
        k -= np.concatenate([[0], ends])[sheet]
        sheet += first
        cell = np.stack([k % counts[sheet, 0], k // counts[sheet, 0]], axis=1)
        yield _spots(grid, bodies, ground, (sheet, cell, counts))


def _spots(grid: Grid, bodies: Bodies, ground: Ground, at: tuple[IntArray, IntArray, IntArray]) -> Spots:
    sheet, cell, counts = at
    st = grid.low[sheet] + (cell + 0.5) * (grid.size / counts)[sheet]
    single = counts[sheet].prod(axis=1) == 1
    st[single] = grid.middle[sheet[single]]
    face = grid.face[sheet]
    surface = bodies.surface[face]
    offsets = np.where(surface >= 0, 0.0, bodies.shapes.offsets[face])
    points = np.einsum("na,nak->nk", np.column_stack([st, offsets]), grid.frames[sheet])
    normals = bodies.shapes.normals[face]
    smooth = normals.copy()
    on_ground = np.flatnonzero(surface >= 0)
    if len(on_ground):
        dropped = ground.drop(points[on_ground], surface[on_ground])
        points[on_ground], normals[on_ground], smooth[on_ground] = dropped
    return Spots(sheet, cell, points, normals, smooth)


def _bounds(bodies: Bodies, of_face: IntArray, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lowest, highest and mean s, t (M, 2) of the corners of each sheet's faces."""
    shapes = bodies.shapes
    owner = np.repeat(np.arange(len(shapes.normals)), np.diff(shapes.starts))
    st = np.einsum("cak,ck->ca", shapes.axes[owner], shapes.vertices[shapes.corners])
    low, high, total = np.full((n, 2), np.inf), np.full((n, 2), -np.inf), np.zeros((n, 2))
    sheet = of_face[owner]
    np.minimum.at(low, sheet, st)
    np.maximum.at(high, sheet, st)
    np.add.at(total, sheet, st)
    return low, high, total / np.bincount(sheet, minlength=n)[:, None]


def _frames(bodies: Bodies, face: IntArray, ground: NDArray[np.bool_]) -> FloatArray:
    normals = np.where(ground[:, None], [0.0, 0.0, 1.0], bodies.shapes.normals[face])
    rows = np.concatenate([bodies.shapes.axes[face], normals[:, None]], axis=1)
    flat = np.abs(np.linalg.det(rows)) < MIN_DET
    if flat.any():
        name = bodies.names[bodies.solid_of_face[face[np.argmax(flat)]]]
        raise InvalidInputError(f"the texture axes of a face of the solid {name!r} do not span it")
    # Rows of the transposed inverse: p = s * row 0 + t * row 1 + offset * row 2.
    frames: FloatArray = np.swapaxes(np.linalg.inv(rows), 1, 2)
    return frames


def _affordable(zoom: IntArray, counts: IntArray, ground: NDArray[np.bool_]) -> IntArray:
    """The zoom, less where there would be too many fine texels, on the ground last."""
    for mine in (~ground, ground):
        while (counts.prod(axis=1) * zoom**2).sum() > MOST_TEXELS and zoom[mine].max(initial=1) > 1:
            zoom = np.where(mine, np.maximum(zoom // 2, 1), zoom)
    return zoom


def _distance_to_path(xy_m: FloatArray, waypoints_m: FloatArray) -> FloatArray:
    """Distance (N,) of points (N, 2) from the polyline through the waypoints [m]."""
    nearest = np.full(len(xy_m), np.inf)
    for a, b in pairwise(waypoints_m):
        leg = b - a
        share = np.clip(lengths_along(xy_m - a, leg) / max(float(leg @ leg), 1e-12), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(a + share[:, None] * leg - xy_m, axis=1))
    return nearest
