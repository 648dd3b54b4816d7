"""The outdoor world's ground: a green with a mound, level across the path, falling to a street behind a kerb."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from stereogrid.geometry import FloatArray

from ..scene.route import SAMPLE_M, Route
from ..scene.terrain import Terrain
from ..scene.textures import noise

PITCH_M = 0.35
ORIGIN_M = (-13.3, -15.1)
SHAPE = (123, 127)
"""Rows and columns of the lattice: 44 m each way. Two of its rows are the edges of the kerb."""

KERB_Y_M = (-2.85, -2.5)
KERB_DROP_M = 0.10
"""The street lies this much lower than the green."""

STEEPEST_RAD = np.deg2rad(9.2)
"""Steepest slope along the path, on the mound."""

MOUND_M = (16.0, 8.7, 4.6)
"""Centre x, y of the mound and half of its length along y [m]."""

LEVEL_M = (1.1, 2.8)
"""The ground is level across the path up to the first distance from it, and its own beyond the second [m]."""

FACADE_Y_M = 18.0
"""From here to the building the ground is level across the path."""

SWELL_M = 0.10
ROUGH_M = 0.006


@dataclass(frozen=True)
class _Hills:
    """Smooth heights of one shape of the land, before the path is levelled; z (R, C) on the lattice of xy."""

    z_m: FloatArray

    def at(self, xy_m: FloatArray) -> FloatArray:
        column, row = ((xy_m[..., k] - ORIGIN_M[k]) / PITCH_M for k in (0, 1))
        height: FloatArray = map_coordinates(self.z_m, [row, column], order=1, mode="nearest")
        return height


def make_ground(rng: np.random.Generator, route: Route, texture: str) -> Terrain:
    """The green of a seed: the mound is as high as the steepest slope on the path allows. Heights start at z = 0."""
    xy = lattice_m()
    swell = SWELL_M * noise(rng, (256, 256), power=2.2, finest_px=12)[: SHAPE[0], : SHAPE[1]].astype(np.float64)
    # The land calms down towards the house, the street and the middle of the green's edges.
    swell *= np.clip((21.0 - xy[..., 1]) / 8.0, 0.4, 1.0)
    away = ((xy[..., 0] - MOUND_M[0]) / 5.5) ** 2
    along = np.clip((xy[..., 1] - MOUND_M[1]) / MOUND_M[2], -1, 1)
    mound = np.cos(0.5 * np.pi * along) ** 2 * np.exp(-away)
    rough = noise(rng, (256, 256), power=0.8, finest_px=1.5)[: SHAPE[0], : SHAPE[1]] * _wildness(xy, route) * ROUGH_M
    base = _levelled(_Hills(swell), xy, route) + rough
    hump = _levelled(_Hills(mound), xy, route)
    heights = base + _height_of_mound(base, hump, route) * hump
    heights = heights - _profile(heights, route)[0]
    heights[xy[..., 1] < sum(KERB_Y_M) / 2] -= KERB_DROP_M
    return Terrain(heights, ORIGIN_M, PITCH_M, texture)


def lattice_m() -> FloatArray:
    """(R, C, 2): x, y of the lattice's points [m]."""
    x, y = (ORIGIN_M[k] + np.arange(n) * PITCH_M for k, n in ((0, SHAPE[1]), (1, SHAPE[0])))
    return np.stack(np.meshgrid(x, y), axis=-1)


def _levelled(hills: _Hills, xy: FloatArray, route: Route) -> FloatArray:
    """Heights (R, C) with the same height across the path, across the street and in front of the house."""
    bent = xy.copy()
    # A soft corner: level across to the south of the first leg, and to the north of the third.
    bent[..., 1] = np.clip(np.logaddexp(0.0, 4 * xy[..., 1]) / 4, None, FACADE_Y_M)
    distance, station = route.nearest(xy)
    share = np.clip((distance - LEVEL_M[0]) / (LEVEL_M[1] - LEVEL_M[0]), 0, 1)
    share = share * share * (3 - 2 * share)
    on_path = route.at(station)
    on_path[..., 1] = np.clip(np.logaddexp(0.0, 4 * on_path[..., 1]) / 4, None, FACADE_Y_M)
    return share * hills.at(bent) + (1 - share) * hills.at(on_path)


def _wildness(xy: FloatArray, route: Route) -> FloatArray:
    """How rough the ground is, (R, C) 0 to 1: the lawn is, what lies under stones is not."""
    distance, _ = route.nearest(xy)
    beside = np.clip((distance - 1.2) / 0.6, 0, 1)
    on_grass = np.clip(3.5 - np.abs(xy[..., 1] - 9.0) / 1.5, 0, 1) * (np.abs(xy[..., 0] - 16.0) < 3)
    in_green = np.clip((xy[..., 1] + 1.0) / 0.6, 0, 1)
    wild: FloatArray = np.maximum(beside, on_grass) * in_green
    return wild


def _profile(heights: FloatArray, route: Route) -> FloatArray:
    """Heights along the path, every 0.2 m."""
    terrain = Terrain(heights, ORIGIN_M, PITCH_M, "")
    stations = np.arange(0.0, route.length_m, 4 * SAMPLE_M)
    return terrain.height_m(route.at(stations))


def _height_of_mound(base: FloatArray, hump: FloatArray, route: Route) -> float:
    """The height [m] that makes the steepest slope along the path what it should be: heights are linear in it."""
    slope_base, slope_hump = (np.diff(_profile(z, route)) / (4 * SAMPLE_M) for z in (base, hump))
    low, high = 0.0, 2.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        steep = np.abs(slope_base + middle * slope_hump).max() > np.tan(STEEPEST_RAD)
        low, high = (low, middle) if steep else (middle, high)
    return low
