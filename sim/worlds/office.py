"""An open-plan office: 28 m of path between desks, bookcases, a glass-walled meeting room and a window front."""

from collections.abc import Iterator
from math import pi

import numpy as np

from ..scene.scene import Sky, World
from ..scene.solids import Paint, Solid, box, drum, placed
from ..scene.textures import Painter
from . import furniture as fit
from . import textures_building as building
from . import textures_indoor as indoor
from .fittings import column, lamp_fitting, lamp_grid, radiator, slabs
from .palette import BUILDING, FURNITURE, painted
from .walls import HEIGHT_M, THICKNESS_M, Opening, Wall

LOW_M, HIGH_M = (-1.6, -1.6), (12.4, 8.4)
"""Corners of the room inside."""
STREET_M = -3.6
"""The street, one storey below."""

_PAINTERS: dict[str, Painter] = {
    **BUILDING,
    **FURNITURE,
    "carpet": indoor.carpet,
    "terrazzo": indoor.terrazzo,
    "clouds": building.clouds,
    "far house": building.far_house,
    "asphalt": building.asphalt,
}


def office(seed: int) -> World:
    """The office; the seed paints it and places what people have moved.

    Hardly any texture: the whiteboards, the steel cabinets, the upper walls, the glossy strip of floor under the
    first leg where it mirrors. Repeated texture: binders, the ribs of the radiators, the keyboards, the windows of
    the house across the street. Glass: the meeting room and the window front.
    """
    rng = np.random.default_rng([seed, 0])
    walls = _walls()
    lamps = lamp_grid((0.4, 3.0, 5.6, 8.2, 10.8), (0.0, 2.2, 4.4, 6.9), (1.18, 0.28), z_m=HEIGHT_M - 0.03, power=1.4)
    solids = [
        *_floor_and_ceiling(),
        *(solid for wall in (*walls, *_glass_walls()) for solid in wall.solids()),
        *(solid for k, lamp in enumerate(lamps) for solid in lamp_fitting(k, lamp, HEIGHT_M)),
        *_desks(rng),
        *_meeting_room(rng),
        *_along_the_walls(walls, rng),
        *_outside(),
    ]
    return World(
        name="office",
        seed=seed,
        solids=tuple(solids),
        textures=painted(_PAINTERS, seed),
        lamps=tuple(lamps),
        waypoints_m=np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 4.4], [0.0, 4.4], [0.0, 1.2]]),
        ambient=0.5,
        surface="carpet",
        sky=Sky(horizon=0.9, zenith=0.7, clouds="clouds", sun_direction=(0.32, 0.8, 0.507), sun_power=1.2),
    )


def _walls() -> list[Wall]:
    """South, east, north and west wall; windows in the north wall."""
    (x0, y0), (x1, y1) = LOW_M, HIGH_M
    windows = tuple(Opening(at, 2.2, 0.8, 2.35, "glass", 2) for at in (1.6, 4.4, 7.2, 12.0))
    south = Wall("south wall", (x0, y0), (x1, y0), (7.8,), rail=False)
    east = Wall("east wall", (x1, y0), (x1, y1), (8.6,), rail=False)
    north = Wall("north wall", (x1, y1), (x0, y1), openings=windows, rail=False)
    west = Wall("west wall", (x0, y1), (x0, y0), (8.6,), rail=False)
    return [south, east, north, west]


def _glass_walls() -> Iterator[Wall]:
    """The two glass walls of the meeting room, one with a free doorway."""
    frame, x0, (x, y), north = Paint("frame"), LOW_M[0], (2.6, 5.2), HIGH_M[1]
    front = (Opening(1.56, 2.96, 0.0, 2.2, "glass", 3), Opening(3.6, 0.9, 0.0, 2.2, "free"))
    yield Wall("glass front", (x0, y), (x, y), (), 0.0, front, paint=frame, trim=False, rail=False)
    side = (Opening(1.6, 3.0, 0.0, 2.2, "glass", 3),)
    yield Wall("glass side", (x, y), (x, north), (), THICKNESS_M, side, paint=frame, trim=False, rail=False)


def _floor_and_ceiling() -> Iterator[Solid]:
    t = THICKNESS_M
    area = (LOW_M[0] - t, LOW_M[1] - t), (HIGH_M[0] + t, HIGH_M[1] + t)
    strip = (area[0][0], -0.8), (area[1][0], 0.7)
    yield from slabs("floor", area, Paint("carpet"), [(strip, Paint("terrazzo"))])
    yield box("ceiling", (*area[0], HEIGHT_M), (*area[1], HEIGHT_M + 0.1), Paint("ceiling"))


def _desks(rng: np.random.Generator) -> Iterator[Solid]:
    """Four islands of four desks, each pair divided by a low screen, and two columns."""
    for k, (x, y) in enumerate(((3.0, 2.2), (7.2, 2.2), (6.0, 6.9), (9.4, 6.9))):
        yield box(f"divider {k}", (x - 1.5, y - 0.008, 0.45), (x + 1.5, y + 0.008, 1.12), Paint(f"sofa cloth {k % 2}"))
        for n, (dx, side) in enumerate((dx, side) for dx in (-0.76, 0.76) for side in (-1, 1)):
            name = f"desk {k}{n}"
            yield from placed(name, fit.desk(rng), x + dx, y + side * 0.39, side * pi / 2)
            away = float(rng.uniform(0.9, 1.06))
            yaw = -side * pi / 2 + float(rng.uniform(-0.6, 0.6))
            yield from placed(f"chair {k}{n}", fit.office_chair(rng), x + dx, y + side * away, yaw)
    yield from column("column 0", (5.1, 2.2), 0.36, HEIGHT_M, "wall")
    yield from column("column 1", (9.2, 2.2), 0.36, HEIGHT_M, "wall")


def _meeting_room(rng: np.random.Generator) -> Iterator[Solid]:
    x, y = 0.4, 6.8
    yield from placed("meeting table", fit.table((2.0, 1.0), texture="wood 1"), x, y)
    for n, (dx, side) in enumerate((dx, side) for dx in (-0.65, 0.0, 0.65) for side in (-1, 1)):
        at = y + side * float(rng.uniform(0.66, 0.8))
        yaw = -side * pi / 2 + float(rng.uniform(-0.3, 0.3))
        yield from placed(f"meeting chair {n}", fit.stacking_chair(rng), x + dx, at, yaw)
    yield from placed("flip chart", fit.flip_chart(), 2.1, 7.7, -2.5 + float(rng.uniform(-0.2, 0.2)))
    cup = float(rng.uniform(-0.6, 0.6))
    yield drum("carafe", (x + cup, y, 0.738), (0.05, 0.035), 0.24, paint=fit.METAL, sides=10)


def _along_the_walls(walls: list[Wall], rng: np.random.Generator) -> Iterator[Solid]:
    south, east, north, west = walls
    for k, s in enumerate((1.2, 2.05, 3.6, 11.1, 11.95)):
        yield from _at(south, f"bookcase {k}", fit.bookcase(rng), s)
    for k, s in enumerate((9.2, 10.05)):
        yield from _at(south, f"cabinet {k}", fit.cabinet(), s)
        yield south.panel(f"poster {k}", (s, 1.75), (0.5, 0.71), f"poster {rng.integers(4)}")
    yield south.panel("whiteboard", (5.6, 1.5), (2.0, 1.1), "whiteboard")
    for k, s in enumerate((0.9, 1.75)):
        yield from _at(east, f"bookcase 1{k}", fit.bookcase(rng), s)
    yield from _at(east, "cabinet 2", fit.cabinet(0.9, 0.9), 2.8)
    yield east.panel("notice board", (2.8, 1.55), (1.2, 0.8), "notice board")
    yield from _at(east, "sofa", fit.sofa(rng), 4.7)
    yield east.panel("poster 2", (4.7, 1.55), (0.6, 0.85), f"poster {rng.integers(4)}")
    yield from fit.plant("plant 0", *east.point(6.1, 0.4), rng)
    yield from fit.plant("plant 1", *west.point(9.4, 0.35), rng)
    yield fit.bin_drum("bin", *south.point(7.0, 0.25))
    yield west.panel("whiteboard", (4.9, 1.45), (2.2, 1.2), "whiteboard")
    yield west.panel("meeting whiteboard", (1.6, 1.45), (1.8, 1.1), "whiteboard")
    yield from _at(west, "cabinet 3", fit.cabinet(1.0, 0.8), 6.8)
    for k, s in enumerate((1.6, 4.4, 7.2, 12.0)):
        yield from radiator(north, k, s, 1.4)


def _at(wall: Wall, name: str, parts: Iterator[Solid], along_m: float) -> Iterator[Solid]:
    """A piece of furniture with its back to a wall."""
    return placed(name, parts, *wall.point(along_m, 0.0), wall.yaw_rad)


def _outside() -> Iterator[Solid]:
    """What the windows show: the street below and the house across it."""
    yield box("street", (-30.0, 9.5, STREET_M - 0.2), (40.0, 40.0, STREET_M), Paint("asphalt"))
    yield box("far house", (-24.0, 27.0, STREET_M - 0.01), (34.0, 36.0, 4.6), Paint("far house"))
