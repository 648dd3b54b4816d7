"""Paths, kerbs and streets: stone laid on uneven ground."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from stereogrid.geometry import FloatArray

from ..scene.route import Route
from ..scene.skin import Skin, prism, skinned
from ..scene.solids import Solid
from ..scene.terrain import Terrain

PROUD_M = 0.015
"""Paths stand out of the ground by this much: what a wheel meets at their edge."""
DEEP_M = 0.12
PIECE_M = 0.5
STREET_CUTS = (44, 5)


def path(terrain: Terrain, route: Route, stations_m: tuple[float, float], texture: str) -> Iterator[Solid]:
    """Pieces of PIECE_M, 1.6 m wide, from one station to the other; on bends they fan out as wedges."""
    half = 0.8
    left, right = Route(route.offset(half)), Route(route.offset(-half))
    # A piece never bends: joints fall on every waypoint, and between them where the stones of the texture meet.
    starts = route.stations_m[(route.stations_m > stations_m[0]) & (route.stations_m < stations_m[1])]
    bounds = [stations_m[0], *starts.tolist(), stations_m[1]]
    for first, last in pairwise(bounds):
        phase = max(float(route.stations_m[route.stations_m <= first + 1e-9].max(initial=0.0)), 0.0)
        inner = phase + PIECE_M * np.arange(np.ceil((first - phase) / PIECE_M), np.ceil((last - phase) / PIECE_M))
        cuts = [first, *inner[(inner > first + 0.1) & (inner < last - 0.1)].tolist(), last]
        for a, b in pairwise(cuts):
            ends = (a, b)
            rim = np.concatenate([_chord(route, right, ends), _chord(route, left, ends)[::-1]])
            ahead = np.diff(route.at(np.array(ends)), axis=0)[0] / (ends[1] - ends[0])
            # Seen from above with the way up: right across it, down against it.
            out = rim - route.at(ends[0])
            st = np.stack([out @ [ahead[1], -ahead[0]], phase - ends[0] - out @ ahead], axis=1)
            yield _laid(f"path {a:.2f}", terrain, rim, (texture, st))


def kerb(terrain: Terrain, y_m: tuple[float, float], texture: str) -> Iterator[Solid]:
    """Kerbstones of 1 m between two rows of the ground, level with the green on their north side, proud by 2 cm."""
    low, high = terrain.bounds_m[:, 0] + [0.05, -0.05]
    edges = np.arange(low, high, 1.0)
    for k, (a, b) in enumerate(pairwise(edges)):
        rim = np.array([[a + 0.003, y_m[0]], [b - 0.003, y_m[0]], [b - 0.003, y_m[1]], [a + 0.003, y_m[1]]])
        north = terrain.height_m(np.column_stack([rim[:, 0], np.full(4, y_m[1] + 0.01)])) + 0.02
        top, bottom = np.column_stack([rim, north]), np.column_stack([rim, north - 0.4])
        yield prism(f"kerb {k}", bottom, top, (texture, rim * [1.0, -1.0] + [0.37 * k, 0.0]))


def street(terrain: Terrain, y_m: tuple[float, float], texture: str) -> Solid:
    """One strip along x, from edge to edge of the ground, 2 cm above it; cambered, as streets are."""
    low, high = terrain.bounds_m[:, 0] + [0.02, -0.02]
    m, n = STREET_CUTS
    x, y = np.meshgrid(np.linspace(low, high, m), np.linspace(*y_m, n), indexing="ij")
    camber = 0.02 + 0.05 * (1 - np.linspace(-1, 1, n) ** 2)
    top = np.stack([x, y, terrain.height_m(np.stack([x, y], axis=-1)) + camber], axis=-1).reshape(-1, 3)
    count = m * n
    cell = (np.arange(m - 1)[:, None] * n + np.arange(n - 1)).ravel()
    upper = np.stack([cell, cell + n, cell + n + 1, cell, cell + n + 1, cell + 1], axis=1).reshape(-1, 3)
    rim = np.concatenate([np.arange(0, count - n, n), np.arange(count - n, count - 1)])
    rim = np.concatenate([rim, count - 1 - rim])
    after = np.roll(rim, -1)
    sides = np.stack([rim + count, after + count, after, rim + count, after, rim], axis=1).reshape(-1, 3)
    triangles = np.concatenate([upper, upper[:, ::-1] + count, sides])
    vertices = np.concatenate([top, top - [0, 0, 0.3]])
    return skinned("street", vertices, triangles, Skin([texture] * len(triangles)))


def _chord(route: Route, side: Route, ends_m: tuple[float, float]) -> FloatArray:
    """The points (2, 2) of a side line that lie beside two stations of one leg of the route."""
    k = int(np.searchsorted(route.stations_m, 0.5 * (ends_m[0] + ends_m[1]), side="right") - 1)
    k = min(max(k, 0), len(route.waypoints_m) - 2)
    start, end = route.stations_m[k], route.stations_m[k + 1]
    share = (np.array(ends_m) - start) / (end - start)
    chord: FloatArray = side.waypoints_m[k] + share[:, None] * (side.waypoints_m[k + 1] - side.waypoints_m[k])
    return chord


def _laid(name: str, terrain: Terrain, rim_m: FloatArray, skin: tuple[str, FloatArray]) -> Solid:
    """A slab over a polygon (K, 2), its top PROUD_M above the ground at every corner."""
    top = np.column_stack([rim_m, terrain.height_m(rim_m) + PROUD_M])
    return prism(name, top - [0, 0, DEEP_M], top, skin)
