"""Office, warehouse and entrance as truth: closed bodies, a clear path, seeds that matter."""

from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from unittest.mock import patch

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from sim.scene.scene import World
from sim.scene.textures import Painter, Texture, leaf
from sim.worlds.palette import painted
from sim.worlds.textures_indoor import books, glass
from sim.worlds.world import make_world
from stereogrid.geometry import FloatArray
from stereogrid.scoring.solids import closed_bodies

NAMES = ("entrance", "office", "warehouse")
LENGTHS_M = {"entrance": (28, 36), "office": (25, 30), "warehouse": (33, 37)}
CLEARANCE_M = 0.5
SEEDS = range(10)

every_world = pytest.mark.parametrize("name", NAMES)
every_seed = pytest.mark.parametrize("seed", SEEDS)


@cache
def world(name: str, seed: int) -> World:
    """The world without the work of painting it: its solids are the same."""

    def blank(painters: Mapping[str, Painter], _: int) -> dict[str, Texture]:
        return dict.fromkeys(painters, Texture(np.zeros((2, 2), np.uint8)))

    with patch(f"sim.worlds.{name}.painted", blank):
        return make_world(name, seed)


@every_seed
@every_world
def test_every_body_is_closed_and_turned_outward(name: str, seed: int) -> None:
    mesh = world(name, seed).mesh()
    triangles = mesh.vertices[mesh.faces]
    assert len(closed_bodies(mesh.vertices, mesh.faces)) == len(world(name, seed).solids)
    # Each directed edge once, and its opposite once: closed, and all faces turned the same way.
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    codes = edges[:, 0].astype(np.int64) * len(mesh.vertices) + edges[:, 1]
    back = edges[:, 1].astype(np.int64) * len(mesh.vertices) + edges[:, 0]
    assert len(np.unique(codes)) == len(codes) and np.array_equal(np.sort(codes), np.sort(back))
    counts = [sum(len(face.corners) - 2 for face in solid.faces) for solid in world(name, seed).solids]
    owner = np.repeat(np.arange(len(counts)), counts)
    volumes = np.bincount(owner, np.einsum("fi,fi->f", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6)
    assert (volumes > 0).all()


@every_seed
@every_world
def test_nothing_stands_near_the_path(name: str, seed: int) -> None:
    here = world(name, seed)
    path = along(here.waypoints_m)
    for solid in here.solids:
        points = band(solid.vertices_m, 0.05, 0.6)
        if len(points):
            assert gap_m(path, points).min() >= CLEARANCE_M, solid.name


@every_seed
@every_world
def test_the_path_starts_at_the_origin_heading_x_and_is_as_long_as_said(name: str, seed: int) -> None:
    here = world(name, seed)
    assert here.waypoints_m[0].tolist() == [0, 0] and here.waypoints_m[1][1] == 0 and here.waypoints_m[1][0] > 0
    low, high = LENGTHS_M[name]
    assert low <= here.path_length_m <= high
    assert len(here.waypoints_m) >= 4


@every_world
def test_no_two_faces_that_look_the_same_way_lie_in_one_plane_and_overlap(name: str) -> None:
    here = world(name, 0)
    # The jambs of a closed door meet its head where their backs are 5 mm from the leaf.
    assert [pair for pair in coplanar_pairs(here) if "jamb" not in pair[0]] == []


@every_world
def test_the_same_seed_gives_the_same_world_and_another_seed_another(name: str) -> None:
    first, again, other = make_world(name, 3), make_world(name, 3), world(name, 4)
    assert np.array_equal(first.vertices_m, again.vertices_m)
    assert np.array_equal(first.vertices_m, world(name, 3).vertices_m)
    assert all(np.array_equal(t.image, again.textures[key].image) for key, t in first.textures.items())
    assert first.vertices_m.shape != other.vertices_m.shape or not np.array_equal(first.vertices_m, other.vertices_m)


def test_another_seed_paints_otherwise() -> None:
    painters = {"books": books, "leaf": leaf}
    first, again, other = (painted(painters, seed) for seed in (3, 3, 4))
    for name in painters:
        assert np.array_equal(first[name].image, again[name].image)
        assert not np.array_equal(first[name].image, other[name].image)


@every_world
def test_no_world_is_larger_than_the_renderer_likes(name: str) -> None:
    assert max(len(world(name, seed).face_corners) for seed in SEEDS) <= 25_000


def test_glass_stands_in_the_office_and_at_the_entrance() -> None:
    assert glass(np.random.default_rng(0)).clear
    for name in ("entrance", "office"):
        panes = [s for s in world(name, 0).solids if any(f.texture == "glass" for f in s.faces)]
        assert len(panes) >= 4
        # Panes are thin, but closed bodies.
        assert all(np.ptp(s.vertices_m, axis=0).min() <= 0.05 for s in panes)


def along(waypoints_m: FloatArray) -> FloatArray:
    """Points (N, 2) every few centimetres of the path."""
    return np.concatenate([np.linspace(a, b, 150) for a, b in pairwise(waypoints_m)])


def band(vertices_m: FloatArray, low_m: float, high_m: float) -> FloatArray:
    """The plan (N, 2) of a solid if any of it is between two heights."""
    z = vertices_m[:, 2]
    return vertices_m[:, :2] if z.max() > low_m and z.min() < high_m else vertices_m[:0, :2]


def gap_m(path: FloatArray, points: FloatArray) -> FloatArray:
    """Distance (N,) of points of the path from the convex hull of a plan [m], at most 1 where it is clearly further."""
    low, high = points.min(axis=0), points.max(axis=0)
    rough = np.linalg.norm(np.maximum(np.maximum(low - path, path - high), 0), axis=1)
    near = path[rough < CLEARANCE_M]
    if len(near) == 0:
        return np.array([1.0])
    corners = points[ConvexHull(points).vertices]
    return polygon_distance_m(near, corners)


def polygon_distance_m(at: FloatArray, corners: FloatArray) -> FloatArray:
    """Distance (N,) of points (N, 2) from a counterclockwise convex polygon; 0 within."""
    side = np.roll(corners, -1, axis=0) - corners
    away = at[:, None] - corners
    share = np.clip((away * side).sum(axis=2) / (side**2).sum(axis=1), 0, 1)
    distance = np.linalg.norm(away - share[:, :, None] * side, axis=2).min(axis=1)
    outside = (side[:, 0] * away[:, :, 1] - side[:, 1] * away[:, :, 0] < 0).any(axis=1)
    return np.where(outside, distance, 0.0)


def coplanar_pairs(here: World) -> list[tuple[str, str]]:
    """Names of solids whose axis-aligned rectangular faces share a plane and a side and overlap by more than 1 mm."""
    groups: dict[tuple[int, int, int], list[tuple[str, FloatArray]]] = {}
    for solid in here.solids:
        for face in solid.faces:
            points = solid.vertices_m[list(face.corners)]
            normal = np.cross(points[1] - points[0], points[2] - points[0])
            axis = int(np.abs(normal).argmax())
            if np.ptp(points[:, axis]) < 1e-9:
                key = (axis, int(np.sign(normal[axis])), round(points[0, axis] * 5000))
                groups.setdefault(key, []).append((solid.name, np.delete(points, axis, axis=1)))
    return [pair for faces in groups.values() for pair in overlaps(faces)]


def overlaps(faces: list[tuple[str, FloatArray]]) -> list[tuple[str, str]]:
    low = np.array([points.min(axis=0) for _, points in faces]) + 0.001
    high = np.array([points.max(axis=0) for _, points in faces])
    hit = ((low[:, None] < high[None]) & (low[None] < high[:, None])).all(axis=2)
    pairs = [(int(i), int(j)) for i, j in np.argwhere(np.triu(hit, 1))]
    return [(faces[i][0], faces[j][0]) for i, j in pairs if shared(faces[i][1], faces[j][1])]


def shared(a: FloatArray, b: FloatArray) -> bool:
    """Whether two convex polygons overlap by more than 1 mm: no edge of either divides them."""
    for polygon in (a, b):
        side = np.roll(polygon, -1, axis=0) - polygon
        normals = np.stack([side[:, 1], -side[:, 0]], axis=1) / np.linalg.norm(side, axis=1)[:, None]
        for n in normals:
            if (a @ n).max() < (b @ n).min() + 0.001 or (b @ n).max() < (a @ n).min() + 0.001:
                return False
    return True
