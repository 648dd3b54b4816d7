"""What stands before a building: planters, stands for bicycles, benches, bollards, a canopy on posts.

Each piece is in a frame of its own, its front to +x, its origin on the floor in its middle: see solids.placed.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from stereogrid.geometry import from_rotation

from ..scene.solids import Paint, Solid, box, drum, placed, rod

STEEL, WOOD, STONE = Paint("metal"), Paint("rough wood"), Paint("planter")


def planter(rng: np.random.Generator, length_m: float = 1.4) -> Iterator[Solid]:
    """A trough of concrete along y with a clipped shrub and single shoots."""
    h = length_m / 2
    yield box("trough", (-0.3, -h, -0.005), (0.3, h, 0.48), STONE)
    yield box("rim", (-0.33, -h - 0.03, 0.46), (0.33, h + 0.03, 0.53), STONE)
    top = 0.52 + float(rng.uniform(0.3, 0.45))
    yield box("shrub", (-0.26, -h + 0.05, 0.52), (0.26, h - 0.05, top), Paint("hedge"))
    for k in range(60):
        x, y, z = (float(rng.uniform(-a, a)) for a in (0.24, h - 0.07, 0.05))
        turn = Rotation.from_euler("ZY", [rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 1.3)])
        T = from_rotation(turn.as_matrix(), (x, y, top - 0.05 + z))
        length, width = float(rng.uniform(0.08, 0.16)), float(rng.uniform(0.015, 0.03))
        yield box(f"leaf {k}", (-0.0015, -width, 0), (0.0015, width, length), Paint("leaf"), T_world_box=T)


def cycle_stand(width_m: float = 0.8, height_m: float = 0.8) -> Iterator[Solid]:
    """A hoop of tube 42 mm thick, in the plane y, z; its corners are bent in two steps."""
    w, h, r, bend = width_m / 2, height_m, 0.021, 0.16
    corner = bend * (1 - float(np.sqrt(0.5)))
    points = [(-w, 0.0), (-w, h - bend), (-w + corner, h - corner), (-w + bend, h)]
    points += [(-y, z) for y, z in reversed(points)]
    for k, ((ya, za), (yb, zb)) in enumerate(pairwise(points)):
        # Each piece goes on a little into the next, or the bends would gape.
        on_y, on_z = (0.006 * d / float(np.hypot(yb - ya, zb - za)) for d in (yb - ya, zb - za))
        yield rod(f"tube {k}", ((0.0, ya - on_y, za - on_z), (0.0, yb + on_y, zb + on_z)), r, STEEL, sides=8)


def bicycle(rng: np.random.Generator) -> Iterator[Solid]:
    """A bicycle along y: tyres as rings of short rods, a frame of tubes, saddle and handlebar."""
    dark, frame = Paint("rubber"), Paint(str(rng.choice(["red varnish", "dark varnish", "grey varnish"])))
    for name, y in (("rear", -0.52), ("front", 0.52)):
        angle = 2 * np.pi * np.arange(15) / 14
        ring = [(0.0, y + 0.32 * float(np.cos(a)), 0.335 + 0.32 * float(np.sin(a))) for a in angle]
        for k, ends in enumerate(pairwise(ring)):
            yield rod(f"{name} tyre {k}", ends, 0.017, dark, sides=5)
        for k in range(4):
            dy, dz = 0.31 * float(np.cos(k * np.pi / 4)), 0.31 * float(np.sin(k * np.pi / 4))
            yield rod(
                f"{name} spoke {k}", ((0.0, y - dy, 0.335 - dz), (0.0, y + dy, 0.335 + dz)), 0.003, STEEL, sides=4
            )
    crank, seat, head, low = (0.0, -0.1, 0.29), (0.0, -0.2, 0.82), (0.0, 0.34, 0.86), (0.0, 0.36, 0.7)
    tubes = {
        "seat tube": (crank, seat),
        "top tube": ((0.0, -0.18, 0.76), (0.0, 0.345, 0.82)),
        "down tube": (crank, low),
    }
    tubes |= {"fork": (head, (0.0, 0.52, 0.335)), "chain stay": (crank, (0.0, -0.52, 0.335))}
    tubes |= {"seat stay": ((0.0, -0.18, 0.74), (0.0, -0.52, 0.335)), "stem": (head, (0.0, 0.32, 1.0))}
    for name, ends in tubes.items():
        yield rod(name, ends, 0.016, frame)
    yield rod("handlebar", ((-0.28, 0.31, 1.0), (0.28, 0.31, 1.0)), 0.012, dark)
    yield box("saddle", (-0.07, -0.35, 0.815), (0.07, -0.09, 0.86), dark)
    yield box("pedals", (-0.16, -0.14, 0.27), (0.16, -0.06, 0.3), dark)


def bench(length_m: float = 1.8) -> Iterator[Solid]:
    """A park bench of boards along y, its back at -x."""
    h = length_m / 2
    for k, x in enumerate((-0.14, 0.0, 0.14)):
        yield box(f"seat board {k}", (x - 0.06, -h, 0.43), (x + 0.06, h, 0.465), Paint("wood 1"))
    for k, z in enumerate((0.58, 0.74)):
        yield box(f"back board {k}", (-0.26, -h, z), (-0.23, h, z + 0.12), Paint("wood 1"))
    for k, y in enumerate((-h + 0.2, h - 0.2)):
        for x in (-0.18, 0.16):
            yield box(f"leg {k}{x}", (x - 0.025, y - 0.025, -0.005), (x + 0.025, y + 0.025, 0.435), STEEL)
        yield box(f"back post {k}", (-0.235, y - 0.02, 0.39), (-0.205, y + 0.02, 0.85), STEEL)
        yield box(f"bearer {k}", (-0.22, y - 0.018, 0.4), (0.19, y + 0.018, 0.432), STEEL)


def bollard(name: str, x_m: float, y_m: float) -> Iterator[Solid]:
    """A round post 0.9 m high and 90 mm thick."""
    yield drum(name, (x_m, y_m, -0.005), (0.045, 0.045), 0.9, paint=Paint("dark varnish"), sides=12)
    yield drum(f"{name} band", (x_m, y_m, 0.74), (0.048, 0.048), 0.06, paint=Paint("white varnish"), sides=12)


def lamp_post(name: str, x_m: float, y_m: float) -> Iterator[Solid]:
    """A lamp on a post 3.4 m high, 80 mm thick at its foot."""
    yield drum(name, (x_m, y_m, -0.005), (0.05, 0.03), 3.4, paint=STEEL, sides=12)
    yield drum(f"{name} head", (x_m, y_m, 3.38), (0.12, 0.2), 0.3, paint=Paint("white varnish"), sides=12)
    yield drum(f"{name} hat", (x_m, y_m, 3.675), (0.24, 0.1), 0.09, paint=Paint("dark varnish"), sides=12)


def canopy(size_m: tuple[float, float], height_m: float) -> Iterator[Solid]:
    """A flat roof from a facade at x = 0, size (out, along), on two posts 80 mm thick."""
    out, h = size_m[0], size_m[1] / 2
    sides = {"-z": Paint("laminate"), "": Paint("dark varnish")}
    yield box("roof", (-0.01, -h, height_m), (out, h, height_m + 0.16), sides)
    for k, y in enumerate((-h + 0.25, h - 0.25)):
        yield drum(f"post {k}", (out - 0.25, y, -0.005), (0.04, 0.04), height_m + 0.01, paint=STEEL)
        yield box(f"post foot {k}", (out - 0.34, y - 0.09, -0.004), (out - 0.16, y + 0.09, 0.012), STEEL)


def cycle_row(rng: np.random.Generator, stands: int) -> Iterator[Solid]:
    """Stands 0.9 m apart along y, their hoops across it, and bicycles at some of them."""
    for k in range(stands):
        y = (k - (stands - 1) / 2) * 0.9
        yield from placed(f"stand {k}", cycle_stand(), 0.0, y, np.pi / 2)
        if rng.random() < 0.6:
            at = float(rng.uniform(-0.1, 0.1))
            yield from placed(f"bicycle {k}", bicycle(rng), at, y + 0.12, np.pi / 2 + float(rng.uniform(-0.06, 0.06)))
