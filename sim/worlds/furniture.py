"""Office furniture. Each piece is in a frame of its own, its front to +x, its origin on the floor: see solids.placed.

What stands against a wall begins at x = 0.01 and has its back there; the rest is centred.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from stereogrid.geometry import from_rotation

from ..scene.solids import Paint, Solid, box, drum, placed, rod

METAL, WHITE, DARK = Paint("metal"), Paint("white varnish"), Paint("dark varnish")
LACQUER = Paint("grey varnish")
SEAT_CLOTHS = ("seat cloth 0", "seat cloth 1")


def desk(rng: np.random.Generator, width_m: float = 1.5) -> Iterator[Solid]:
    """A desk 0.75 m deep whose user sits at +x: two T legs, drawers, a monitor, a keyboard."""
    w = width_m / 2
    top = {"+z": Paint(f"stuff {rng.integers(3)}", fit=True), "": Paint("laminate")}
    yield box("top", (-0.375, -w, 0.70), (0.375, w, 0.728), top)
    for side, y in (("left", w - 0.08), ("right", -w + 0.08)):
        yield box(f"{side} foot", (-0.33, y - 0.035, -0.005), (0.33, y + 0.035, 0.03), LACQUER)
        yield box(f"{side} leg", (-0.1, y - 0.025, 0.025), (0.02, y + 0.025, 0.705), LACQUER)
    yield box("panel", (-0.3, -w + 0.1, 0.3), (-0.28, w - 0.1, 0.69), Paint("laminate"))
    # Where the drawers are; the pile lies above them and the mug on the other side.
    y = float(rng.choice([-1, 1])) * (w - 0.36)
    yield from _drawers(y)
    yield from placed("screen", monitor(rng), -0.14, float(rng.uniform(-0.25, 0.25)), float(rng.uniform(-0.25, 0.25)))
    keys = {"+z": Paint("keyboard", fit=True), "": DARK}
    # Keys run along y, which is left to right for who sits at +x.
    yield box("keyboard", (0.12, -0.24, 0.727), (0.26, 0.2, 0.745), keys)
    yield box("mouse", (0.15, 0.26, 0.727), (0.25, 0.31, 0.75), DARK)
    if rng.random() < 0.7:
        yield drum("mug", (0.05, -y, 0.727), (0.035, 0.04), 0.1, paint=WHITE, sides=10)
    if rng.random() < 0.6:
        yield box("pile", (-0.3, y - 0.11, 0.727), (-0.01, y + 0.1, 0.79), Paint("paper"))


def _drawers(y: float) -> Iterator[Solid]:
    yield box("drawers", (-0.26, y - 0.2, 0.03), (0.28, y + 0.2, 0.58), Paint("grey varnish"))
    for k, z in enumerate((0.06, 0.25, 0.42)):
        high = (0.24, 0.41, 0.57)[k]
        front = {"+x": Paint("drawer", fit=True), "": WHITE}
        yield box(f"drawer {k}", (0.27, y - 0.19, z), (0.292, y + 0.19, high), front)


def monitor(rng: np.random.Generator) -> Iterator[Solid]:
    """A 24-inch monitor on its foot, on a desk 0.728 m high, on or off."""
    front = Paint(f"screen {rng.integers(3)}", fit=True) if rng.random() < 0.7 else Paint("screen off")
    yield box("foot", (-0.11, -0.12, 0.727), (0.09, 0.12, 0.74), DARK)
    yield box("neck", (-0.05, -0.025, 0.735), (-0.03, 0.025, 1.0), DARK)
    yield box("case", (-0.03, -0.28, 0.86), (0.0, 0.28, 1.2), DARK)
    yield box("picture", (-0.01, -0.268, 0.876), (0.002, 0.268, 1.188), {"+x": front, "": DARK})


def office_chair(rng: np.random.Generator) -> Iterator[Solid]:
    """A swivel chair on a star of five thin legs, facing +x."""
    cloth = Paint(str(rng.choice(SEAT_CLOTHS)))
    for k, angle in enumerate(2 * np.pi * (np.arange(5) + 0.1) / 5):
        x, y = 0.29 * float(np.cos(angle)), 0.29 * float(np.sin(angle))
        yield rod(f"leg {k}", ((0.0, 0.0, 0.12), (x, y, 0.075)), 0.018, DARK)
        yield drum(f"castor {k}", (x, y, 0.0), (0.026, 0.026), 0.065, paint=DARK, sides=8)
    yield drum("spring", (0.0, 0.0, 0.09), (0.028, 0.022), 0.34, paint=METAL, sides=8)
    yield box("seat", (-0.23, -0.24, 0.42), (0.25, 0.24, 0.50), cloth)
    tilt = from_rotation(Rotation.from_euler("y", -0.12).as_matrix(), (-0.25, 0.0, 0.0))
    yield box("back", (-0.03, -0.22, 0.60), (0.03, 0.22, 1.08), cloth, T_world_box=tilt)
    yield box("back bar", (-0.055, -0.03, 0.40), (-0.02, 0.03, 0.75), DARK, T_world_box=tilt)
    for side, y in (("left", 0.27), ("right", -0.27)):
        yield box(f"{side} arm", (-0.14, y - 0.03, 0.66), (0.13, y + 0.03, 0.69), DARK)
        yield box(f"{side} arm post", (-0.03, y - 0.015, 0.43), (0.01, y + 0.015, 0.665), DARK)


def stacking_chair(rng: np.random.Generator) -> Iterator[Solid]:
    """A chair on four steel legs 22 mm thick, facing +x."""
    cloth = Paint(str(rng.choice(SEAT_CLOTHS)))
    yield box("seat", (-0.21, -0.22, 0.43), (0.22, 0.22, 0.465), cloth)
    yield box("back", (-0.235, -0.21, 0.62), (-0.21, 0.21, 0.86), cloth)
    for side, y in (("left", 0.2), ("right", -0.2)):
        yield rod(f"{side} front leg", ((0.2, 1.1 * y, -0.005), (0.18, y, 0.44)), 0.011, METAL)
        yield rod(f"{side} hind leg", ((-0.23, 1.1 * y, -0.005), (-0.2, y, 0.44)), 0.011, METAL)
        yield rod(f"{side} back post", ((-0.2, y, 0.44), (-0.232, 0.98 * y, 0.84)), 0.011, METAL)


def bookcase(rng: np.random.Generator, width_m: float = 0.8, height_m: float = 1.9) -> Iterator[Solid]:
    """An open case 0.32 m deep against a wall, its shelves full of books and binders."""
    w, wood = width_m / 2, Paint(f"wood {rng.integers(3)}")
    for side, y in (("left", w - 0.018), ("right", -w)):
        yield box(f"{side} side", (0.01, y, -0.005), (0.33, y + 0.018, height_m), wood)
    yield box("back", (0.012, -w + 0.008, 0.06), (0.02, w - 0.008, height_m - 0.01), wood)
    shelves = np.linspace(0.07, height_m - 0.02, 6)
    for k, z in enumerate(float(s) for s in shelves):
        yield box(f"shelf {k}", (0.015, -w + 0.01, z - 0.02), (0.325, w - 0.01, z), wood)
        if k + 1 < len(shelves):
            yield from _row(rng, k, w - 0.022, z)


def _row(rng: np.random.Generator, k: int, half_m: float, z: float) -> Iterator[Solid]:
    """What stands on one shelf."""
    kind = str(rng.choice(["books", "books", "binders", "some books", "carton"]))
    front, high = float(rng.uniform(0.27, 0.31)), z + 0.3
    if kind == "carton":
        sides = {"": Paint(f"carton {rng.integers(2)}", fit=True)}
        yield box(f"carton {k}", (0.03, -half_m + 0.08, z - 0.002), (front, half_m - 0.2, z + 0.24), sides)
        return
    name = f"binders {rng.integers(2)}" if kind == "binders" else f"books {rng.integers(4)}"
    end = half_m * float(rng.uniform(-0.2, 0.5)) if kind == "some books" else half_m
    paint = {"+x": Paint(name, fit=True), "": Paint("paper")}
    yield box(f"{kind} {k}", (0.025, -half_m, z - 0.002), (front, end, high), paint)


def cabinet(width_m: float = 0.8, height_m: float = 1.2) -> Iterator[Solid]:
    """A plain steel cabinet 0.45 m deep against a wall: hardly any texture."""
    w = width_m / 2
    yield box("case", (0.01, -w, -0.005), (0.45, w, height_m), Paint("steel"))
    for side, a, b in (("left", 0.004, w - 0.01), ("right", -w + 0.01, -0.004)):
        yield box(f"{side} door", (0.445, a, 0.06), (0.462, b, height_m - 0.02), Paint("steel"))
        y = a + 0.03 if side == "left" else b - 0.03
        yield box(
            f"{side} handle", (0.46, y - 0.008, 0.55 * height_m), (0.485, y + 0.008, 0.55 * height_m + 0.16), METAL
        )


def sofa(rng: np.random.Generator, width_m: float = 1.7) -> Iterator[Solid]:
    """A sofa against a wall."""
    w, cloth = width_m / 2, Paint(f"sofa cloth {rng.integers(2)}")
    yield box("base", (0.06, -w, 0.12), (0.8, w, 0.28), cloth)
    yield box("back", (0.05, -w + 0.01, 0.115), (0.24, w - 0.01, 0.78), cloth)
    for side, y in (("left", w - 0.16), ("right", -w)):
        yield box(f"{side} arm", (0.04, y - 0.005, 0.11), (0.82, y + 0.165, 0.56), cloth)
    for k, y in enumerate((-w / 2 + 0.08, w / 2 - 0.08)):
        half = w / 2 - 0.09
        yield box(f"cushion {k}", (0.2, y - half, 0.275), (0.79, y + half, 0.42), cloth)
    for k, (x, y) in enumerate((x, y) for x in (0.12, 0.74) for y in (-w + 0.08, w - 0.08)):
        yield rod(f"leg {k}", ((x, y, -0.005), (x, y, 0.13)), 0.018, METAL)


def table(size_m: tuple[float, float] = (1.8, 0.9), height_m: float = 0.74, texture: str = "wood 0") -> Iterator[Solid]:
    """A table on four square legs, long along x."""
    a, b = size_m[0] / 2, size_m[1] / 2
    yield box("top", (-a, -b, height_m - 0.03), (a, b, height_m), Paint(texture))
    for k, (x, y) in enumerate((x, y) for x in (-a + 0.07, a - 0.07) for y in (-b + 0.07, b - 0.07)):
        yield box(f"leg {k}", (x - 0.025, y - 0.025, -0.005), (x + 0.025, y + 0.025, height_m - 0.025), METAL)


def flip_chart() -> Iterator[Solid]:
    """A board on three thin legs, facing +x."""
    lean = from_rotation(Rotation.from_euler("y", -0.09).as_matrix(), (0.1, 0.0, 0.0))
    board = {"+x": Paint("whiteboard", fit=True), "": WHITE}
    yield box("board", (-0.012, -0.34, 0.85), (0.012, 0.34, 1.85), board, T_world_box=lean)
    for k, (x, y, top) in enumerate(((0.1, 0.3, 0.2), (0.1, -0.3, -0.2), (-0.42, 0.0, 0.0))):
        yield rod(f"leg {k}", ((x, y, -0.005), (-0.02 - 0.05 * (k == 2), top, 1.25)), 0.012, METAL)


def bin_drum(name: str, x_m: float, y_m: float) -> Solid:
    """A waste bin."""
    return drum(name, (x_m, y_m, 0.0), (0.13, 0.16), 0.48, paint=DARK)


def plant(name: str, x_m: float, y_m: float, rng: np.random.Generator) -> Iterator[Solid]:
    """A pot with upright leaves: thin closed plates, 3 mm thick."""
    yield drum(f"{name} pot", (x_m, y_m, 0.0), (0.12, 0.17), 0.34, paint=WHITE)
    for k in range(22):
        turn = Rotation.from_euler("ZY", [rng.uniform(0, 2 * np.pi), rng.uniform(0.05, 0.55)])
        T = from_rotation(turn.as_matrix(), (x_m, y_m, 0.3))
        length, width = float(rng.uniform(0.35, 0.75)), float(rng.uniform(0.02, 0.035))
        yield box(f"{name} leaf {k}", (-0.0015, -width, 0), (0.0015, width, length), Paint("leaf"), T_world_box=T)
