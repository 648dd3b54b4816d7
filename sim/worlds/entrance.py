"""A lobby and the forecourt before it: 34 m of path out of the door, along the facade and in again."""

from collections.abc import Iterator
from math import pi

import numpy as np

from ..scene import textures as paint
from ..scene.scene import Sky, World
from ..scene.solids import Paint, Solid, box, placed
from ..scene.textures import Painter
from . import furniture as fit
from . import street
from . import textures_building as building
from . import textures_indoor as indoor
from .fittings import column, lamp_fitting, lamp_grid, radiator, slabs
from .palette import BUILDING, FURNITURE, painted
from .walls import THICKNESS_M, Opening, Wall

BACK_M, FRONT_M, HALF_M = -2.0, 7.6, 3.4
"""The lobby: x of its back wall and of the inside of its front, half of its width [m]."""
CEILING_M = 3.0
FACADE_M = FRONT_M + THICKNESS_M
HOUSE_M = (9.5, 6.4)
"""Half of the house's width and its height."""
COURT_M = ((FACADE_M, -7.0), (17.2, 9.0))
"""The paved forecourt."""

_PAINTERS: dict[str, Painter] = {
    **BUILDING,
    **FURNITURE,
    "plaster": indoor.plaster,
    "tiles": indoor.stone_tiles,
    "mat": indoor.cloth(0.2),
    "render": building.render_coat,
    "brick": building.brick,
    "paving": building.paving,
    "asphalt": building.asphalt,
    "hedge": building.hedge,
    "planter": paint.paint(0.6, 0.03),
    "rough wood": building.rough_wood,
    "rubber": paint.paint(0.14, 0.02),
    "far house": building.far_house,
    "clouds": building.clouds,
    **{f"dark window {k}": building.dark_window for k in range(4)},
}


def entrance(seed: int) -> World:
    """The entrance; the seed paints it and places what stands in the lobby and before the house.

    Inside lamps, outside the sun: a camera that leaves the door sees a step of brightness. Hardly any texture: the
    rendered storey, the ceiling's edge, whiteboard and varnished desk. Repeated texture: bricks, paving slabs, the
    windows of both houses, the hoops of the stands. Glass: the front beside the door.
    """
    rng = np.random.default_rng([seed, 0])
    walls = _walls()
    lamps = lamp_grid((-0.6, 2.0, 4.6, 6.8), (-1.7, 1.7), (1.18, 0.28), z_m=CEILING_M - 0.03, power=0.9)
    solids = [
        *_ground(),
        *(solid for wall in walls for solid in wall.solids()),
        *(solid for k, lamp in enumerate(lamps) for solid in lamp_fitting(k, lamp, CEILING_M)),
        *_lobby(walls, rng),
        *_house(rng),
        *_door(),
        *_forecourt(rng),
        *_far_side(rng),
    ]
    return World(
        name="entrance",
        seed=seed,
        solids=tuple(solids),
        textures=painted(_PAINTERS, seed),
        lamps=tuple(lamps),
        waypoints_m=np.array([[0.0, 0.0], [14.2, 0.0], [14.2, 5.8], [10.8, 5.8], [10.8, 0.0], [5.8, 0.0]]),
        sky=Sky(horizon=0.9, zenith=0.6, clouds="clouds", sun_direction=(0.52, -0.42, 0.744), sun_power=2.4),
        surface="paving",
    )


def _walls() -> list[Wall]:
    """South wall, glass front, north wall, back wall of the lobby."""
    corners = [(BACK_M, -HALF_M), (FRONT_M, -HALF_M), (FRONT_M, HALF_M), (BACK_M, HALF_M)]
    # The door is a free hole of 2 m in the middle of the front, panes on both sides and above it.
    half = 2 * HALF_M / 2
    holes = (
        Opening(half - 2.1, 2.0, 0.0, 2.6, "glass", 2),
        Opening(half, 2.0, 0.0, 2.3, "free"),
        Opening(half + 2.1, 2.0, 0.0, 2.6, "glass", 2),
    )
    plain = Paint("plaster")
    front = {"-y": Paint("brick"), "": Paint("frame")}
    return [
        Wall("south wall", corners[0], corners[1], (3.2,), height_m=CEILING_M, paint=plain, rail=False),
        Wall("front", corners[1], corners[2], (), 0.0, holes, CEILING_M, front, trim=False, rail=False),
        Wall("north wall", corners[2], corners[3], (2.6, 6.4), 0.0, height_m=CEILING_M, paint=plain, rail=False),
        Wall("back wall", corners[3], corners[0], (2.2,), height_m=CEILING_M, paint=plain, rail=False),
    ]


def _ground() -> Iterator[Solid]:
    """Tiles and a mat inside; paving, and asphalt beyond, outside. All of it is level."""
    t = THICKNESS_M
    inside = (BACK_M - t, -HALF_M - t), (FACADE_M, HALF_M + t)
    mat = (FRONT_M - 1.7, -1.0), (FRONT_M - 0.1, 1.0)
    yield from slabs("lobby floor", inside, Paint("tiles"), [(mat, Paint("mat"))])
    yield box("ceiling", (*inside[0], CEILING_M), (*inside[1], CEILING_M + 0.1), Paint("ceiling"))
    outside = (FACADE_M, -16.0), (40.0, 18.0)
    yield from slabs("court", outside, Paint("asphalt"), [(COURT_M, Paint("paving"))])


def _lobby(walls: list[Wall], rng: np.random.Generator) -> Iterator[Solid]:
    south, _, north, back = walls
    for k, (x, y) in enumerate((x, y) for x in (2.6, 5.4) for y in (-1.75, 1.75)):
        yield from column(f"column {k}", (x, y), 0.3, CEILING_M, "plaster")
    yield from _reception(4.0, 2.5)
    yield from placed(
        "reception screen", fit.monitor(rng), 4.2, 2.35, pi / 2 + float(rng.uniform(-0.3, 0.3)), z_m=0.002
    )
    yield from placed("reception chair", fit.office_chair(rng), 4.0, 2.95, -pi / 2 + float(rng.uniform(-0.4, 0.4)))
    for k, s in enumerate((1.3, 5.4)):
        yield from placed(f"sofa {k}", fit.sofa(rng), *south.point(s, 0.0), south.yaw_rad)
        yield south.panel(f"poster {k}", (s, 1.65), (0.7, 1.0), f"poster {rng.integers(4)}")
    x, y = south.point(5.4, 1.25)
    yield from placed("low table", fit.table((0.9, 0.5), 0.42, "wood 2"), x + float(rng.uniform(-0.1, 0.1)), y)
    yield north.panel("notice board", (4.5, 1.6), (1.8, 1.1), "notice board")
    yield north.panel("whiteboard", (8.3, 1.6), (1.6, 1.0), "whiteboard")
    yield south.panel("notice board", (8.0, 1.6), (1.5, 1.0), "notice board")
    yield back.panel("poster 2", (3.6, 1.65), (0.7, 1.0), f"poster {rng.integers(4)}")
    yield from placed("bookcase", fit.bookcase(rng), *back.point(5.4, 0.0), back.yaw_rad)
    for k, (wall, s) in enumerate(((south, 6.9), (north, 1.2), (north, 5.6), (back, 0.7))):
        yield from fit.plant(f"plant {k}", *wall.point(s, 0.4), rng)
    yield from radiator(south, 0, 8.0, 1.4)


def _reception(x: float, y: float) -> Iterator[Solid]:
    """A desk of 2.4 m with a counter towards -y."""
    yield box("counter front", (x - 1.2, y - 0.45, -0.005), (x + 1.2, y - 0.4, 1.08), Paint("wood 0"))
    yield box("counter top", (x - 1.25, y - 0.5, 1.075), (x + 1.25, y - 0.2, 1.11), Paint("laminate"))
    yield box("desk top", (x - 1.19, y - 0.41, 0.7), (x + 1.19, y + 0.25, 0.73), Paint("laminate"))
    for side, a in (("left", x - 1.2), ("right", x + 1.16)):
        yield box(f"counter {side}", (a, y - 0.4, -0.004), (a + 0.04, y + 0.24, 0.9), Paint("wood 0"))


def _house(rng: np.random.Generator) -> Iterator[Solid]:
    """The wings beside the lobby and the storey above: a facade of brick below and of render above, with windows."""
    (half, top), inner = HOUSE_M, HALF_M + THICKNESS_M
    masonry = {"+x": Paint("brick"), "": Paint("render")}
    for side, a, b in (("south", -half, -inner), ("north", inner, half)):
        yield box(f"{side} wing", (BACK_M, a, -0.005), (FACADE_M, b, CEILING_M + 0.1), masonry)
    x, y = FACADE_M + 0.05, half + 0.05
    yield box("upper storey", (BACK_M - 0.2, -y, CEILING_M + 0.1), (x, y, top), Paint("render"))
    yield box("cornice", (BACK_M - 0.3, -y - 0.15, top - 0.01), (x + 0.2, y + 0.15, top + 0.2), Paint("frame"))
    yield box(
        "plinth south", (FACADE_M - 0.1, -half - 0.02, -0.004), (FACADE_M + 0.03, -inner - 0.01, 0.35), Paint("planter")
    )
    yield box(
        "plinth north", (FACADE_M - 0.1, inner + 0.01, -0.004), (FACADE_M + 0.03, half + 0.02, 0.35), Paint("planter")
    )
    for k, y in enumerate((-8.0, -5.4, 5.4, 8.0)):
        yield from _window(f"window {k}", y, (0.9, 2.3), rng)
    for k, y in enumerate(np.linspace(-8.0, 8.0, 7)):
        yield from _window(f"upper window {k}", float(y), (4.0, 5.5), rng, out_m=0.05)
    for k, y in enumerate((-9.2, 9.2)):
        low, high = (FACADE_M - 0.01, y - 0.05, 0.0), (FACADE_M + 0.1, y + 0.05, top - 0.005)
        yield box(f"downpipe {k}", low, high, Paint("metal"))


def _window(
    name: str, y: float, zs: tuple[float, float], rng: np.random.Generator, out_m: float = 0.0
) -> Iterator[Solid]:
    """A window of 1.5 m in the facade, dark behind, with a frame and a sill."""
    x, (z0, z1) = FACADE_M + out_m, zs
    pane = {"+x": Paint(f"dark window {rng.integers(4)}", fit=True), "": Paint("frame")}
    yield box(f"{name} pane", (x - 0.05, y - 0.72, z0 + 0.03), (x + 0.008, y + 0.72, z1 - 0.03), pane)
    # Each part stands out and reaches in by its own depth, so that no two share a plane.
    for part, low, high, depth in (
        ("left", (-0.75, z0), (-0.67, z1), 0.03),
        ("right", (0.67, z0), (0.75, z1), 0.03),
        ("bar", (-0.03, z0 + 0.05), (0.03, z1 - 0.05), 0.026),
        ("head", (-0.755, z1 - 0.08), (0.755, z1 + 0.004), 0.032),
    ):
        corners = (x - depth, y + low[0], low[1]), (x + depth, y + high[0], high[1])
        yield box(f"{name} {part}", *corners, Paint("frame"))
    yield box(f"{name} sill", (x - 0.04, y - 0.85, z0 - 0.05), (x + 0.12, y + 0.85, z0 + 0.03), Paint("planter"))


def _door() -> Iterator[Solid]:
    """Both leaves of the door, glazed, stand open outwards; before them the canopy."""
    for side, y in (("left", 1.0), ("right", -1.0)):
        low, high = min(y, 1.04 * y), max(y, 1.04 * y)
        for part, a, b in (("foot", 0.01, 0.14), ("head", 2.16, 2.26)):
            yield box(f"{side} leaf {part}", (FACADE_M + 0.01, low, a), (FACADE_M + 0.95, high, b), Paint("frame"))
        for part, a in (("hinge", 0.0), ("edge", 0.87)):
            ends = (FACADE_M + 0.012 + a, low + 0.001, 0.1), (FACADE_M + 0.075 + a, high - 0.001, 2.2)
            yield box(f"{side} leaf {part}", *ends, Paint("frame"))
        pane = (FACADE_M + 0.07, low + 0.015, 0.13), (FACADE_M + 0.89, high - 0.015, 2.17)
        yield box(f"{side} leaf pane", *pane, Paint("glass"))
        handle = (FACADE_M + 0.84, low - 0.035, 0.95), (FACADE_M + 0.87, high + 0.035, 1.25)
        yield box(f"{side} leaf handle", *handle, Paint("metal"))
    yield from placed("canopy", street.canopy((1.9, 4.6), 2.75), FACADE_M, 0.0)


def _forecourt(rng: np.random.Generator) -> Iterator[Solid]:
    for k, (x, y) in enumerate(((8.3, -3.6), (8.3, 3.5), (12.1, 1.4), (15.2, -1.5))):
        yield from placed(f"planter {k}", street.planter(rng), x, y + float(rng.uniform(-0.05, 0.05)))
    yield from placed("stands", street.cycle_row(rng, 4), 8.95, 6.3 + float(rng.uniform(-0.1, 0.1)))
    yield from placed("bench", street.bench(), 12.1, 3.4 + float(rng.uniform(-0.1, 0.1)), pi)
    yield from placed("bench 1", street.bench(), 15.4, 2.4 + float(rng.uniform(-0.2, 0.2)), pi)
    yield fit.bin_drum("bin", 12.1, 4.7)
    for k, y in enumerate((-3.4, -1.9, -0.4, 1.1, 2.6, 4.1, 5.6, 7.1)):
        yield from street.bollard(f"bollard {k}", 16.6, y)
    for k, (x, y) in enumerate(((12.1, -1.6), (15.9, 7.4))):
        yield from street.lamp_post(f"lamp post {k}", x, y)


def _far_side(rng: np.random.Generator) -> Iterator[Solid]:
    """Hedges at both ends of the court, a garden wall, and the house across the street."""
    high = float(rng.uniform(1.0, 1.3))
    yield box("north hedge", (FACADE_M + 0.3, 8.3, -0.005), (16.4, 9.1, high), Paint("hedge"))
    yield box("south hedge", (FACADE_M + 0.3, -6.8, -0.005), (16.4, -6.0, high + 0.1), Paint("hedge"))
    yield box("garden wall", (22.0, -15.9, -0.005), (22.3, 17.9, 1.5), Paint("brick"))
    yield box("coping", (21.95, -16.1, 1.49), (22.35, 18.1, 1.56), Paint("planter"))
    yield box("far house", (30.0, -14.0, -0.005), (38.0, 16.0, 9.0), Paint("far house"))
    yield box("side house", (10.0, 15.5, -0.005), (21.8, 17.8, 7.5), Paint("far house", shift_m=3.0))
