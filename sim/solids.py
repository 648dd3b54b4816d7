"""Closed convex solids with textured faces: what every world is built of."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from stereogrid.geometry import FloatArray, transform

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Paint:
    """What a face shows: a texture by name, tiled from the world's origin, or stretched once over the face (fit)."""

    texture: str
    fit: bool = False
    shift_m: float = 0.0


@dataclass(frozen=True)
class Face:
    """One planar convex polygon of a solid.

    corners: indices into the solid's vertices, counterclockwise seen from outside. s_axis, t_axis: unit vectors
    in the plane, to the right and down the texture. Texture coordinates are (axis . p - origin) / size [m/m].
    """

    corners: tuple[int, ...]
    s_axis: Vector
    t_axis: Vector
    texture: str
    origin_m: tuple[float, float]
    size_m: tuple[float, float] | None


@dataclass(frozen=True)
class Solid:
    """A closed convex body in the world. vertices_m (V, 3)."""

    name: str
    vertices_m: FloatArray
    faces: tuple[Face, ...]

    def mesh(self) -> trimesh.Trimesh:
        """The body's surface as triangles, outward, watertight."""
        return trimesh.Trimesh(self.vertices_m, np.concatenate([fan(f.corners) for f in self.faces]), process=False)


def fan(corners: Sequence[int]) -> FloatArray:
    """Triangles (K - 2, 3) of a convex polygon of K corners."""
    return np.array([(corners[0], a, b) for a, b in pairwise(corners[1:])])


# Corners of the unit box are numbered x + 2 y + 4 z; each side is counterclockwise seen from outside.
_BOX_SIDES = {
    "+x": (1, 3, 7, 5),
    "-x": (2, 0, 4, 6),
    "+y": (3, 2, 6, 7),
    "-y": (0, 1, 5, 4),
    "+z": (4, 5, 7, 6),
    "-z": (2, 3, 1, 0),
}


def box(
    name: str, low_m: Vector, high_m: Vector, paint: Paint | dict[str, Paint], *, T_world_box: FloatArray | None = None
) -> Solid:
    """The box between two corners, given in its own frame [m].

    paint: one for all sides, or by side ("+x", ..., "-z"; the key "" is for the others).
    """
    bounds = np.array([low_m, high_m], dtype=np.float64)
    local = np.array([[bounds[i & 1, 0], bounds[i >> 1 & 1, 1], bounds[i >> 2, 2]] for i in range(8)])
    vertices = local if T_world_box is None else transform(T_world_box, local)
    paints = paint if isinstance(paint, dict) else {"": paint}
    faces = tuple(_face(vertices, corners, paints.get(side, paints[""])) for side, corners in _BOX_SIDES.items())
    return Solid(name, vertices, faces)


def drum(
    name: str, foot_m: Vector, radii_m: tuple[float, float], height_m: float, *, paint: Paint, sides: int = 12
) -> Solid:
    """An upright, maybe tapered, polygonal drum; radii_m are those of its foot and its top [m]."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    vertices = np.concatenate([radii_m[0] * ring, radii_m[1] * ring + [0, 0, height_m]]) + foot_m
    after = [(k + 1) % sides for k in range(sides)]
    walls = [_face(vertices, (k, after[k], sides + after[k], sides + k), paint) for k in range(sides)]
    lids = [tuple(range(sides - 1, -1, -1)), tuple(range(sides, 2 * sides))]
    return Solid(name, vertices, (*walls, *(_face(vertices, lid, paint) for lid in lids)))


def _face(vertices: FloatArray, corners: tuple[int, ...], paint: Paint) -> Face:
    points = vertices[list(corners)]
    normal = np.cross(points[1] - points[0], points[2] - points[1])
    s, t = _texture_axes(normal / np.linalg.norm(normal))
    if paint.fit:
        origin = (float((points @ s).min()), float((points @ t).min()))
        size = (float(np.ptp(points @ s)), float(np.ptp(points @ t)))
        return Face(corners, _vector(s), _vector(t), paint.texture, origin, size)
    return Face(corners, _vector(s), _vector(t), paint.texture, (-paint.shift_m, 0.0), None)


def _texture_axes(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Axes that keep a texture upright on walls, and looking along +y on floors and ceilings."""
    up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    s = np.cross(up, normal)
    s /= np.linalg.norm(s)
    return s, np.cross(s, normal)


def _vector(v: ArrayLike) -> Vector:
    x, y, z = (float(a) for a in np.asarray(v))
    return x, y, z
