"""Walls with openings, and what is fixed to them, in a wall's own frame."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, from_yaw

from ..scene.solids import Paint, Solid, Vector, box
from .glazing import frame_and_panes

HEIGHT_M = 2.6
THICKNESS_M = 0.15
DOOR_M = (0.9, 2.05)
FILLS = ("door", "free", "glass")


@dataclass(frozen=True)
class Opening:
    """A hole in a wall: its centre along it and its width, sill and head [m], and what fills it.

    fill: "door", a closed leaf; "free", nothing; "glass", a frame with panes, `panes` side by side.
    """

    at_m: float
    width_m: float = DOOR_M[0]
    sill_m: float = 0.0
    head_m: float = DOOR_M[1]
    fill: str = "door"
    panes: int = 1

    def __post_init__(self) -> None:
        if self.fill not in FILLS:
            raise InvalidInputError(f"an opening is filled with one of {', '.join(FILLS)}, not {self.fill!r}")


@dataclass(frozen=True)
class Wall:
    """A wall from start_m to end_m (2,) [m] with the room on its left; doors_m: centres of its doors along it.

    Its frame: x along the wall, y into the room from its surface, z up. extend_m lengthens it at its start,
    which closes convex corners (and, negative, avoids overlapping faces at reflex ones). openings: further holes.
    paint: of its faces; trim: whether it has skirting boards, rail: whether it has a wooden one at 0.9 m.
    """

    name: str
    start_m: tuple[float, float]
    end_m: tuple[float, float]
    doors_m: tuple[float, ...] = ()
    extend_m: float = THICKNESS_M
    openings: tuple[Opening, ...] = ()
    height_m: float = HEIGHT_M
    paint: Paint | dict[str, Paint] = Paint("wall", shift_m=1.3)  # noqa: RUF009 - it is frozen
    trim: bool = True
    rail: bool = True

    @property
    def length_m(self) -> float:
        """Length of the surface [m]."""
        return float(np.hypot(self.end_m[0] - self.start_m[0], self.end_m[1] - self.start_m[1]))

    @property
    def T_world_wall(self) -> FloatArray:
        """Pose (4, 4) of the wall's frame."""
        yaw = np.arctan2(self.end_m[1] - self.start_m[1], self.end_m[0] - self.start_m[0])
        return from_yaw(float(yaw), (*self.start_m, 0.0))

    def point(self, along_m: float, out_m: float) -> tuple[float, float]:
        """The place (x, y) in the world that is along_m along the wall and out_m into the room [m]."""
        x, y, _ = (self.T_world_wall @ [along_m, out_m, 0, 1])[:3]
        return float(x), float(y)

    @property
    def yaw_rad(self) -> float:
        """Yaw of what stands with its back to the wall: its front, +x, looks into the room."""
        return float(np.arctan2(*self.T_world_wall[1::-1, 1]))

    def box(self, name: str, low_m: Vector, high_m: Vector, paint: Paint | dict[str, Paint]) -> Solid:
        """A box given in the wall's frame."""
        return box(f"{self.name} {name}", low_m, high_m, paint, T_world_box=self.T_world_wall)

    def panel(self, name: str, center_m: tuple[float, float], size_m: tuple[float, float], texture: str) -> Solid:
        """A thin board on the wall, proud by 12 mm: centre (along, up) and size (width, height) [m]."""
        (s, z), (w, h) = center_m, size_m
        paint = {"+y": Paint(texture, fit=True), "": Paint("white varnish")}
        return self.box(name, (s - w / 2, -0.02, z - h / 2), (s + w / 2, 0.012, z + h / 2), paint)

    def solids(self) -> Iterator[Solid]:
        """The wall itself: masonry, skirting boards, rails, doors and panes."""
        holes = sorted((*self.openings, *(Opening(d) for d in self.doors_m)), key=lambda hole: hole.at_m)
        rims = [(h.at_m - h.width_m / 2, h.at_m + h.width_m / 2) for h in holes]
        edges = [-self.extend_m, *(e for rim in rims for e in rim), self.length_m]
        for k, (a, b) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
            yield self.box(f"masonry {k}", (a, -THICKNESS_M, 0), (b, 0, self.height_m), self.paint)
            yield from self._trim(k, a, b)
        for k, hole in enumerate(holes):
            yield from self._fill(k, hole)

    def _trim(self, k: int, a: float, b: float) -> Iterator[Solid]:
        # Trim ends before door frames and corners, so that no two faces share a plane.
        first, last = max(a, 0.0) + 0.07, b - 0.07
        if self.trim:
            yield self.box(f"skirting {k}", (first, -0.01, -0.01), (last, 0.014, 0.1), Paint("dark varnish"))
        if self.rail:
            yield self.box(f"rail {k}", (first, -0.01, 0.88), (last, 0.03, 0.98), Paint("wood 0"))

    def _fill(self, k: int, hole: Opening) -> Iterator[Solid]:
        a, b = hole.at_m - hole.width_m / 2, hole.at_m + hole.width_m / 2
        if hole.head_m < self.height_m:
            yield self.box(f"lintel {k}", (a, -THICKNESS_M, hole.head_m), (b, 0, self.height_m), self.paint)
        if hole.sill_m > 0:
            yield self.box(f"parapet {k}", (a, -THICKNESS_M, 0), (b, 0, hole.sill_m), self.paint)
        if hole.fill == "door":
            yield from self._door(k, hole.at_m)
        elif hole.fill == "glass":
            low, high = (a, -0.11, hole.sill_m), (b, -0.05, hole.head_m)
            for part in frame_and_panes(low, high, hole.panes):
                yield self.box(f"window {k} {part.name}", part.low_m, part.high_m, Paint(part.texture))

    def _door(self, k: int, s: float) -> Iterator[Solid]:
        w, h = DOOR_M[0] / 2, DOOR_M[1]
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
