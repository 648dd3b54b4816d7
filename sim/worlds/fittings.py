"""What belongs to a building: slabs of floor, lamps in ceilings, radiators."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from ..scene.scene import Lamp
from ..scene.solids import Paint, Solid, box
from .walls import Wall

Rect = tuple[tuple[float, float], tuple[float, float]]
"""Lowest and highest corner (x, y) [m]."""


def slabs(
    name: str, area: Rect, paint: Paint, patches: Sequence[tuple[Rect, Paint]] = (), *, top_m: float = 0.0
) -> Iterator[Solid]:
    """A floor 0.1 m thick, with patches of another paint let into it flush; patches must not overlap."""
    (x0, y0), (x1, y1) = area
    cuts = sorted({y0, y1, *(y for (low, high), _ in patches for y in (low[1], high[1]))})
    count = 0
    for south, north in pairwise(cuts):
        here = sorted((low[0], high[0]) for (low, high), _ in patches if low[1] < north and high[1] > south)
        edges = [x0, *(x for span in here for x in span), x1]
        for west, east in zip(edges[::2], edges[1::2], strict=True):
            if east > west:
                yield box(f"{name} {count}", (west, south, top_m - 0.1), (east, north, top_m), paint)
                count += 1
    for k, ((low, high), other) in enumerate(patches):
        yield box(f"{name} patch {k}", (*low, top_m - 0.1), (*high, top_m), other)


def lamp_grid(xs_m: Sequence[float], ys_m: Sequence[float], size_m: tuple[float, float], **how: float) -> list[Lamp]:
    """Lamps at every (x, y); how: z_m, their height [m], and power."""
    return [Lamp((float(x), float(y), how["z_m"]), size_m, how.get("power", 1.0)) for x in xs_m for y in ys_m]


def lamp_fitting(k: int, lamp: Lamp, ceiling_m: float) -> Iterator[Solid]:
    """The lit box of a lamp, up to the ceiling or, if it hangs lower, 80 mm high and on two rods."""
    (x, y, z), (a, b) = lamp.center_m, (lamp.size_m[0] / 2, lamp.size_m[1] / 2)
    sides = {"-z": Paint("lamp", fit=True), "": Paint("white varnish")}
    hangs = ceiling_m - z > 0.2
    yield box(f"lamp {k}", (x - a, y - b, z), (x + a, y + b, z + 0.08 if hangs else ceiling_m + 0.01), sides)
    for end in (-0.7, 0.7) if hangs else ():
        dx, dy = (end * a, 0.0) if a > b else (0.0, end * b)
        low, high = (x + dx - 0.01, y + dy - 0.01, z + 0.07), (x + dx + 0.01, y + dy + 0.01, ceiling_m + 0.015)
        yield box(f"lamp {k} rod {end}", low, high, Paint("metal"))


def radiator(wall: Wall, k: int, at_m: float, width_m: float = 1.2) -> Iterator[Solid]:
    """A ribbed radiator on a wall, with its valve and pipe."""
    a, b = at_m - width_m / 2, at_m + width_m / 2
    yield wall.box(f"radiator {k}", (a, 0.03, 0.14), (b, 0.11, 0.7), Paint("ribbed"))
    yield wall.box(f"radiator {k} grid", (a - 0.004, 0.028, 0.69), (b + 0.004, 0.112, 0.715), Paint("white varnish"))
    for side, s in (("left", a + 0.12), ("right", b - 0.12)):
        yield wall.box(f"radiator {k} {side} bracket", (s, -0.01, 0.2), (s + 0.03, 0.035, 0.6), Paint("white varnish"))
    yield wall.box(f"radiator {k} pipe", (b + 0.03, 0.05, -0.01), (b + 0.05, 0.07, 0.2), Paint("white varnish"))
    yield wall.box(f"radiator {k} valve", (b - 0.01, 0.04, 0.16), (b + 0.075, 0.08, 0.21), Paint("metal"))


def column(name: str, center_m: tuple[float, float], width_m: float, ceiling_m: float, texture: str) -> Iterator[Solid]:
    """A square column with a foot of metal."""
    (x, y), h = center_m, width_m / 2
    yield box(name, (x - h, y - h, 0), (x + h, y + h, ceiling_m), Paint(texture))
    f = h + 0.012
    yield box(f"{name} foot", (x - f, y - f, -0.01), (x + f, y + f, 0.12), Paint("metal"))


def spread(low: float, high: float, count: int) -> list[float]:
    """`count` equal steps' middles between two bounds."""
    return [float(v) for v in low + (np.arange(count) + 0.5) * (high - low) / count]
