"""A campus green: 62 m of path over paving and grass, between a street, a fence, a house and a hall.

Hard on purpose, little to match: the hall's rendered wall, car paint, smooth slabs in front of the house and in the
hall's shade, the sky. Hard on purpose, repeated: windows, bricks, paving stones and setts, fence slats, bench slats.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stereogrid.geometry import FloatArray, from_rotation, from_yaw

from ..scene.route import Route
from ..scene.scene import Sky, World
from ..scene.solids import Paint, Solid, box
from ..scene.terrain import Terrain
from ..scene.textures import Painter
from ..scene.textures import paint as varnish
from . import textures_outdoor as paint
from . import textures_plants as plant
from . import vegetation
from .car import WHEEL_X_M, car
from .facade import BAY_M, Front, house
from .outdoor_ground import KERB_Y_M, make_ground
from .paving import kerb, path, street
from .street_furniture import bench, bin_on_post, bollard, fence, grounded, lamp_post, low_wall

CORNERS_M = ((0.0, 0.0), (16.0, 0.0), (16.0, 18.0), (-4.0, 18.0), (-4.0, 6.5))
BEND_M = 2.5
PAVED_M = ((-1.5, 18.427, "pavers"), (29.4, 49.25, "slabs"), (49.25, 62.0, "setts"))
"""Stations of the paved stretches; between the first two the way goes over the mound's grass."""

STREET_Y_M = (-9.4, KERB_Y_M[0] + 0.01)
FRONT_Y_M = 20.8
HALL_X_M = -9.0

_PAINTERS: dict[str, Painter] = {
    "grass": plant.grass,
    "pavers": paint.pavers,
    "slabs": paint.slabs,
    "setts": paint.setts,
    "granite": paint.granite,
    "asphalt": paint.asphalt,
    "brick": paint.brick,
    "ashlar": paint.ashlar,
    "render coat": paint.render_coat,
    "concrete": paint.concrete,
    "bark": plant.bark,
    "birch": plant.birch,
    "foliage": plant.foliage,
    "planks": paint.planks,
    "slat": paint.slat,
    "roof tiles": paint.roof_tiles,
    "clouds": paint.clouds,
    "iron": varnish(0.22, 0.02),
    "bin paint": varnish(0.36, 0.02),
    "lamp glass": varnish(0.8, 0.02),
    "tail light": varnish(0.3, 0.03),
    "window frame": varnish(0.86, 0.01),
    "room": varnish(0.08, 0.01),
    "tyre": varnish(0.12, 0.015),
    "hub": varnish(0.62, 0.03),
    "plate": paint.number_plate,
    "car glass": paint.dark_glass,
    "leaf dark": plant.leaf_of(0.27),
    "leaf mid": plant.leaf_of(0.36),
    "leaf light": plant.leaf_of(0.45),
    "leaf pale": plant.leaf_of(0.54),
    "blade dark": varnish(0.3, 0.03),
    "blade mid": varnish(0.42, 0.03),
    "blade light": varnish(0.55, 0.03),
    **{f"car paint {k}": paint.car_paint for k in range(3)},
    **{f"window {k}": paint.window for k in range(4)},
    **{f"house front {k}": paint.house_front for k in range(3)},
}


@dataclass(frozen=True)
class Site:
    """The ground and the route of one seed: what everything is placed by."""

    terrain: Terrain
    route: Route

    def beside(self, station_m: float, lateral_m: float) -> FloatArray:
        """The point (3,) on the ground beside the route, lateral_m to its left."""
        return grounded(self.terrain, self.route.at(station_m, lateral_m))


def outdoor(seed: int) -> World:
    """The green; the seed shapes the land, plants it, parks the cars, sets the sun and paints everything."""
    site, solids = furnished(seed)
    streams = np.random.default_rng([seed, 1]).spawn(len(_PAINTERS))
    return World(
        name="outdoor",
        seed=seed,
        solids=solids,
        textures={name: painter(r) for (name, painter), r in zip(_PAINTERS.items(), streams, strict=True)},
        lamps=(),
        waypoints_m=site.route.waypoints_m,
        ambient=0.55,
        sky=_sky(np.random.default_rng([seed, 2])),
        terrain=site.terrain,
        surface="paving",
    )


def furnished(seed: int) -> tuple[Site, tuple[Solid, ...]]:
    """The ground and the route of a seed, and all bodies, the ground first; without paint and light."""
    land, plants, things = np.random.default_rng([seed, 0]).spawn(3)
    route = Route.rounded(CORNERS_M, BEND_M)
    site = Site(make_ground(land, route, "grass"), route)
    solids = (
        site.terrain.solid(),
        *_stone(site),
        *_buildings(site, things),
        *_furniture(site, things),
        *_cars(site, things),
        *_trees(site, plants),
        *_bushes(site, plants),
        *_tufts(site, plants),
    )
    return site, solids


def _sky(rng: np.random.Generator) -> Sky:
    """A summer's day between morning and evening: the sun somewhere in the south."""
    elevation, azimuth = np.deg2rad(rng.uniform(30, 55)), np.deg2rad(rng.uniform(-160, -20))
    level = float(np.cos(elevation))
    toward = (level * float(np.cos(azimuth)), level * float(np.sin(azimuth)), float(np.sin(elevation)))
    return Sky(horizon=0.88, zenith=0.62, clouds="clouds", sun_direction=toward, sun_power=float(rng.uniform(1.2, 1.6)))


def _stone(site: Site) -> Iterator[Solid]:
    """Paths, kerb and street."""
    for first, last, texture in PAVED_M:
        yield from path(site.terrain, site.route, (first, last), texture)
    yield from kerb(site.terrain, KERB_Y_M, "granite")
    yield street(site.terrain, STREET_Y_M, "asphalt")


def _buildings(site: Site, rng: np.random.Generator) -> Iterator[Solid]:
    """The house in the north, the bare hall in the west, a brick wall and houses over the street, more in the east."""
    bays = 12
    east_end = np.array([-9.4 + bays * BAY_M, FRONT_Y_M])
    T = from_yaw(np.pi, tuple(grounded(site.terrain, east_end - [0.5 * bays * BAY_M, 0.5])))
    T[:2, 3] = east_end
    order = tuple(int(k) for k in rng.integers(0, 4, 2 * bays))
    yield from Front("house", T, bays, int(rng.integers(2, bays - 4)), order).solids()
    z = float(site.terrain.height_m([HALL_X_M, 8.0]))
    yield box("hall", (-13.1, -1.0, z - 1.0), (HALL_X_M, 16.0, z + 4.6), Paint("render coat", shift_m=0.7))
    yield box("hall base", (-13.05, -1.03, z - 1.02), (HALL_X_M + 0.03, 16.03, z + 0.3), Paint("concrete"))
    yield box("hall roof", (-13.15, -1.2, z + 4.599), (HALL_X_M + 0.25, 16.2, z + 4.8), Paint("iron"))
    low, high = site.terrain.bounds_m[:, 0]
    yield box("brick wall", (low + 0.1, -10.75, -1.5), (high - 0.1, -10.5, 1.75), Paint("brick"))
    yield box("brick wall coping", (low + 0.06, -10.8, 1.749), (high - 0.06, -10.45, 1.82), Paint("concrete"))
    yield box("east wall", (29.6, -10.6, -1.5), (29.85, 3.4, 1.7), Paint("brick"))
    fronts = rng.integers(0, 3, 5)
    for k, (x0, x1) in enumerate(((-12.5, -3.0), (0.5, 10.0), (11.0, 20.4), (22.5, 29.5))):
        yield from house(f"house {k}", (x0, -14.9), (x1, -12.2), f"house front {fronts[k]}")
    yield from house("house 4", (26.6, 4.0), (30.4, 14.5), f"house front {fronts[4]}")


def _furniture(site: Site, rng: np.random.Generator) -> Iterator[Solid]:
    """Benches, lamps, bollards, bins, the fence along the mound and the low wall."""
    yield from fence(site.terrain, np.array([[17.9, 3.2], [17.9, 15.4]]), float(rng.uniform(1.0, 1.3)))
    yield from low_wall(site.terrain, np.array([[-6.3, 6.0], [-6.3, 14.5]]), float(rng.uniform(0.42, 0.55)))
    for k, (station, lateral) in enumerate(((2.2, -1.25), (11.6, -1.3), (32.3, -1.6), (46.4, 1.2), (59.4, 1.3))):
        foot = site.beside(station + float(rng.uniform(-0.4, 0.4)), lateral)
        yield from lamp_post(f"lamp post {k}", foot, float(rng.uniform(3.4, 3.8)))
    places = ((6.6, 1.55), (13.0, 1.7), (43.3, -1.75), (37.6, 1.6), (60.6, -1.5), (54.5, 1.6))
    chosen = sorted(int(k) for k in rng.choice(len(places), 4, replace=False))
    for k in chosen:
        station, lateral = places[k]
        toward = site.route.yaw_rad(station) - np.copysign(np.pi / 2, lateral)
        yaw = float(toward + rng.uniform(-0.06, 0.06))
        yield from bench(f"bench {k}", site.terrain, site.route.at(station, lateral), yaw)
        if rng.random() < 0.6:
            side = 1.25 if k != 3 else -1.25
            yield from bin_on_post(f"bin {k}", site.beside(station + side, lateral))
    for k, x in enumerate(np.arange(3.0, 17.5, 2.9)):
        yield from bollard(f"bollard {k}", grounded(site.terrain, np.array([x, -2.2])))


def _cars(site: Site, rng: np.random.Generator) -> Iterator[Solid]:
    """One car by the kerb, maybe a second, and one over the street."""
    paints = rng.permutation(3)
    places = [(float(rng.uniform(11.6, 13.2)), -3.95, 0.0), (float(rng.uniform(17.6, 19.4)), -4.0, 0.0)]
    places.append((float(rng.uniform(4.0, 12.0)), -8.2, np.pi))
    for k, (x, y, yaw) in enumerate(places):
        if k != 1 or rng.random() < 0.6:
            heading = yaw + float(rng.uniform(-0.02, 0.02))
            yield from car(f"car {k}", _parked(site.terrain, np.array([x, y]), heading), f"car paint {paints[k]}")


def _parked(terrain: Terrain, xy_m: FloatArray, yaw_rad: float) -> FloatArray:
    """The pose (4, 4) of a car on the street: its axles on the ground, 3 cm of asphalt above the terrain."""
    ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    rear, front = (float(terrain.height_m(xy_m + x * ahead[:2])) for x in WHEEL_X_M)
    forward = ahead * (WHEEL_X_M[1] - WHEEL_X_M[0]) + [0, 0, front - rear]
    forward /= np.linalg.norm(forward)
    left = np.array([-ahead[1], ahead[0], 0.0])
    R = np.column_stack([forward, left, np.cross(forward, left)])
    return from_rotation(R, (*xy_m, 0.5 * (rear + front) + 0.04))


_NEAR_TREES = (
    # Station, lateral, kinds to choose from.
    (4.0, 2.5, ("lime", "maple")),
    (9.6, 2.1, ("birch", "lime", "maple")),
    (15.6, -2.7, ("birch", "maple")),
    (20.4, 2.2, ("lime", "birch")),
    (26.3, 1.9, ("maple", "apple", "birch")),
    (31.0, 2.4, ("apple", "maple")),
    (40.4, 2.6, ("lime", "maple")),
    (48.4, 2.4, ("birch", "apple")),
    (51.4, -3.0, ("birch", "lime")),
    (57.4, 2.2, ("maple", "lime")),
)
_FAR_TREES_M = ((22.8, 3.4), (24.0, 10.5), (22.4, 18.0), (24.8, -1.6), (21.3, -11.9), (-1.2, -12.8))


def _trees(site: Site, rng: np.random.Generator) -> Iterator[Solid]:
    """Ten by the path, one in the middle of the green, some behind the fence and over the street."""
    for k, (station, lateral, kinds) in enumerate(_NEAR_TREES):
        away = lateral + np.copysign(float(rng.uniform(0, 0.4)), lateral)
        foot = site.beside(station + float(rng.uniform(-0.35, 0.35)), away)
        yield from vegetation.tree(rng, f"tree {k}", foot, str(rng.choice(kinds)))
    foot = grounded(site.terrain, np.array([6.0, 8.5]) + rng.uniform(-1.5, 1.5, 2))
    yield from vegetation.tree(rng, "tree 10", foot, "lime")
    for k, place in enumerate(_FAR_TREES_M):
        foot = grounded(site.terrain, np.array(place) + rng.uniform(-0.4, 0.4, 2))
        yield from vegetation.tree(rng, f"far tree {k}", foot, "far")


_BUSHES = (
    # Station, lateral, smallest and largest radius [m].
    (5.0, -1.55, 0.3, 0.42),
    (18.6, 1.7, 0.5, 0.7),
    (23.2, 1.55, 0.4, 0.6),
    (28.8, 1.6, 0.4, 0.6),
    (29.6, -1.5, 0.35, 0.5),
    (35.6, -1.75, 0.4, 0.55),
    (39.0, -1.8, 0.4, 0.6),
    (40.6, -1.75, 0.4, 0.55),
    (47.4, -1.75, 0.4, 0.6),
    (51.0, 1.6, 0.4, 0.6),
    (56.0, -1.5, 0.4, 0.5),
)


def _bushes(site: Site, rng: np.random.Generator) -> Iterator[Solid]:
    """Bushes by the path, each there or not, a hedge in front of the house and a tall one in the east."""
    for k, (station, lateral, *radii) in enumerate(_BUSHES):
        if rng.random() < 0.85:
            radius = float(rng.uniform(radii[0], radii[1]))
            foot = site.beside(station + float(rng.uniform(-0.2, 0.2)), lateral)
            yield from vegetation.bush(rng, f"bush {k}", foot, (radius, radius * float(rng.uniform(1.3, 2.0))))
    line = np.array([[8.6, 16.35], [4.9, 16.35]])
    yield from vegetation.hedge(rng, "hedge", (site.terrain, line), (0.7, float(rng.uniform(0.7, 0.95))), 0.055)
    line = np.array([[20.8, -1.8], [20.8, 27.5]])
    yield from vegetation.hedge(rng, "far hedge", (site.terrain, line), (1.0, 1.7), 0.21)
    line = np.array([[-12.2, 16.0], [-12.2, 21.3]])
    yield from vegetation.hedge(rng, "west hedge", (site.terrain, line), (1.0, 2.0), 0.16)


def _tufts(site: Site, rng: np.random.Generator) -> Iterator[Solid]:
    """Uncut grass where no mower goes: along the edges of the path, thicker on the mound."""
    stations = np.concatenate([rng.uniform(0, site.route.length_m, 100), rng.uniform(17.5, 30.5, 80)])
    lateral = rng.choice([-1.0, 1.0], len(stations)) * (0.86 + np.abs(rng.normal(0, 0.4, len(stations))))
    xy = site.route.at(stations, lateral)
    # On the inner side of a bend, what is beside one stretch may stand on the other.
    xy = xy[site.route.nearest(xy)[0] > 0.85]
    feet = np.column_stack([xy, site.terrain.height_m(xy)])
    for k, some in enumerate(np.array_split(feet, 16)):
        yield vegetation.tufts(rng, f"tufts {k}", some, 9)
