"""Benches, lamp posts, fences, low walls and bins: what stands about outdoors, rooted in uneven ground."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from stereogrid.geometry import FloatArray, from_yaw

from ..scene.solids import Paint, Solid, box, drum
from ..scene.terrain import Terrain

POST_RADIUS_M = 0.03


def grounded(terrain: Terrain, xy_m: FloatArray) -> FloatArray:
    """The point (3,) on the ground at (2,) [m]."""
    return np.array([*xy_m, float(terrain.height_m(xy_m))])


def bench(name: str, terrain: Terrain, xy_m: FloatArray, yaw_rad: float) -> Iterator[Solid]:
    """A slatted park bench, 1.6 m long, on concrete feet; it looks along yaw_rad."""
    T = from_yaw(yaw_rad, tuple(grounded(terrain, xy_m)))
    for side in (-0.62, 0.62):
        for part, x, top in (("front leg", 0.13, 0.4), ("rear leg", -0.235, 0.86)):
            low, high = (x - 0.025, side - 0.025, -0.25), (x + 0.025, side + 0.025, top)
            yield box(f"{name} {part} {side}", low, high, Paint("iron"), T_world_box=T)
        low, high = (-0.25, side - 0.02, 0.355), (0.2, side + 0.02, 0.4005)
        yield box(f"{name} bearer {side}", low, high, Paint("iron"), T_world_box=T)
    for k in range(4):
        x = -0.18 + 0.105 * k
        low, high = (x, -0.8, 0.401), (x + 0.085, 0.8, 0.44)
        yield box(f"{name} seat {k}", low, high, Paint("planks", shift_m=0.3 * k), T_world_box=T)
    for k in range(3):
        z = 0.5 + 0.125 * k
        low, high = (-0.209, -0.8, z), (-0.175, 0.8, z + 0.095)
        yield box(f"{name} back {k}", low, high, Paint("planks", shift_m=0.2 * k), T_world_box=T)


def lamp_post(name: str, foot_m: FloatArray, height_m: float) -> Iterator[Solid]:
    """A post 6 cm thick with a small foot and a flat head."""
    x, y, z = (float(a) for a in foot_m)
    yield drum(f"{name} foot", (x, y, z - 0.25), (0.062, 0.056), 0.45, paint=Paint("iron"))
    yield drum(f"{name} post", (x, y, z), (POST_RADIUS_M, POST_RADIUS_M), height_m, paint=Paint("iron"))
    yield drum(f"{name} head", (x, y, z + height_m - 0.02), (0.09, 0.22), 0.14, paint=Paint("iron"))
    yield drum(f"{name} glass", (x, y, z + height_m + 0.1), (0.15, 0.12), 0.1, paint=Paint("lamp glass"))


def bollard(name: str, foot_m: FloatArray) -> Iterator[Solid]:
    """A cast-iron bollard 0.9 m high."""
    x, y, z = (float(a) for a in foot_m)
    yield drum(f"{name} shaft", (x, y, z - 0.2), (0.07, 0.05), 1.0, paint=Paint("iron"))
    yield drum(f"{name} head", (x, y, z + 0.78), (0.065, 0.045), 0.12, paint=Paint("iron"))


def bin_on_post(name: str, foot_m: FloatArray) -> Iterator[Solid]:
    """A litter bin."""
    x, y, z = (float(a) for a in foot_m)
    yield drum(f"{name} stem", (x, y, z - 0.2), (0.04, 0.04), 0.55, paint=Paint("iron"), sides=8)
    yield drum(f"{name} can", (x, y, z + 0.3), (0.17, 0.2), 0.5, paint=Paint("bin paint"), sides=14)


def fence(terrain: Terrain, line_m: FloatArray, height_m: float) -> Iterator[Solid]:
    """A wooden fence along a straight line (2, 2) [m]: slats of 9 cm every 14 cm, repeated on purpose."""
    length = float(np.linalg.norm(line_m[1] - line_m[0]))
    ahead = (line_m[1] - line_m[0]) / length
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    for k, s in enumerate(np.arange(0.0, length - 0.1, 0.14)):
        T = from_yaw(yaw, tuple(grounded(terrain, line_m[0] + s * ahead)))
        # Sawn by hand: no two slats are equally long.
        top = height_m + 0.012 * np.sin(12.9 * k)
        low, high = (0.0, 0.0, -0.05), (0.09, 0.022, top)
        yield box(f"fence slat {k}", low, high, Paint("slat", shift_m=0.37 * k), T_world_box=T)
    for k, s in enumerate(np.arange(0.0, length - 2.1, 2.1)):
        here, there = (grounded(terrain, line_m[0] + a * ahead) for a in (s, s + 2.1))
        T = from_yaw(yaw, tuple(here))
        yield box(f"fence post {k}", (-0.05, -0.115, -0.4), (0.05, -0.028, height_m), Paint("slat"), T_world_box=T)
        for z in (0.25, height_m - 0.25):
            yield _rail(f"fence rail {k} {z:.2f}", T, float(there[2] - here[2]), z)


def _rail(name: str, T_world_post: FloatArray, rise_m: float, z_m: float) -> Solid:
    """A rail behind the slats, 2.1 m long, that rises with the ground from one post to the next."""
    shear = T_world_post.copy()
    shear[:3, 0] += [0, 0, rise_m / 2.1]
    return box(name, (0.04, -0.026, z_m), (2.06, -0.001, z_m + 0.09), Paint("slat"), T_world_box=shear)


def low_wall(terrain: Terrain, line_m: FloatArray, height_m: float) -> Iterator[Solid]:
    """A wall of rough blocks with a coping, 0.35 m thick, stepping down with the ground every 1.5 m."""
    length = float(np.linalg.norm(line_m[1] - line_m[0]))
    ahead = (line_m[1] - line_m[0]) / length
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    steps = np.linspace(0.0, length, max(round(length / 1.5), 1) + 1)
    for k, (a, b) in enumerate(pairwise(steps)):
        heights = terrain.height_m(line_m[0] + np.array([[a], [b]]) * ahead)
        T = from_yaw(yaw, (*(line_m[0] + a * ahead), float(heights.max())))
        step = float(b - a)
        yield box(f"low wall {k}", (0, -0.175, -0.7), (step, 0.175, height_m), Paint("ashlar"), T_world_box=T)
        low, high = (0.004, -0.2, height_m - 0.001), (step - 0.004, 0.2, height_m + 0.07)
        yield box(f"low wall coping {k}", low, high, Paint("concrete", shift_m=0.4 * k), T_world_box=T)
