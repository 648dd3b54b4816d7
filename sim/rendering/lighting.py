"""Light baked once a world: on every face a sheet of brightness from the sky, the sun and the lamps, with shadows."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from stereogrid.geometry import FloatArray

from ..scene.scene import Lamp, Sky, World
from .casting import FAR_M, Target
from .shapes import Bodies
from .sheets import Grid, Ground, Spots, lay_out, spots
from .sky import sun_of
from .vectors import lengths_along

GLOOM_M = 0.5
"""How far a surface darkens its neighbours [m]."""
AMBIENT_RAYS = 32
BOUNCE = 0.45
"""What comes back from things, beside what comes from an open sky."""
LAMP_REACH_M = 7.0
EXPOSURE = 0.95
WORKERS = 2
OFF_M = 2e-3
"""Off the surface, or float32 rays would meet the face that they start from."""


_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Sheets:
    """lights: flat float32 factors on the texture's brightness; 0 on what moves, which comes last.

    sheets (F, 8): start, columns, rows, s0, t0 [m], texels per metre along s and t, levels. Each further level has
    half the columns and rows, and follows the last.
    """

    lights: NDArray[np.float32]
    sheets: FloatArray


@dataclass(frozen=True)
class OwnLight:
    """What is known of a moving body's light before it moves: openness (N,) of its N texels, points and normals
    (N, 3) in its frame, and glows (N,)."""

    openness: FloatArray
    points: FloatArray
    normals: FloatArray
    glows: NDArray[np.bool_]


def bake(
    world: World, bodies: Bodies, targets: Sequence[Target], glows: NDArray[np.bool_]
) -> tuple[Sheets, list[OwnLight]]:
    """The light on every face of the static world, and what the other bodies need to be lit where they are.

    targets: what casts shadows, for each body. glows (F,): faces that are lamps themselves. The directions are the
    same everywhere, so that the light is smooth and needs no random numbers.
    """
    grid, ground = lay_out(world, bodies), Ground(bodies)
    static = slice(0, grid.n_static)

    def coarse(spot: Spots) -> FloatArray:
        return world.ambient * openness(targets[0], spot, world.sky) + lamps_light(targets[0], world.lamps, spot)

    def fine(spot: Spots) -> tuple[Spots, FloatArray]:
        total = _coarse_light(grid, light, spot)
        if world.sky is not None and world.sky.sun_power > 0:
            total += sun_light(targets[:1], world.sky, spot)
        return spot, np.where(glows[grid.face[spot.sheet]], 1.0, shown(total))

    light = np.concatenate(list(_each(coarse, spots(grid, bodies, ground, sheets=static, fine=False))))
    starts, lengths = _starts(grid)
    lights = np.zeros(int(lengths.sum()), np.float32)
    for spot, brightness in _each(fine, spots(grid, bodies, ground, sheets=static, fine=True)):
        columns = (grid.counts[:, 0] * grid.zoom)[spot.sheet]
        lights[starts[spot.sheet] + spot.cell[:, 1] * columns + spot.cell[:, 0]] = brightness
    _halve(grid, starts, lights)
    return Sheets(lights, _table(grid, starts)), _own_lights(grid, bodies, ground, targets, glows)


def _each(work: Callable[[Spots], _Result], chunks: Iterable[Spots]) -> Iterator[_Result]:
    """The results for all chunks, in order, by a few threads that hold a few chunks at a time."""
    with ThreadPoolExecutor(WORKERS) as pool:
        waiting: deque[Future[_Result]] = deque()
        for chunk in chunks:
            waiting.append(pool.submit(work, chunk))
            if len(waiting) > WORKERS:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def shown(light: FloatArray) -> FloatArray:
    """Eyes and cameras compress: a soft shoulder, then the square root that textures are stored in."""
    brightness: FloatArray = EXPOSURE * np.sqrt(light / (0.75 + 0.25 * light))
    return brightness


def openness(target: Target, spot: Spots, sky: Sky | None) -> FloatArray:
    """How little stands close by, or, under a sky, how much of it is seen: 0 to 1, weighted by the cosine."""
    normals = spot.normals
    tangent = np.cross(normals, np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[0.0, 1.0, 0.0]]))
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normals, tangent)
    origins = spot.points + OFF_M * normals
    total = np.zeros(len(origins))
    for k in range(AMBIENT_RAYS):
        # Fibonacci points on the disc, lifted to the sphere, are distributed as the cosine.
        radius, angle = np.sqrt((k + 0.5) / AMBIENT_RAYS), k * np.pi * (3 - np.sqrt(5))
        a, b, c = radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)
        distance = target.distance_m(origins, a * tangent + b * bitangent + c * normals)
        near = 1 - np.exp(-distance / GLOOM_M)
        total += near if sky is None else np.where(distance > FAR_M, 1.0, BOUNCE * near)
    return total / AMBIENT_RAYS


def sun_light(targets: Sequence[Target], sky: Sky, spot: Spots) -> FloatArray:
    """The sun's light (N,), where no target is in its way."""
    sun = sun_of(sky)
    cosine = np.maximum(lengths_along(spot.smooth, sun), 0.0)
    lit = np.flatnonzero((cosine > 0) & (lengths_along(spot.normals, sun) > 0))
    origins = spot.points[lit] + OFF_M * spot.normals[lit]
    free = np.ones(len(lit), np.bool_)
    for target in targets:
        free &= ~target.blocked(origins, np.broadcast_to(sun, origins.shape))
    light = np.zeros(len(cosine))
    light[lit] = sky.sun_power * free * cosine[lit]
    return light


def lamps_light(target: Target | None, lamps: tuple[Lamp, ...], spot: Spots) -> FloatArray:
    """The light (N,) of all lamps, each from the four quarters of its face; with shadows where a target is given."""
    light = np.zeros(len(spot.points))
    origins = spot.points + OFF_M * spot.normals
    for lamp in lamps:
        center = np.array(lamp.center_m) - [0, 0, 0.01]
        for i, j in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            away = center + np.array([i * lamp.size_m[0] / 4, j * lamp.size_m[1] / 4, 0]) - origins
            distance = np.linalg.norm(away, axis=1)
            cosines = (away * spot.normals).sum(axis=1) / distance * away[:, 2] / distance
            near = np.flatnonzero((cosines > 0) & (away[:, 2] > 0) & (distance < LAMP_REACH_M))
            free = np.ones(len(near), np.bool_)
            if target is not None and len(near):
                found = target.distance_m(origins[near], away[near] / distance[near, None])
                free = found > distance[near] - 0.02
            light[near] += lamp.power * free * cosines[near] / (0.3 + distance[near] ** 2)
    return light


def _own_lights(
    grid: Grid, bodies: Bodies, ground: Ground, targets: Sequence[Target], glows: NDArray[np.bool_]
) -> list[OwnLight]:
    """Of each moving body, without the world round it."""
    found = []
    body = bodies.body_of_face[grid.face]
    for k in range(1, len(targets)):
        mine = slice(int(np.searchsorted(body, k)), int(np.searchsorted(body, k, side="right")))
        parts = list(spots(grid, bodies, ground, sheets=mine, fine=False))
        open_ = np.concatenate([openness(targets[k], part, None) for part in parts])
        points, normals = (np.concatenate([getattr(p, name) for p in parts]) for name in ("points", "smooth"))
        sheet = np.concatenate([part.sheet for part in parts])
        found.append(OwnLight(open_, points, normals, glows[grid.face[sheet]]))
    return found


def _starts(grid: Grid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each sheet's texels start (M,), and how many they are with all their levels."""
    lengths = np.zeros(len(grid.zoom), np.int64)
    for level in range(int(grid.zoom.max()).bit_length()):
        zoom = grid.zoom >> level
        lengths += grid.counts.prod(axis=1) * zoom**2
    return np.concatenate([[0], np.cumsum(lengths)])[:-1], lengths


def _table(grid: Grid, starts: NDArray[np.int64]) -> FloatArray:
    """(F, 8), see Sheets."""
    counts = grid.counts * grid.zoom[:, None]
    levels = np.log2(grid.zoom).round() + 1
    table: FloatArray = np.column_stack([starts, counts, grid.low, counts / grid.size, levels])[grid.of_face]
    return np.ascontiguousarray(table)


def _coarse_light(grid: Grid, light: FloatArray, spot: Spots) -> FloatArray:
    """The light (N,) of coarse texels, interpolated at fine ones."""
    starts = np.concatenate([[0], np.cumsum(grid.counts.prod(axis=1))])[spot.sheet]
    counts = grid.counts[spot.sheet]
    at = np.clip((spot.cell + 0.5) / grid.zoom[spot.sheet, None] - 0.5, 0, counts - 1)
    low = at.astype(np.int64)
    high = np.minimum(low + 1, counts - 1)
    fx, fy = (at - low).T
    top, bottom = (starts + row * counts[:, 0] for row in (low[:, 1], high[:, 1]))
    upper = (1 - fx) * light[top + low[:, 0]] + fx * light[top + high[:, 0]]
    lower = (1 - fx) * light[bottom + low[:, 0]] + fx * light[bottom + high[:, 0]]
    total: FloatArray = (1 - fy) * upper + fy * lower
    return total


def _halve(grid: Grid, starts: NDArray[np.int64], lights: NDArray[np.float32]) -> None:
    """Write the further levels of the sheets that have some."""
    for m in np.flatnonzero(grid.zoom[: grid.n_static] > 1):
        start, (columns, rows) = int(starts[m]), grid.counts[m] * grid.zoom[m]
        for _ in range(int(grid.zoom[m]).bit_length() - 1):
            fine = lights[start : start + columns * rows].reshape(rows // 2, 2, columns // 2, 2)
            start, columns, rows = start + columns * rows, columns // 2, rows // 2
            lights[start : start + columns * rows] = fine.mean(axis=(1, 3)).ravel()
