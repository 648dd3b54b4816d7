"""The bodies of people and of what they push: closed solids, x forward, z = 0 on the ground, rigid in mid-stride."""

from collections.abc import Iterator

import numpy as np

from stereogrid.geometry import FloatArray

from ..scene import textures as paint
from ..scene.solids import Paint, Solid, Vector, box, placed, prism
from ..scene.textures import Painter
from . import textures_indoor as indoor
from .storage import cart
from .textures_building import rough_wood

CLOTHS = (0.25, 0.35, 0.48, 0.66, 0.3, 0.78)
TROUSERS = (0.2, 0.3, 0.42)
SHOE = Paint("people shoe")
PATTERNS = ("plain", "stripes", "checks", "plain", "plain", "stripes")

PAINTERS: dict[str, Painter] = {
    **{
        f"people cloth {k}": indoor.cloth(shade, pattern)
        for k, (shade, pattern) in enumerate(zip(CLOTHS, PATTERNS, strict=True))
    },
    **{f"people trousers {k}": indoor.cloth(shade) for k, shade in enumerate(TROUSERS)},
    **{f"people skin {k}": paint.paint(shade, 0.015) for k, shade in enumerate((0.42, 0.62, 0.7))},
    **{f"people hair {k}": paint.paint(shade, 0.05) for k, shade in enumerate((0.12, 0.3, 0.5))},
    "people shoe": paint.paint(0.14, 0.02),
    "metal": paint.metal,
    "rubber": paint.paint(0.16, 0.02),
    "rough wood": rough_wood,
    "carton 0": paint.cardboard,
}
"""What a world needs of textures before people walk in it."""


def person(rng: np.random.Generator, *, pushing: bool = False) -> tuple[Solid, ...]:
    """Somebody of 1.55 to 1.95 m in clothes of their own; pushing: with both hands before them, or walking freely."""
    h = float(rng.uniform(1.55, 1.95))
    trousers = Paint(f"people trousers {rng.integers(len(TROUSERS))}")
    shirt = Paint(f"people cloth {rng.integers(len(CLOTHS))}")
    skin, hair = Paint(f"people skin {rng.integers(3)}"), Paint(f"people hair {rng.integers(3)}")
    parts = [*_legs(h, trousers), *_trunk(h, shirt, trousers), *_head(h, skin, hair)]
    parts += _arms(h, shirt, skin, pushing=pushing)
    if not pushing and rng.random() < 0.4:
        cloth = Paint(f"people cloth {rng.integers(len(CLOTHS))}")
        parts.append(box("rucksack", (-0.29, -0.15, 0.56 * h), (-0.09, 0.15, 0.8 * h), cloth))
    return tuple(parts)


def trolley(rng: np.random.Generator) -> tuple[Solid, ...]:
    """Somebody who pushes a loaded platform trolley; its middle is the body's."""
    walker = placed("pusher", person(rng, pushing=True), -0.55, 0.0)
    return (*placed("cart", cart(rng), 0.35, 0.0), *walker)


def _legs(h: float, trousers: Paint) -> Iterator[Solid]:
    """The left leg in front, the right one behind with its heel up."""
    for side, y, knee, foot in (
        ("left", 0.09, (0.17, 0.28), (0.27, 0.045)),
        ("right", -0.09, (0.0, 0.27), (-0.3, 0.07)),
    ):
        at_knee, at_foot = (knee[0], y, knee[1] * h), (foot[0], y, foot[1] * h - 0.01)
        yield _limb(f"{side} thigh", (at_knee, (0.0, 0.95 * y, 0.5 * h)), (0.06, 0.088), trousers)
        yield _limb(f"{side} shin", (at_foot, (knee[0], y, knee[1] * h + 0.02)), (0.042, 0.062), trousers)
        heel, sole = foot[0] - 0.115, foot[1] * h - 0.07
        yield box(f"{side} shoe", (heel, y - 0.045, sole), (heel + 0.27, y + 0.045, sole + 0.055), SHOE)
        yield box(f"{side} upper", (heel + 0.004, y - 0.04, sole + 0.05), (heel + 0.17, y + 0.04, sole + 0.1), SHOE)


def _trunk(h: float, shirt: Paint, trousers: Paint) -> Iterator[Solid]:
    def at(share: float) -> Vector:
        return (0.0, 0.0, share * h)

    yield _limb("hips", (at(0.465), at(0.57)), (0.165, 0.15), trousers, depth=0.7)
    yield _limb("waist", (at(0.555), at(0.66)), (0.155, 0.17), shirt, depth=0.68)
    yield _limb("chest", (at(0.655), at(0.805)), (0.17, 0.2), shirt, depth=0.64)
    yield _limb("shoulders", (at(0.8), at(0.85)), (0.2, 0.075), shirt, depth=0.64)


def _head(h: float, skin: Paint, hair: Paint) -> Iterator[Solid]:
    def at(share: float, x: float = 0.02) -> Vector:
        return (x, 0.0, share * h)

    yield _limb("neck", (at(0.83, 0.0), at(0.885)), (0.055, 0.052), skin)
    yield _limb("chin", (at(0.872, 0.025), at(0.91)), (0.05, 0.073), skin, depth=1.15)
    yield _limb("face", (at(0.908), at(0.965)), (0.073, 0.072), skin, depth=1.2)
    yield _limb("hair", (at(0.945, 0.005), at(0.982, 0.0)), (0.08, 0.076), hair, depth=1.15)
    yield _limb("crown", (at(0.98, 0.0), at(1.0, 0.0)), (0.076, 0.04), hair, depth=1.15)


def _arms(h: float, shirt: Paint, skin: Paint, *, pushing: bool) -> Iterator[Solid]:
    for side, y, swing in (("left", 0.225, -1.0), ("right", -0.225, 1.0)):
        elbow = (0.1, 1.15 * y, 0.63 * h) if pushing else (0.1 * swing - 0.03, 1.12 * y, 0.63 * h)
        hand = (0.42, y, 0.58 * h) if pushing else (0.2 * swing + 0.05, 1.12 * y, 0.48 * h)
        yield _limb(f"{side} upper arm", (elbow, (0.0, y, 0.82 * h)), (0.045, 0.058), shirt)
        yield _limb(f"{side} forearm", (hand, elbow), (0.034, 0.045), shirt)
        end = tuple(float(b + 0.3 * (b - a)) for a, b in zip(elbow, hand, strict=True))
        yield _limb(f"{side} hand", ((end[0], end[1], end[2]), hand), (0.03, 0.036), skin, sides=6)


def _limb(
    name: str,
    ends_m: tuple[Vector, Vector],
    radii_m: tuple[float, float],
    paint: Paint,
    *,
    depth: float = 1.0,
    sides: int = 10,
) -> Solid:
    """A tapered bar between two points, its radii across y [m], depth times as thick along x."""
    start, end = np.array(ends_m)
    along = (end - start) / np.linalg.norm(end - start)
    side = np.cross(along, [1.0, 0.0, 0.0]) if abs(along[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    angle = 2 * np.pi * np.arange(sides) / sides
    # Counterclockwise seen from the end: `side`, then `along` x `side`.
    ring: FloatArray = np.cos(angle)[:, None] * side + depth * np.sin(angle)[:, None] * np.cross(along, side)
    return prism(name, start + radii_m[0] * ring, end + radii_m[1] * ring, paint)
