"""Trees, bushes, hedges and grass: closed leaves a few millimetres thick about dark, closed cores.

Leaves and blades are folded diamonds: tetrahedra with the corners base, left, right and tip.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereogrid.geometry import FloatArray

from ..scene.skin import Skin, blob, cross, skinned, tube
from ..scene.solids import Solid
from ..scene.terrain import Terrain

LEAVES = ("leaf dark", "leaf mid", "leaf mid", "leaf light", "leaf pale")
UP = np.array([0.0, 0.0, 1.0])
BLADES = ("blade dark", "blade mid", "blade light")

# Corners of a leaf: base, right, tip, left. The ridge right-left is on its upper side.
_LEAF = np.array([(0, 1, 3), (1, 2, 3), (0, 2, 1), (0, 3, 2)])


@dataclass(frozen=True)
class Species:
    """How a tree grows. bark: a texture. trunk: (height of its lowest limbs, radius at breast height) [m].

    crown: (height of its centre, radius, half height) [m]; lumps: of how many lumps of foliage it is made, each with
    `leaves` leaves of length leaf_m; lump: how far out their centres are, and how large they are, as shares of it.
    """

    bark: str
    trunk: tuple[float, float]
    crown: tuple[float, float, float]
    lumps: int
    leaves: int
    leaf_m: float
    lump: tuple[float, float] = (0.7, 0.44)


SPECIES = {
    "lime": Species("bark", (2.2, 0.16), (4.6, 1.7, 2.0), 6, 56, 0.17),
    "birch": Species("birch", (2.2, 0.09), (4.6, 1.15, 2.3), 6, 58, 0.14),
    "maple": Species("bark", (2.0, 0.12), (3.9, 1.5, 1.5), 6, 56, 0.17),
    "apple": Species("bark", (1.3, 0.08), (2.45, 1.05, 0.8), 5, 76, 0.105),
    "far": Species("bark", (2.0, 0.18), (5.0, 2.3, 2.6), 4, 24, 0.34, (0.45, 0.58)),
}


def coat(
    rng: np.random.Generator, name: str, core: Solid, count: int, length_m: tuple[float, float], *, above_m: float
) -> Solid:
    """Leaves that grow out of a core's surface, everywhere alike, above a height; lengths from .. to [m]."""
    corners = core.vertices_m[np.array([face.corners for face in core.faces])]
    across = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1) * (corners[:, :, 2].mean(axis=1) > above_m)
    chosen = rng.choice(len(area), count, p=area / area.sum())
    share = rng.dirichlet((1.0, 1.0, 1.0), count)
    feet = np.einsum("nk,nkc->nc", share, corners[chosen])
    feet[:, 2] = np.maximum(feet[:, 2], above_m)
    outward = 0.5 * _unit(across[chosen]) + 0.5 * _unit(feet - core.vertices_m.mean(axis=0))
    size = rng.uniform(*length_m, count)[:, None]
    ahead = _unit(1.2 * outward + rng.normal(0, 0.45, (count, 3)) - [0, 0, 0.2])
    # The upper side of a leaf that points out looks up, of one that hangs looks out.
    upper = outward + UP + rng.normal(0, 0.4, (count, 3))
    upper = _unit(upper - (upper * ahead).sum(axis=1, keepdims=True) * ahead)
    return _folded(name, feet - 0.15 * size * ahead, (ahead * size, upper, 0.29 * size), rng.choice(LEAVES, count))


def grass(rng: np.random.Generator, name: str, feet_m: FloatArray, height_m: tuple[float, float]) -> Solid:
    """Blades that rise from feet_m (N, 3) and lean a little."""
    count = len(feet_m)
    size = rng.uniform(*height_m, count)[:, None]
    ahead = _unit(np.column_stack([rng.normal(0, 0.42, (count, 2)), np.ones(count)]))
    sideways = rng.normal(0, 1, (count, 3))
    upper = _unit(cross(ahead, sideways))
    names = rng.choice(BLADES, count)
    return _folded(name, feet_m, (ahead * size, upper, np.full((count, 1), 0.0035)), names)


def _folded(
    name: str, feet_m: FloatArray, shape: tuple[FloatArray, FloatArray, FloatArray], names: NDArray[np.str_]
) -> Solid:
    """Diamonds from feet_m (N, 3): shape is the way to the tip (N, 3), the upper side (N, 3), half the width (N, 1)."""
    ahead, upper, half = shape
    length = np.linalg.norm(ahead, axis=1, keepdims=True)
    right = cross(ahead / length, upper) * half
    waist = feet_m + 0.42 * ahead + 0.35 * half * upper
    corners = np.stack([feet_m, waist + right, feet_m + ahead, waist - right], axis=1)
    triangles = (4 * np.arange(len(feet_m))[:, None, None] + _LEAF).reshape(-1, 3)
    flat = np.zeros((len(feet_m), 4, 2))
    flat[:, 1, 0], flat[:, 3, 0] = 2 * half[:, 0], 0.0
    flat[:, [0, 2], 0] = half
    flat[:, 0, 1], flat[:, [1, 3], 1] = length[:, 0], 0.58 * length
    st = flat[:, _LEAF]
    # Seen from below, right and left change places.
    st[:, 2:, :, 0] = 2 * half[:, :, None] - st[:, 2:, :, 0]
    sizes = np.repeat(np.concatenate([2 * half, length], axis=1), 4, axis=0)
    skin = Skin(np.repeat(names, 4).tolist(), st.reshape(-1, 3, 2), sizes)
    return skinned(name, corners.reshape(-1, 3), triangles, skin, soft=True)


def tree(rng: np.random.Generator, name: str, foot_m: FloatArray, kind: str) -> Iterator[Solid]:
    """A tree whose trunk stands on foot_m (3,) and goes 0.3 m into the ground: trunk, limbs, core and leaves."""
    species = SPECIES[kind]
    grown = float(rng.uniform(0.85, 1.15))
    fork, radius = species.trunk[0] * grown, species.trunk[1] * grown
    top = species.crown[0] * grown
    tilt = np.array([*rng.normal(0, 0.04, 2), 1.0])
    heights = np.array([-0.3, 0.0, 0.12, 0.4, 0.9, fork, 0.5 * (fork + top), top])
    girth = np.array([1.9, 1.55, 1.25, 1.05, 1.0, 0.85, 0.6, 0.25])
    line = foot_m + heights[:, None] * tilt + np.column_stack([rng.normal(0, 0.012, (8, 2)), np.zeros(8)])
    line[:2, :2] = foot_m[:2]
    yield tube(f"{name} trunk", line, radius * girth, species.bark, sides=11)
    spread = np.array([species.crown[1], species.crown[1], species.crown[2]]) * grown
    # A spiral upwards leaves no side of the tree bare.
    turn = 2.4 * np.arange(species.lumps) + rng.uniform(0, 2 * np.pi)
    z = np.linspace(-0.75, 0.9, species.lumps)
    out = np.sqrt(1 - z**2) * rng.uniform(0.7, 1.0, species.lumps)
    centers = (
        foot_m + top * tilt + species.lump[0] * spread * np.column_stack([out * np.cos(turn), out * np.sin(turn), z])
    )
    for k, center in enumerate(centers):
        radii = spread * species.lump[1] * float(rng.uniform(0.87, 1.14))
        core = blob(rng, f"{name} core {k}", center, radii, "foliage", rough=(0.14, 0.11))
        yield core
        if kind != "far":
            yield _limb(f"{name} limb {k}", (line, center), (k / species.lumps, radius), species.bark)
        length = (0.75 * species.leaf_m, 1.25 * species.leaf_m)
        yield coat(rng, f"{name} leaves {k}", core, species.leaves, length, above_m=float(foot_m[2]) + 1.0)


def _limb(name: str, ends_m: tuple[FloatArray, FloatArray], shape: tuple[float, float], bark: str) -> Solid:
    """A limb from the trunk's line (8, 3) to a point (3,); shape: how far up it leaves, 0 to 1, the trunk's radius."""
    line, end = ends_m
    start = line[5] + (0.1 + 0.7 * shape[0]) * (line[7] - line[5])
    middle = 0.5 * (start + end) + [0, 0, 0.12 * float(np.linalg.norm(end - start))]
    return tube(name, np.array([start, middle, end]), shape[1] * np.array([0.42, 0.28, 0.08]), bark, sides=5)


def bush(rng: np.random.Generator, name: str, foot_m: FloatArray, size_m: tuple[float, float]) -> Iterator[Solid]:
    """A bush of a radius and a height, rooted in the ground: a dark core and leaves about it."""
    radius, height = size_m
    center = foot_m + 0.36 * height * UP
    radii = np.array([radius, radius, 0.64 * height])
    core = blob(rng, f"{name} core", center, 0.85 * radii, "foliage", rough=(0.12, 0.1), boxy=0.25)
    yield core
    count = int(520 * radius * height) + 70
    yield coat(rng, f"{name} leaves", core, count, (0.045, 0.085), above_m=float(foot_m[2]) + 0.08)


def hedge(
    rng: np.random.Generator, name: str, site: tuple[Terrain, FloatArray], size_m: tuple[float, float], leaf_m: float
) -> Iterator[Solid]:
    """A clipped hedge on (terrain, straight line (2, 2) [m]) of a width and a height: lumps under a coat of leaves."""
    terrain, line_m = site
    width, height = size_m
    length = float(np.linalg.norm(line_m[1] - line_m[0]))
    ahead = (line_m[1] - line_m[0]) / length
    left = np.array([-ahead[1], ahead[0]])
    lumps = max(round(length / (1.0 + 0.8 * height)), 1)
    radii = np.array([*(np.abs(ahead) * 0.72 * length / lumps + np.abs(left) * 0.44 * width), 0.54 * height])
    count = int(length * (2 * height + width) / leaf_m**2 * 0.32 / lumps)
    for k in range(lumps):
        xy = line_m[0] + ahead * length * (k + 0.5) / lumps
        ground = float(terrain.height_m(xy))
        center = np.array([*xy, ground + 0.4 * height])
        core = blob(rng, f"{name} core {k}", center, radii, "foliage", rough=(0.04, 0.07), boxy=0.7)
        yield core
        size = (0.8 * leaf_m, 1.25 * leaf_m)
        yield coat(rng, f"{name} leaves {k}", core, count, size, above_m=ground + 0.08)


def tufts(rng: np.random.Generator, name: str, centers_m: FloatArray, blades: int) -> Solid:
    """Tufts of so many blades each about centers_m (N, 3) on the ground, the blades' feet 1 cm in it."""
    feet = np.repeat(centers_m, blades, axis=0) - [0, 0, 0.01]
    feet[:, :2] += rng.normal(0, 0.045, (len(feet), 2))
    return grass(rng, name, feet, (0.07, 0.16))


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit
