"""An office corridor with one corner: 33 m of path between doors, posters, boxes and a bench."""

from collections.abc import Iterator

import numpy as np

from stereogrid.geometry import from_yaw

from ..scene import textures as paint
from ..scene.scene import Lamp, World
from ..scene.solids import Paint, Solid, box, drum
from ..scene.textures import Painter
from .fittings import lamp_fitting
from .furniture import bin_drum, plant
from .walls import DOOR_M, HEIGHT_M, THICKNESS_M, Wall

HALF_WIDTH_M = 1.25
CORNER_X_M = 17.5
END_Y_M = 15.5
MARGIN_M = 1.4
"""The corridor goes on behind the start and beyond the last waypoint."""

_PAINTERS: dict[str, Painter] = {
    "wall": paint.wall,
    "floor": paint.floor,
    "ceiling": paint.ceiling,
    "lamp": paint.lamp,
    "metal": paint.metal,
    "leaf": paint.leaf,
    "notice board": paint.notice_board,
    "white varnish": paint.paint(0.85, 0.015),
    "grey varnish": paint.paint(0.5, 0.025),
    "dark varnish": paint.paint(0.3, 0.03),
    "red varnish": paint.paint(0.36, 0.02),
    **{f"wood {k}": paint.wood for k in range(3)},
    **{f"sign {k}": paint.sign for k in range(3)},
    **{f"carton {k}": paint.cardboard for k in range(4)},
    **{f"poster {k}": paint.poster for k in range(8)},
}


def corridor(seed: int) -> World:
    """The corridor; the seed paints it and places what stands and hangs in it."""
    rng = np.random.default_rng([seed, 0])
    streams = np.random.default_rng([seed, 1]).spawn(len(_PAINTERS))
    walls = _walls(rng)
    lamps = tuple(_lamps())
    solids = [
        *_floor_and_ceiling(),
        *(solid for wall in walls for solid in wall.solids()),
        *_corner_guard(),
        *(solid for wall in walls for solid in _hangings(wall, rng)),
        *(solid for k, lamp in enumerate(lamps) for solid in lamp_fitting(k, lamp, HEIGHT_M)),
        *_furniture(walls, rng),
    ]
    return World(
        name="corridor",
        seed=seed,
        solids=tuple(solids),
        textures={name: painter(r) for (name, painter), r in zip(_PAINTERS.items(), streams, strict=True)},
        lamps=lamps,
        waypoints_m=np.array([[0.0, 0.0], [CORNER_X_M, 0.0], [CORNER_X_M, END_Y_M]]),
    )


def _walls(rng: np.random.Generator) -> list[Wall]:
    """The six walls, counterclockwise round the room, with their doors."""
    w, back, top = HALF_WIDTH_M, -MARGIN_M, END_Y_M + MARGIN_M
    inner, outer = CORNER_X_M - w, CORNER_X_M + w
    corners = [(back, -w), (outer, -w), (outer, top), (inner, top), (inner, w), (back, w)]
    names = ["south wall", "east wall", "north wall", "west wall", "middle wall", "back wall"]
    doors = [(4.0, 8.5, 14.0), (3.4, 9.0, 14.5), (), (5.0, 11.0), (4.2, 9.4, 13.4), ()]
    ends = [*corners[1:], corners[0]]
    return [
        # Only the fifth wall starts at the reflex corner, where the fourth one's end already fills the corner.
        Wall(
            name,
            start,
            end,
            tuple(float(d + rng.uniform(-0.4, 0.4)) for d in places),
            -THICKNESS_M if name == "middle wall" else THICKNESS_M,
        )
        for name, start, end, places in zip(names, corners, ends, doors, strict=True)
    ]


def _floor_and_ceiling() -> Iterator[Solid]:
    edge = HALF_WIDTH_M + THICKNESS_M
    low_x, high_x = -MARGIN_M - THICKNESS_M, CORNER_X_M + edge
    for name, low, high in (("floor", -0.1, 0.0), ("ceiling", HEIGHT_M, HEIGHT_M + 0.1)):
        yield box(f"{name} 0", (low_x, -edge, low), (high_x, edge, high), Paint(name))
        far_y = END_Y_M + MARGIN_M + THICKNESS_M
        yield box(f"{name} 1", (CORNER_X_M - edge, edge, low), (high_x, far_y, high), Paint(name))


def _lamps() -> Iterator[Lamp]:
    z = HEIGHT_M - 0.03
    for x in np.arange(0.9, CORNER_X_M + 0.5, 2.4):
        yield Lamp((float(x), 0.0, z), (1.18, 0.28))
    for y in np.arange(2.1, END_Y_M + 1.0, 2.4):
        yield Lamp((CORNER_X_M, float(y), z), (0.28, 1.18))


def _corner_guard() -> Iterator[Solid]:
    x, y = CORNER_X_M - HALF_WIDTH_M, HALF_WIDTH_M
    yield box("corner guard", (x - 0.06, y - 0.008, 0.02), (x + 0.008, y + 0.06, 1.5), Paint("metal"))


def _hangings(wall: Wall, rng: np.random.Generator) -> Iterator[Solid]:
    """Posters, notice boards, sockets and an extinguisher, wherever the wall is free of doors."""
    s = 0.7
    k = 0
    while s < wall.length_m - 0.7:
        if all(abs(s - door) > DOOR_M[0] / 2 + 0.75 for door in wall.doors_m):
            kind = rng.choice(["poster", "poster", "board", "extinguisher", "bare"])
            yield from _hanging(wall, f"{kind} {k}", s, rng)
            k += 1
        s += float(rng.uniform(0.9, 1.7))


def _hanging(wall: Wall, name: str, s: float, rng: np.random.Generator) -> Iterator[Solid]:
    z = float(rng.uniform(1.5, 1.7))
    if name.startswith("poster"):
        width = float(rng.uniform(0.45, 0.6))
        yield wall.panel(name, (s, z), (width, 1.42 * width), f"poster {rng.integers(8)}")
    elif name.startswith("board"):
        yield wall.panel(name, (s, z), (1.05, 0.7), "notice board")
    elif name.startswith("extinguisher"):
        x, y, _ = (wall.T_world_wall @ [s, 0.1, 0, 1])[:3]
        yield drum(name, (x, y, 0.32), (0.075, 0.075), 0.45, paint=Paint("red varnish"))
        yield drum(f"{name} valve", (x, y, 0.765), (0.03, 0.02), 0.09, paint=Paint("dark varnish"), sides=8)
        yield wall.panel(f"{name} sign", (s, 1.5), (0.2, 0.2), "sign 0")
    yield wall.panel(f"socket {name}", (s + 0.3, 0.32), (0.16, 0.085), "white varnish")


def _furniture(walls: list[Wall], rng: np.random.Generator) -> Iterator[Solid]:
    south, east, _, west, middle, _ = walls
    yield from _bench(south, south.doors_m[0] + 2.2)
    yield from _bench(east, east.doors_m[1] - 2.4)
    yield from _cartons("cartons 0", middle, 0.5 * (middle.doors_m[1] + middle.doors_m[2]), rng)
    yield from _cartons("cartons 1", west, west.doors_m[0] + 1.4, rng)
    yield from _cartons("cartons 2", east, 1.3, rng)
    yield from plant("plant 0", *south.point(south.length_m - 0.4, 0.33), rng)
    yield from plant("plant 1", *west.point(west.doors_m[1] - 1.3, 0.33), rng)
    for k, (wall, s) in enumerate(((south, south.doors_m[1] + 1.0), (east, east.doors_m[0] + 1.1))):
        yield bin_drum(f"bin {k}", *wall.point(s, 0.2))


def _bench(wall: Wall, s: float) -> Iterator[Solid]:
    yield wall.box("bench seat", (s - 0.7, 0.05, 0.42), (s + 0.7, 0.42, 0.46), Paint("wood 1"))
    yield wall.box("bench back", (s - 0.7, 0.035, 0.6), (s + 0.7, 0.06, 0.84), Paint("wood 1"))
    for side in (-0.55, 0.55):
        yield wall.box(f"bench leg {side}", (s + side - 0.025, 0.03, 0), (s + side + 0.025, 0.4, 0.425), Paint("metal"))


def _cartons(name: str, wall: Wall, s: float, rng: np.random.Generator) -> Iterator[Solid]:
    """A stack of two cartons and a smaller one beside it."""
    z = 0.0
    for k, (along, size) in enumerate(((0.0, 0.44), (0.02, 0.34), (0.52, 0.3))):
        height = size * float(rng.uniform(0.6, 0.85))
        foot = z if k == 1 else 0.0
        x, y, _ = (wall.T_world_wall @ [s + along, 0.31, 0, 1])[:3]
        yaw = float(np.arctan2(*wall.T_world_wall[1::-1, 0])) + float(rng.uniform(-0.2, 0.2))
        sides = {"": Paint(f"carton {rng.integers(4)}", fit=True)}
        half = size / 2
        low, high = (-half, -0.8 * half, foot), (half, 0.8 * half, foot + height)
        yield box(f"{name} {k}", low, high, sides, T_world_box=from_yaw(yaw, (x, y, 0.0)))
        z = height if k == 0 else z
