"""The shade that what moves throws on what stands: of the sun, by shadow rays, and of light from everywhere.

For the latter each moving solid is a few balls, whose share of the sky over a point is known in closed form.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stereogrid.geometry import FloatArray, inverse
from stereogrid.observation import FloatImage

from ..kernel import kernel
from ..scene.scene import World
from ..scene.solids import Solid
from .casting import Target
from .lighting import EXPOSURE, OFF_M, shown
from .shading import Surfaces, sheet_light
from .shapes import Bodies, Shapes
from .sky import sun_of
from .vectors import lengths_along, placed, turned

GLOOM = 0.8
"""How much darker it is under a ball that covers the whole sky."""
REACH = 3.0
"""A moving body, taken as a ball, darkens what is within so many of its radii."""
SUNLESS = 0.9
"""A point in the sun is brighter than this share of the light from everywhere."""
MOST_BALLS = 8

Faces = NDArray[np.int32]


@dataclass(frozen=True)
class Silhouette:
    """A moving body, coarsely, in its own frame: a ball round it (4,): middle and radius [m], and many in it (K, 4)."""

    hull: FloatArray
    balls: FloatArray


@kernel
def _near(points: FloatArray, hulls: FloatArray, sun: FloatArray, reach: float) -> NDArray[np.int64]:
    """The places of those points (N, 3) that some hull (B, 4) may shade. sun (3,): 0 if it does not shine."""
    found, count = np.empty(len(points), np.int64), 0
    for i in range(len(points)):
        for b in range(len(hulls)):
            x, y, z = points[i, 0] - hulls[b, 0], points[i, 1] - hulls[b, 1], points[i, 2] - hulls[b, 2]
            far2, radius = x * x + y * y + z * z, hulls[b, 3]
            along = x * sun[0] + y * sun[1] + z * sun[2]
            in_sun_shade = along < 0.0 and far2 - along * along < radius * radius
            if in_sun_shade or far2 < (reach * radius) ** 2:
                found[count] = i
                count += 1
                break
    return found[:count]


@kernel
def _cover(points: FloatArray, normals: FloatArray, balls: FloatArray) -> FloatArray:
    """The share (N,) of light from everywhere that balls (K, 4) keep from points with normals (N, 3)."""
    cover = np.empty(len(points))
    for i in range(len(points)):
        free = 1.0
        for k in range(len(balls)):
            x, y, z = balls[k, 0] - points[i, 0], balls[k, 1] - points[i, 1], balls[k, 2] - points[i, 2]
            far2 = x * x + y * y + z * z
            size = balls[k, 3] * balls[k, 3] / far2
            slant = (x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2]) / np.sqrt(far2)
            # A ball that reaches below the horizon still shows its upper part.
            part = (slant + np.sqrt(size)) / (1.0 + np.sqrt(size))
            if part > 0.0:
                free *= 1.0 - min(size, 1.0) * min(part, 1.0)
        cover[i] = 1.0 - free
    return cover


def silhouette(solids: Sequence[Solid]) -> Silhouette:
    """That of a body of solids (at least one)."""
    balls = np.concatenate([_balls(solid) for solid in solids])
    vertices = np.concatenate([solid.vertices_m for solid in solids])
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    return Silhouette(np.append(middle, np.linalg.norm(vertices - middle, axis=1).max()), balls)


def _balls(solid: Solid) -> FloatArray:
    """(K, 4): balls strung along the longest side of a solid's box."""
    low, high = solid.vertices_m.min(axis=0), solid.vertices_m.max(axis=0)
    size = high - low
    longest = int(np.argmax(size))
    width = max(float(np.sort(size)[:2].mean()), float(size[longest]) / MOST_BALLS)
    ends = np.linspace(low[longest], high[longest], max(round(float(size[longest]) / width), 1) + 1)
    balls = [np.append((low + high) / 2, width / 2) for _ in ends[1:]]
    for ball, (a, b) in zip(balls, pairwise(ends), strict=True):
        ball[longest] = (a + b) / 2
    return np.array(balls)


@dataclass(frozen=True)
class Shadows:
    """silhouettes, targets: of the moving bodies, from the first on."""

    world: World
    bodies: Bodies
    silhouettes: Sequence[Silhouette]
    targets: Sequence[Target]

    def dimmed(
        self, gray: FloatImage, points: FloatArray, faces: Faces, at: tuple[Mapping[int, FloatArray], Surfaces]
    ) -> FloatImage:
        """Brightness (N,) of faces at points (N, 3) in world, in the shade of moving bodies, given that without it."""
        poses, surfaces = at
        moving = {k: T for k, T in poses.items() if k}
        if not moving:
            return gray
        hulls = np.array([_placed(self.silhouettes[k - 1].hull[None], T)[0] for k, T in moving.items()])
        near = _near(points, hulls, self._sun, REACH)
        near = near[(faces[near] >= 0) & (faces[near] < self.bodies.face_starts[1])]
        balls = np.concatenate([_placed(self.silhouettes[k - 1].balls, T) for k, T in moving.items()])
        dimmed = gray.copy()
        dimmed[near] *= self._factor(points[near], faces[near], (balls, moving), (self.bodies.shapes, surfaces))
        return dimmed

    def _factor(
        self,
        points: FloatArray,
        faces: Faces,
        moving: tuple[FloatArray, Mapping[int, FloatArray]],
        scene: tuple[Shapes, Surfaces],
    ) -> FloatArray:
        """How much darker (N,) points on the static world are."""
        normals, sun, ambient = self.bodies.shapes.normals[faces], self._sun, self.world.ambient
        bright = sheet_light(*scene, faces, points).astype(np.float64)
        squared = np.minimum((bright / EXPOSURE) ** 2, 3.9)
        light = 0.75 * squared / (1 - 0.25 * squared)
        everywhere = np.minimum(light, ambient) if sun.any() else light
        left = light - GLOOM * everywhere * _cover(points, normals, moving[0])
        if self.world.sky is not None and sun.any():
            share = np.clip(
                light - SUNLESS * ambient, 0, self.world.sky.sun_power * np.maximum(lengths_along(normals, sun), 0)
            )
            left -= share * self._in_shade(points + OFF_M * normals, share > 0, moving[1])
        factor: FloatArray = shown(np.maximum(left, 0)) / np.maximum(bright, 1e-6)
        return factor

    def _in_shade(
        self, origins: FloatArray, asked: NDArray[np.bool_], moving: Mapping[int, FloatArray]
    ) -> NDArray[np.bool_]:
        shade = np.zeros(len(origins), np.bool_)
        for k, T_world_body in moving.items():
            mine = np.flatnonzero(asked & ~shade)
            T = inverse(T_world_body)
            sun = turned(np.tile(self._sun, (len(mine), 1)), T)
            shade[mine] = self.targets[k - 1].blocked(placed(origins[mine], T), sun)
        return shade

    @property
    def _sun(self) -> FloatArray:
        """Unit vector (3,) towards the sun, 0 where none shines."""
        sky = self.world.sky
        if sky is None or sky.sun_power <= 0:
            return np.zeros(3)
        return sun_of(sky)


def _placed(balls: FloatArray, T_world_body: FloatArray) -> FloatArray:
    return np.column_stack([placed(balls[:, :3], T_world_body), balls[:, 3]])
