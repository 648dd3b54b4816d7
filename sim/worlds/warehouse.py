"""A warehouse: 35 m of path round a row of pallet racks, in a hall 5.5 m high."""

from collections.abc import Iterator
from math import pi

import numpy as np

from ..scene import textures as paint
from ..scene.scene import World
from ..scene.solids import Paint, Solid, box, drum, placed
from ..scene.textures import Painter
from . import storage
from . import textures_building as building
from . import textures_indoor as indoor
from .fittings import lamp_fitting, lamp_grid, slabs, spread
from .palette import BUILDING, painted
from .textures_indoor import VARNISH, glossy
from .walls import THICKNESS_M, Wall

LOW_M, HIGH_M = (-3.0, -2.3), (15.2, 7.6)
"""Corners of the hall inside."""
HEIGHT_M = 5.5
LAMP_M, LAMP_POWER = 4.75, 3.0

_PAINTERS: dict[str, Painter] = {
    **BUILDING,
    "hall floor": building.hall_floor,
    "marking": building.marking,
    "concrete": building.concrete,
    "steel panel": building.steel_panel,
    "ribbed sheet": building.ribbed_sheet,
    "roof": indoor.ribbed,
    "gate": building.slats,
    "upright": building.upright,
    "beam": paint.paint(0.55, 0.015),
    "rough wood": building.rough_wood,
    "stock carton": building.stock_carton,
    "carton 0": paint.cardboard,
    "rubber": paint.paint(0.16, 0.02),
    "truck varnish": paint.paint(0.66, 0.012),
    "seat cloth 0": indoor.cloth(0.2),
    "barrel blue": glossy(paint.paint(0.30, 0.02), VARNISH),
    "barrel grey": glossy(paint.paint(0.52, 0.02), VARNISH),
}


def warehouse(seed: int) -> World:
    """The warehouse; the seed paints it, fills its racks and places what stands along the walls.

    Repeated texture: uprights with their slots, beams, one and the same carton some hundred times, pallets, the
    slats and holes of the gate, the ribbed sheet of the north and west wall, the roof. Hardly any texture: the steel
    panels of the south wall, the concrete of the east wall, the forklift's body, the barrels.
    """
    rng = np.random.default_rng([seed, 0])
    walls = _walls()
    lamps = lamp_grid(spread(-2.0, 14.6, 6), (-0.2, 5.0), (1.5, 0.3), z_m=LAMP_M, power=LAMP_POWER)
    lamps += lamp_grid((-0.8, 13.4), (2.4,), (1.5, 0.3), z_m=LAMP_M, power=LAMP_POWER)
    solids = [
        *_floor_and_roof(),
        *(solid for wall in walls for solid in wall.solids()),
        *_frame(),
        *(solid for k, lamp in enumerate(lamps) for solid in lamp_fitting(k, lamp, HEIGHT_M)),
        *_racks(rng),
        *_on_the_floor(rng),
        *_on_the_walls(walls),
        *_gate(walls[3]),
    ]
    return World(
        name="warehouse",
        seed=seed,
        solids=tuple(solids),
        textures=painted(_PAINTERS, seed),
        lamps=tuple(lamps),
        waypoints_m=np.array([[0.0, 0.0], [12.6, 0.0], [12.6, 4.9], [0.0, 4.9], [0.0, 0.2]]),
        surface="concrete",
    )


def _walls() -> list[Wall]:
    """South, east, north and west wall: plain panels, bare concrete, and twice ribbed sheet."""
    (x0, y0), (x1, y1) = LOW_M, HIGH_M
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    names, ends = ("south wall", "east wall", "north wall", "west wall"), [*corners[1:], corners[0]]
    paints = ("steel panel", "concrete", "ribbed sheet", "ribbed sheet")
    return [
        Wall(
            name,
            start,
            end,
            height_m=HEIGHT_M,
            paint=Paint(paint_name),
            trim=False,
            rail=False,
        )
        for name, start, end, paint_name in zip(names, corners, ends, paints, strict=True)
    ]


def _floor_and_roof() -> Iterator[Solid]:
    t = THICKNESS_M
    area = (LOW_M[0] - t, LOW_M[1] - t), (HIGH_M[0] + t, HIGH_M[1] + t)
    lines = [((-2.2, y), (13.8, y + 0.1)) for y in (-1.0, 0.9, 3.85, 5.95)]
    yield from slabs("floor", area, Paint("hall floor"), [(line, Paint("marking")) for line in lines])
    yield box("roof", (*area[0], HEIGHT_M), (*area[1], HEIGHT_M + 0.1), Paint("roof"))


def _frame() -> Iterator[Solid]:
    """The steel frame of the hall: posts along the walls, girders under the roof."""
    for k, x in enumerate(spread(LOW_M[0], HIGH_M[0], 4)):
        for side, y in (("south", LOW_M[1]), ("north", HIGH_M[1] - 0.2)):
            low = (x - 0.1, y - 0.005 if side == "south" else y, -0.005)
            yield box(f"{side} post {k}", low, (x + 0.1, low[1] + 0.205, HEIGHT_M + 0.02), Paint("grey varnish"))
        low, high = (x - 0.075, LOW_M[1] - 0.01, HEIGHT_M - 0.35), (x + 0.075, HIGH_M[1] + 0.01, HEIGHT_M + 0.01)
        yield box(f"girder {k}", low, high, Paint("grey varnish"))


def _racks(rng: np.random.Generator) -> Iterator[Solid]:
    """Two racks back to back, and one along the north wall."""
    for k, y in enumerate((1.76, 3.04, 6.85)):
        yield from placed(f"rack {k}", storage.filled_rack("load", rng, 4), 6.3, y)
    for k, x in enumerate((0.7, 11.9)):
        # Bumpers that keep trucks off the ends of the row.
        yield box(f"bumper {k}", (x - 0.05, 1.25, -0.005), (x + 0.05, 3.55, 0.3), Paint("truck varnish"))


def _on_the_floor(rng: np.random.Generator) -> Iterator[Solid]:
    """Barrels, loads, empty pallets and trucks along the walls."""
    spots = ((1.5, -1.8), (2.15, -1.85), (1.85, -1.3), (14.6, 4.3), (14.55, 5.0), (14.7, 5.7), (-2.4, 1.5), (12.3, 7.1))
    for k, (x, y) in enumerate(spots):
        dx, dy = (float(v) for v in rng.uniform(-0.03, 0.03, 2))
        yield from storage.barrel(f"barrel {k}", x + dx, y + dy, ("barrel blue", "barrel grey")[k % 2])
    loads = ((0.2, -1.55), (4.1, -1.5), (11.9, -1.6), (14.3, -1.5), (14.5, 2.8), (-2.2, 0.1), (13.3, 6.8))
    for k, (x, y) in enumerate(loads):
        yaw = pi / 2 + float(rng.uniform(-0.08, 0.08))
        yield from placed(f"floor load {k}", storage.load(rng, int(rng.integers(2, 4))), x, y, yaw)
    for k in range(6):
        turned = float(rng.uniform(-0.02, 0.02))
        yield from placed(f"empty pallet {k}", storage.pallet(), 6.0, -1.6, pi / 2 + turned, z_m=k * storage.PALLET_M)
    yield from placed("forklift", storage.forklift(), 9.0, -1.55, float(rng.uniform(-0.06, 0.06)))
    yield from placed("pallet truck", storage.pallet_truck(), 14.1, 1.0, 1.9 + float(rng.uniform(-0.3, 0.3)))
    yield from placed("cart", storage.cart(rng), -1.9, 6.6, float(rng.uniform(0, 6.28)))


def _on_the_walls(walls: list[Wall]) -> Iterator[Solid]:
    """A few things to hold on to, far apart."""
    south, east, _, west = walls
    yield south.box("switchboard", (5.4, -0.01, 1.1), (6.2, 0.22, 2.1), Paint("grey varnish"))
    for k, (wall, s) in enumerate(((south, 4.5), (south, 12.8), (east, 4.4), (west, 7.4))):
        yield wall.panel(f"sign {k}", (s, 1.7), (0.5, 0.3), f"sign {k % 3}")
        x, y = wall.point(s, 0.1)
        yield drum(f"extinguisher {k}", (x, y, 0.32), (0.075, 0.075), 0.45, paint=Paint("red varnish"))
        yield drum(f"extinguisher {k} valve", (x, y, 0.765), (0.03, 0.02), 0.09, paint=Paint("dark varnish"), sides=8)


def _gate(wall: Wall) -> Iterator[Solid]:
    """A roller gate in the west wall, between its rails."""
    s = wall.length_m - (4.7 - LOW_M[1])
    yield wall.box("gate", (s - 1.8, -0.05, -0.005), (s + 1.8, 0.03, 3.6), Paint("gate"))
    for side, at in (("left", s - 1.8), ("right", s + 1.8)):
        yield wall.box(f"{side} rail", (at - 0.08, -0.01, -0.01), (at + 0.08, 0.08, 3.7), Paint("dark varnish"))
    yield wall.box("gate drum", (s - 1.9, -0.014, 3.58), (s + 1.9, 0.4, 4.0), Paint("grey varnish"))
    yield wall.panel("sign", (s + 2.6, 1.8), (0.4, 0.25), "sign 0")
