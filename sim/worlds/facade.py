"""Buildings: a front with recessed windows and a door, plain halls, and houses far away."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stereogrid.geometry import FloatArray, transform

from ..scene.skin import hull
from ..scene.solids import Paint, Solid, Vector, box, drum

BAY_M = 2.4
WINDOW_M = (1.3, 1.5)
FLOORS_M = (0.95, 4.05)
"""Heights of the window sills."""
TOP_M = 6.7
DEPTH_M = 6.5
WALL_M = 0.3


@dataclass(frozen=True)
class Front:
    """A building's front: T_world_front (4, 4) has x along it, y out of it, z up. bays: how many; door: which one.

    panes: names of textures of windows, taken in turn as `order` (a number a window) says.
    """

    name: str
    T_world_front: FloatArray
    bays: int
    door: int
    order: tuple[int, ...]

    @property
    def length_m(self) -> float:
        """Along the front [m]."""
        return self.bays * BAY_M

    def solids(self) -> Iterator[Solid]:
        """Masonry, windows, door, core and roof."""
        windows = [((k + 0.5) * BAY_M - WINDOW_M[0] / 2, (k + 0.5) * BAY_M + WINDOW_M[0] / 2) for k in range(self.bays)]
        door = [windows[self.door]]
        low, high = FLOORS_M
        head = WINDOW_M[1]
        yield from self._row("base", (-0.8, 0.0), [], "brick")
        yield from self._row("parapet", (0.0, low), door, "brick")
        yield from self._row("ground floor", (low, low + head), windows, "brick")
        yield from self._row("band", (low + head, high), [], "render coat")
        yield from self._row("first floor", (high, high + head), windows, "render coat")
        yield from self._row("top", (high + head, TOP_M), [], "render coat")
        # What is hidden ends short of what hides it, so that no two faces share a plane.
        low_m, high_m = (0.02, -DEPTH_M + 0.02, -0.78), (self.length_m - 0.02, -WALL_M - 0.05, TOP_M - 0.1)
        yield self._box("core", low_m, high_m, "room")
        for k in (0, 1):
            x = k * (self.length_m - WALL_M)
            low_m, high_m = (x, -DEPTH_M, -0.8), (x + WALL_M, -WALL_M, TOP_M)
            yield self._box(f"gable {k}", low_m, high_m, "render coat")
        low_m, high_m = (-0.12, -DEPTH_M - 0.1, TOP_M - 0.002), (self.length_m + 0.12, 0.14, TOP_M + 0.22)
        yield self._box("cornice", low_m, high_m, "concrete")
        yield self._box("plinth 0", (-0.002, -0.1, -0.82), (door[0][0] - 0.004, 0.035, 0.34), "concrete")
        yield self._box("plinth 1", (door[0][1] + 0.004, -0.1, -0.82), (self.length_m + 0.002, 0.035, 0.34), "concrete")
        for k, (a, b) in enumerate(windows):
            for floor, sill in enumerate(FLOORS_M):
                if (k, floor) == (self.door, 0):
                    yield from self._door(a, b)
                else:
                    yield from self._window(f"{floor} {k}", (a, sill), f"window {self.order[k + floor * self.bays]}")
        for x in (BAY_M, self.length_m - BAY_M):
            foot = transform(self.T_world_front, np.array([x, 0.07, -0.3]))
            at: Vector = (float(foot[0]), float(foot[1]), float(foot[2]))
            yield drum(f"{self.name} downpipe {x:.1f}", at, (0.05, 0.05), TOP_M + 0.2, paint=Paint("iron"))

    def _box(self, name: str, low: Vector, high: Vector, texture: str, *, fit: bool = False) -> Solid:
        return box(f"{self.name} {name}", low, high, Paint(texture, fit=fit), T_world_box=self.T_world_front)

    def _row(
        self, name: str, z_m: tuple[float, float], openings: list[tuple[float, float]], texture: str
    ) -> Iterator[Solid]:
        """A course of masonry from one height to another, with openings from left to right."""
        edges = [0.0, *(e for opening in openings for e in opening), self.length_m]
        for k, (a, b) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
            yield self._box(f"{name} {k}", (a, -WALL_M, z_m[0]), (b, 0.0, z_m[1]), texture)

    def _window(self, name: str, corner_m: tuple[float, float], pane: str) -> Iterator[Solid]:
        """Pane, frame, mullion and sill in an opening whose lower left corner is at (x, z)."""
        (a, z), (w, h) = corner_m, WINDOW_M
        low, high = (a - 0.02, -0.18, z - 0.02), (a + w + 0.02, -0.16, z + h + 0.02)
        yield self._box(f"pane {name}", low, high, pane, fit=True)
        for part, low, high in (
            ("left", (a - 0.01, -0.2, z - 0.01), (a + 0.06, -0.12, z + h + 0.01)),
            ("right", (a + w - 0.06, -0.2, z - 0.01), (a + w + 0.01, -0.12, z + h + 0.01)),
            ("head", (a + 0.05, -0.199, z + h - 0.06), (a + w - 0.05, -0.121, z + h + 0.008)),
            ("foot", (a + 0.05, -0.199, z - 0.008), (a + w - 0.05, -0.121, z + 0.06)),
            ("mullion", (a + 0.62, -0.198, z + 0.05), (a + 0.68, -0.123, z + h - 0.05)),
        ):
            yield self._box(f"{part} {name}", low, high, "window frame")
        low, high = (a - 0.06, -0.15, z - 0.06), (a + w + 0.06, 0.06, z + 0.012)
        yield self._box(f"sill {name}", low, high, "concrete")

    def _door(self, a: float, b: float) -> Iterator[Solid]:
        """A glazed double door between x = a and b, with a step."""
        top = FLOORS_M[0] + WINDOW_M[1]
        yield self._box("door glass", (a - 0.02, -0.2, -0.02), (b + 0.02, -0.18, top + 0.02), "window 0", fit=True)
        middle = 0.5 * (a + b)
        for part, low, high in (
            ("left", (a - 0.01, -0.22, -0.01), (a + 0.09, -0.13, top + 0.01)),
            ("right", (b - 0.09, -0.22, -0.01), (b + 0.01, -0.13, top + 0.01)),
            ("middle", (middle - 0.08, -0.219, -0.012), (middle + 0.08, -0.131, 2.1)),
            ("transom", (a + 0.08, -0.218, 2.05), (b - 0.08, -0.132, 2.15)),
            ("kick", (a + 0.08, -0.217, -0.008), (middle - 0.07, -0.133, 0.3)),
            ("kick 1", (middle + 0.07, -0.217, -0.008), (b - 0.08, -0.133, 0.3)),
            ("head", (a + 0.08, -0.216, top - 0.09), (b - 0.08, -0.134, top + 0.008)),
        ):
            yield self._box(f"door {part}", low, high, "window frame")
        yield self._box("door step", (a - 0.15, -0.25, -0.84), (b + 0.15, 0.45, 0.03), "granite")


def house(name: str, low_m: tuple[float, float], high_m: tuple[float, float], texture: str) -> Iterator[Solid]:
    """A house with a pitched roof, its ridge along its longer side; the corners are (x, y) [m]."""
    (x0, y0), (x1, y1) = low_m, high_m
    eave, ridge = 5.9, 8.4
    yield box(name, (x0, y0, -1.0), (x1, y1, eave), Paint(texture))
    middle_x, middle_y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    along_x = [(x0 - 0.2, middle_y), (x1 + 0.2, middle_y)]
    ends = along_x if x1 - x0 > y1 - y0 else [(middle_x, y0 - 0.2), (middle_x, y1 + 0.2)]
    eaves = [(x, y, eave - 0.1) for x in (x0 - 0.35, x1 + 0.35) for y in (y0 - 0.35, y1 + 0.35)]
    points = np.array([*eaves, *((x, y, ridge) for x, y in ends)])
    yield hull(f"{name} roof", points, "roof tiles")
