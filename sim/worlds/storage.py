"""What a warehouse is full of: racks, pallets, cartons, barrels and the trucks that carry them.

Each piece is in a frame of its own, its origin on the floor in its middle: see solids.placed.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from stereogrid.geometry import from_rotation

from ..scene.solids import Paint, Solid, box, drum, placed, prism, rod

BAY_M = 2.7
DEPTH_M = 1.05
LEVELS_M = (1.55, 3.05)
"""Heights of a rack's beams; below them stand the first pallets on the floor."""
RACK_M = 4.3
PALLET_M = 0.144

UPRIGHT, BEAM, WOOD, STEEL, DARK = (
    Paint("upright"),
    Paint("beam"),
    Paint("rough wood"),
    Paint("metal"),
    Paint("dark varnish"),
)


def rack(bays: int) -> Iterator[Solid]:
    """A pallet rack along x: a frame every BAY_M, two pairs of beams a bay. All of it repeats."""
    half = bays * BAY_M / 2
    for k in range(bays + 1):
        yield from _frame(k, -half + k * BAY_M)
    for level, z in enumerate(LEVELS_M):
        for k in range(bays):
            a, b = -half + k * BAY_M + 0.035, -half + (k + 1) * BAY_M - 0.035
            for side, y in (("front", -DEPTH_M / 2 + 0.01), ("rear", DEPTH_M / 2 - 0.06)):
                yield box(f"{side} beam {level}{k}", (a, y, z - 0.12), (b, y + 0.05, z), BEAM)


def _frame(k: int, x: float) -> Iterator[Solid]:
    """Two slotted posts with feet, and the lacing between them."""
    h = DEPTH_M / 2
    for side, y in (("front", -h), ("rear", h - 0.09)):
        post = {"": UPRIGHT, "+x": Paint("upright", shift_m=x), "-x": Paint("upright", shift_m=-x)}
        yield box(f"{side} post {k}", (x - 0.045, y, 0.0), (x + 0.045, y + 0.09, RACK_M), post)
        yield box(f"{side} foot {k}", (x - 0.07, y - 0.02, -0.005), (x + 0.07, y + 0.11, 0.012), STEEL)
    for n, z in enumerate(np.arange(0.25, RACK_M - 0.6, 0.6)):
        ends = (-h + 0.05, h - 0.05) if n % 2 else (h - 0.05, -h + 0.05)
        yield rod(f"lacing {k}{n}", ((x, ends[0], float(z)), (x, ends[1], float(z) + 0.6)), 0.015, UPRIGHT, sides=5)


def pallet() -> Iterator[Solid]:
    """A pallet of 1.2 m along y and 0.8 m along x: deck boards on three bearers, blocks at their ends and runners."""
    for k, x in enumerate((-0.335, -0.17, 0.0, 0.17, 0.335)):
        yield box(f"board {k}", (x - 0.062, -0.6, 0.12), (x + 0.062, 0.6, PALLET_M), WOOD)
    for k, y in enumerate((-0.54, 0.0, 0.54)):
        yield box(f"bearer {k}", (-0.39, y - 0.055, 0.0), (0.39, y + 0.055, 0.1215), WOOD)


def load(rng: np.random.Generator, layers: int, texture: str = "stock carton") -> Iterator[Solid]:
    """A pallet with layers of six equal cartons, the last layer maybe begun."""
    yield from pallet()
    high, side = 0.3, {"": Paint(texture, fit=True)}
    taken = int(rng.integers(0, 4))
    for layer in range(layers):
        for n in range(6 - taken if layer == layers - 1 else 6):
            x, y = -0.39 + 0.39 * (n % 2), -0.585 + 0.39 * (n // 2)
            dx, dy = (float(v) for v in rng.uniform(-0.004, 0.004, 2))
            z = PALLET_M - 0.001 + layer * (high + 0.0015)
            low, top = (x + dx + 0.006, y + dy + 0.006, z), (x + dx + 0.384, y + dy + 0.384, z + high)
            yield box(f"carton {layer}{n}", low, top, side)


def barrel(name: str, x_m: float, y_m: float, texture: str) -> Iterator[Solid]:
    """A steel barrel of 200 l with its rims."""
    yield drum(name, (x_m, y_m, 0.0), (0.285, 0.285), 0.87, paint=Paint(texture), sides=20)
    for k, z in enumerate((0.004, 0.28, 0.57, 0.85)):
        yield drum(f"{name} rim {k}", (x_m, y_m, z), (0.297, 0.297), 0.028, paint=Paint(texture), sides=20)


def pallet_truck() -> Iterator[Solid]:
    """A hand pallet truck, its forks to +x."""
    for side, y in (("left", 0.19), ("right", -0.19)):
        yield box(f"{side} fork", (-0.2, y - 0.075, 0.06), (0.95, y + 0.075, 0.11), Paint("beam"))
        yield drum(f"{side} roller", (0.8, y, 0.0), (0.035, 0.035), 0.07, paint=DARK, sides=8)
    yield box("head", (-0.42, -0.27, 0.1), (-0.18, 0.27, 0.42), Paint("beam"))
    yield rod("wheel", ((-0.32, -0.09, 0.1), (-0.32, 0.09, 0.1)), 0.1, DARK, sides=14)
    yield rod("tiller", ((-0.36, 0.0, 0.35), (-0.62, 0.0, 1.2)), 0.02, DARK, sides=8)
    yield rod("grip", ((-0.62, -0.17, 1.19), (-0.62, 0.17, 1.19)), 0.017, DARK, sides=8)


def forklift() -> Iterator[Solid]:
    """A counterbalance truck, 1.1 m wide, its forks to +x: body, mast, guard, wheels."""
    yellow = Paint("truck varnish")
    yield box("body", (-0.95, -0.5, 0.22), (0.55, 0.5, 0.72), yellow)
    rear = np.array([(-1.15, -0.48), (-0.7, -0.5), (-0.7, 0.5), (-1.15, 0.48)])
    low, top = np.c_[rear, np.full(4, 0.25)], np.c_[0.94 * rear - [0.04, 0.0], np.full(4, 1.05)]
    yield prism("counterweight", low, top, DARK)
    yield box("seat", (-0.5, -0.25, 0.71), (0.0, 0.25, 0.86), Paint("seat cloth 0"))
    yield box("seat back", (-0.55, -0.24, 0.85), (-0.44, 0.24, 1.3), Paint("seat cloth 0"))
    for n, (x, y) in enumerate((x, y) for x in (-0.82, 0.42) for y in (-0.46, 0.46)):
        yield rod(f"guard post {n}", ((x, y, 0.7), (0.8 * x, 0.92 * y, 2.05)), 0.03, DARK, sides=8)
    yield box("guard roof", (-0.72, -0.46, 2.04), (0.42, 0.46, 2.1), DARK)
    for n, (x, y, r) in enumerate(((0.3, -0.5, 0.27), (0.3, 0.5, 0.27), (-0.75, -0.46, 0.23), (-0.75, 0.46, 0.23))):
        yield rod(f"wheel {n}", ((x, y - 0.1, r), (x, y + 0.1, r)), r, Paint("rubber"), sides=18)
    for side, y in (("left", 0.3), ("right", -0.3)):
        yield box(f"{side} mast", (0.6, y - 0.05, 0.08), (0.72, y + 0.05, 2.2), DARK)
        yield box(f"{side} fork", (0.74, y - 0.06, 0.12), (1.85, y + 0.06, 0.16), STEEL)
        yield box(f"{side} fork back", (0.735, y - 0.055, 0.125), (0.785, y + 0.055, 0.75), STEEL)
    for k, z in enumerate((0.35, 0.72, 1.2, 2.1)):
        yield box(f"mast bar {k}", (0.63, -0.34, z), (0.745, 0.34, z + 0.07), DARK)


def cart(rng: np.random.Generator) -> Iterator[Solid]:
    """A platform trolley with a bow handle at -x and two cartons on it."""
    yield box("platform", (-0.45, -0.3, 0.17), (0.45, 0.3, 0.21), WOOD)
    for k, (x, y) in enumerate((x, y) for x in (-0.36, 0.36) for y in (-0.24, 0.24)):
        yield rod(f"castor {k}", ((x, y - 0.02, 0.06), (x, y + 0.02, 0.06)), 0.06, Paint("rubber"), sides=12)
        yield box(f"fork {k}", (x - 0.03, y - 0.035, 0.07), (x + 0.03, y + 0.035, 0.172), STEEL)
    for side, y in (("left", 0.25), ("right", -0.25)):
        yield rod(f"{side} handle", ((-0.42, y, 0.2), (-0.46, y, 0.95)), 0.015, STEEL, sides=8)
    yield rod("grip", ((-0.46, -0.26, 0.94), (-0.46, 0.26, 0.94)), 0.016, STEEL, sides=8)
    z = 0.209
    for k, (w, h) in enumerate(((0.25, 0.32), (0.2, 0.26))):
        T = from_rotation(Rotation.from_euler("z", float(rng.uniform(-0.2, 0.2))).as_matrix(), (0.04, 0.0, 0.0))
        yield box(
            f"carton {k}", (-w, -0.9 * w, z), (w, 0.9 * w, z + h), {"": Paint("carton 0", fit=True)}, T_world_box=T
        )
        z += h - 0.001


def filled_rack(name: str, rng: np.random.Generator, bays: int) -> Iterator[Solid]:
    """A rack along x with three pallets in most places of a bay: equal loads, some places empty."""
    yield from placed(name, rack(bays), 0.0, 0.0)
    for level, z in enumerate((0.0, *LEVELS_M)):
        for n in range(3 * bays):
            x = -bays * BAY_M / 2 + BAY_M * (n // 3) + (0.5 + 0.85 * (n % 3)) + float(rng.uniform(-0.02, 0.02))
            if rng.random() < 0.12:
                continue
            parts = load(rng, int(rng.integers(2, 5))) if level < 2 else load(rng, int(rng.integers(2, 4)))
            y = float(rng.uniform(-0.03, 0.03))
            yield from placed(f"{name} {level}{n}", parts, x, y, z_m=z)
