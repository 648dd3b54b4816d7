"""Closed solids with textured faces: what every world is built of."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from stereogrid.geometry import FloatArray, from_yaw, transform

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
    to the right and down the texture, in the plane or, for uneven ground, near it: a texture is then mapped along
    their cross product. Texture coordinates are (axis . p - origin) / size [m/m].
    """

    corners: tuple[int, ...]
    s_axis: Vector
    t_axis: Vector
    texture: str
    origin_m: tuple[float, float]
    size_m: tuple[float, float] | None


@dataclass(frozen=True)
class Solid:
    """A closed body in the world. vertices_m (V, 3).

    seen_from_above: its top faces are one surface over x and y (the ground), which is lit and textured as one.
    soft: grass and leaves, which the robot pushes aside and its sonars do not hear.
    """

    name: str
    vertices_m: FloatArray
    faces: tuple[Face, ...]
    seen_from_above: bool = False
    soft: bool = False

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
    name: str,
    low_m: Vector,
    high_m: Vector,
    paint: Paint | dict[str, Paint],
    *,
    T_world_box: FloatArray | None = None,
    soft: bool = False,
) -> Solid:
    """The box between two corners, given in its own frame [m].

    paint: one for all sides, or by side ("+x", ..., "-z"; the key "" is for the others).
    """
    bounds = np.array([low_m, high_m], dtype=np.float64)
    local = np.array([[bounds[i & 1, 0], bounds[i >> 1 & 1, 1], bounds[i >> 2, 2]] for i in range(8)])
    vertices = local if T_world_box is None else transform(T_world_box, local)
    paints = paint if isinstance(paint, dict) else {"": paint}
    each = ((side, corners, paints.get(side, paints[""])) for side, corners in _BOX_SIDES.items())
    if T_world_box is not None:
        return Solid(name, vertices, tuple(_face(vertices, corners, paint) for _, corners, paint in each), soft=soft)
    # A world is thousands of boxes along its axes: their textures need no vector algebra.
    faces = tuple(_upright_face(bounds, side, corners, paint) for side, corners, paint in each)
    return Solid(name, vertices, faces, soft=soft)


def drum(
    name: str, foot_m: Vector, radii_m: tuple[float, float], height_m: float, *, paint: Paint, sides: int = 12
) -> Solid:
    """An upright, maybe tapered, polygonal drum; radii_m are those of its foot and its top [m]."""
    ring = _circle(sides)
    return prism(name, radii_m[0] * ring + foot_m, radii_m[1] * ring + [0, 0, height_m] + foot_m, paint)


def rod(name: str, ends_m: tuple[Vector, Vector], radius_m: float, paint: Paint, *, sides: int = 6) -> Solid:
    """A round bar from one point to another [m]."""
    start, end = np.array(ends_m)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross([0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [0.0, 1.0, 0.0], along)
    across /= np.linalg.norm(across)
    ring = radius_m * (_circle(sides) @ np.array([across, np.cross(along, across), along]))
    return prism(name, start + ring, end + ring, paint)


def prism(name: str, foot_m: FloatArray, top_m: FloatArray, paint: Paint) -> Solid:
    """The convex body between two parallel polygons (K, 3) [m], counterclockwise seen from the top; its sides are flat
    when the polygons have parallel edges."""
    vertices, sides = np.concatenate([foot_m, top_m]), len(foot_m)
    after = [(k + 1) % sides for k in range(sides)]
    walls = [_face(vertices, (k, after[k], sides + after[k], sides + k), paint) for k in range(sides)]
    lids = [tuple(range(sides - 1, -1, -1)), tuple(range(sides, 2 * sides))]
    return Solid(name, vertices, (*walls, *(_face(vertices, lid, paint) for lid in lids)))


def placed(
    name: str, parts: Iterable[Solid], x_m: float, y_m: float, yaw_rad: float = 0.0, *, z_m: float = 0.0
) -> Iterator[Solid]:
    """Solids given in a frame of their own, set down as one thing, on the floor or at z_m; its name precedes theirs."""
    T = from_yaw(yaw_rad, (x_m, y_m, z_m))
    return (moved(part, T, f"{name} {part.name}") for part in parts)


def moved(solid: Solid, T_world_solid: FloatArray, name: str | None = None) -> Solid:
    """The solid elsewhere, its textures with it."""
    R, t_m = T_world_solid[:3, :3], T_world_solid[:3, 3]
    axes = np.array([(face.s_axis, face.t_axis) for face in solid.faces]) @ R.T
    origins = np.array([face.origin_m for face in solid.faces]) + axes @ t_m
    faces = tuple(
        Face(face.corners, tuple(s), tuple(t), face.texture, tuple(origin), face.size_m)
        for face, (s, t), origin in zip(solid.faces, axes.tolist(), origins.tolist(), strict=True)
    )
    return replace(solid, name=name or solid.name, vertices_m=transform(T_world_solid, solid.vertices_m), faces=faces)


def _circle(sides: int) -> FloatArray:
    angle = 2 * np.pi * np.arange(sides) / sides
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)


def _face(vertices: FloatArray, corners: tuple[int, ...], paint: Paint) -> Face:
    points = vertices[list(corners)]
    normal = _cross(points[1] - points[0], points[2] - points[1])
    s, t = _texture_axes(normal / np.linalg.norm(normal))
    if paint.fit:
        origin = (float((points @ s).min()), float((points @ t).min()))
        size = (float(np.ptp(points @ s)), float(np.ptp(points @ t)))
        return Face(corners, _vector(s), _vector(t), paint.texture, origin, size)
    return Face(corners, _vector(s), _vector(t), paint.texture, (-paint.shift_m, 0.0), None)


def _upright_face(bounds: FloatArray, side: str, corners: tuple[int, ...], paint: Paint) -> Face:
    """A side of the box between two corners (2, 3): the same as _face of its vertices."""
    s, t = _BOX_AXES[side]
    if not paint.fit:
        return Face(corners, s, t, paint.texture, (-paint.shift_m, 0.0), None)
    (s0, s1), (t0, t1) = (sorted((bounds @ axis).tolist()) for axis in (s, t))
    return Face(corners, s, t, paint.texture, (s0, t0), (s1 - s0, t1 - t0))


def _texture_axes(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Axes that keep a texture upright on walls, and looking along +y on floors and ceilings."""
    up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    s = _cross(up, normal)
    s /= np.linalg.norm(s)
    return s, _cross(s, normal)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """numpy.cross of two vectors (3,), in a tenth of its time: a world has tens of thousands of faces."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _vector(v: ArrayLike) -> Vector:
    x, y, z = (float(a) for a in np.asarray(v))
    return x, y, z


def _box_axes() -> dict[str, tuple[Vector, Vector]]:
    """The texture's axes on each side of an upright box."""
    found = {}
    for side in _BOX_SIDES:
        normal = np.array([(side[1] == axis) * (1.0 if side[0] == "+" else -1.0) for axis in "xyz"])
        s, t = _texture_axes(normal)
        found[side] = (_vector(s), _vector(t))
    return found


_BOX_AXES = _box_axes()
