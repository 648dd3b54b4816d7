"""Walls with door openings, and what is fixed to them, in a wall's own frame."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stereogrid.geometry import FloatArray, from_yaw

from .solids import Paint, Solid, Vector, box

HEIGHT_M = 2.6
THICKNESS_M = 0.15
DOOR_M = (0.9, 2.05)


@dataclass(frozen=True)
class Wall:
    """A wall from start_m to end_m (2,) [m] with the room on its left; doors_m: centres of its doors along it.

    Its frame: x along the wall, y into the room from its surface, z up. extend_m lengthens it at its start,
    which closes convex corners (and, negative, avoids overlapping faces at reflex ones).
    """

    name: str
    start_m: tuple[float, float]
    end_m: tuple[float, float]
    doors_m: tuple[float, ...] = ()
    extend_m: float = THICKNESS_M

    @property
    def length_m(self) -> float:
        """Length of the surface [m]."""
        return float(np.hypot(self.end_m[0] - self.start_m[0], self.end_m[1] - self.start_m[1]))

    @property
    def T_world_wall(self) -> FloatArray:
        """Pose (4, 4) of the wall's frame."""
        yaw = np.arctan2(self.end_m[1] - self.start_m[1], self.end_m[0] - self.start_m[0])
        return from_yaw(float(yaw), (*self.start_m, 0.0))

    def box(self, name: str, low_m: Vector, high_m: Vector, paint: Paint | dict[str, Paint]) -> Solid:
        """A box given in the wall's frame."""
        return box(f"{self.name} {name}", low_m, high_m, paint, T_world_box=self.T_world_wall)

    def panel(self, name: str, center_m: tuple[float, float], size_m: tuple[float, float], texture: str) -> Solid:
        """A thin board on the wall, proud by 12 mm: centre (along, up) and size (width, height) [m]."""
        (s, z), (w, h) = center_m, size_m
        paint = {"+y": Paint(texture, fit=True), "": Paint("white varnish")}
        return self.box(name, (s - w / 2, -0.02, z - h / 2), (s + w / 2, 0.012, z + h / 2), paint)

    def solids(self) -> Iterator[Solid]:
        """The wall itself: masonry, skirting boards, rails, doors."""
        half = DOOR_M[0] / 2
        edges = [-self.extend_m, *(e for d in sorted(self.doors_m) for e in (d - half, d + half)), self.length_m]
        for k, (a, b) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
            yield self.box(f"masonry {k}", (a, -THICKNESS_M, 0), (b, 0, HEIGHT_M), Paint("wall", shift_m=1.3))
            # Trim ends before door frames and corners, so that no two faces share a plane.
            first, last = max(a, 0.0) + 0.07, b - 0.07
            yield self.box(f"skirting {k}", (first, -0.01, -0.01), (last, 0.014, 0.1), Paint("dark varnish"))
            yield self.box(f"rail {k}", (first, -0.01, 0.88), (last, 0.03, 0.98), Paint("wood 0"))
        for k, door in enumerate(self.doors_m):
            yield from self._door(k, door)

    def _door(self, k: int, s: float) -> Iterator[Solid]:
        w, h = DOOR_M[0] / 2, DOOR_M[1]
        yield self.box(f"lintel {k}", (s - w, -THICKNESS_M, h), (s + w, 0, HEIGHT_M), Paint("wall", shift_m=1.3))
        leaf = {"+y": Paint(f"wood {k % 3}", fit=True), "": Paint("dark varnish")}
        yield self.box(f"door {k}", (s - w - 0.01, -0.11, 0.005), (s + w + 0.01, -0.06, h + 0.01), leaf)
        frame = Paint("grey varnish")
        yield self.box(f"left jamb {k}", (s - w - 0.06, -0.055, -0.01), (s - w + 0.012, 0.018, h), frame)
        yield self.box(f"right jamb {k}", (s + w - 0.012, -0.055, -0.01), (s + w + 0.06, 0.018, h), frame)
        yield self.box(f"head {k}", (s - w - 0.06, -0.055, h - 0.012), (s + w + 0.06, 0.0185, h + 0.06), frame)
        yield self.box(f"kick plate {k}", (s - w + 0.06, -0.07, 0.03), (s + w - 0.06, -0.056, 0.28), Paint("metal"))
        yield self.box(f"handle plate {k}", (s + w - 0.13, -0.07, 0.95), (s + w - 0.09, -0.052, 1.17), Paint("metal"))
        yield self.box(f"handle {k}", (s + w - 0.22, -0.03, 1.06), (s + w - 0.1, -0.012, 1.08), Paint("metal"))
        yield self.box(f"spindle {k}", (s + w - 0.12, -0.06, 1.062), (s + w - 0.102, -0.02, 1.078), Paint("metal"))
        yield self.panel(f"sign {k}", (s + w + 0.24, 1.55), (0.2, 0.1), f"sign {k % 3}")
