"""Uneven ground: heights on a square lattice, as one closed textured solid."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, as_floats

from .solids import Face, Solid

IntArray = NDArray[np.int64]

SKIRT_M = 0.5
"""The solid goes down this far below its lowest point."""


@dataclass(frozen=True)
class Terrain:
    """The ground. heights_m (R, C): height [m] at x = x0 + column * pitch_m, y = y0 + row * pitch_m.

    origin_m: (x0, y0) [m]. texture: a name, mapped from above. A square's diagonal goes from its lowest x and y to
    its highest, here, in the solid and in the physics alike.
    """

    heights_m: FloatArray
    origin_m: tuple[float, float]
    pitch_m: float
    texture: str

    def __post_init__(self) -> None:
        if self.heights_m.ndim != 2 or min(self.heights_m.shape) < 2 or not np.isfinite(self.heights_m).all():
            raise InvalidInputError(f"heights_m must be (R >= 2, C >= 2) and finite, not {self.heights_m.shape}")
        if not self.pitch_m > 0:
            raise InvalidInputError(f"pitch_m must be positive, not {self.pitch_m}")

    @property
    def bounds_m(self) -> FloatArray:
        """(2, 2): lowest and highest x, y [m]."""
        size = (np.array(self.heights_m.shape[::-1]) - 1) * self.pitch_m
        return np.array([self.origin_m, self.origin_m + size])

    def height_m(self, xy_m: ArrayLike) -> FloatArray:
        """Height (...) of the ground at points (..., 2) [m], on its triangles; beyond its edge that of the edge."""
        u, v, column, row = self._square(xy_m)
        h00, h10 = self.heights_m[row, column], self.heights_m[row, column + 1]
        h01, h11 = self.heights_m[row + 1, column], self.heights_m[row + 1, column + 1]
        lower = h00 + u * (h10 - h00) + v * (h11 - h10)
        upper = h00 + v * (h01 - h00) + u * (h11 - h01)
        height: FloatArray = np.where(u >= v, lower, upper)
        return height

    def solid(self) -> Solid:
        """The ground as a closed body with a flat bottom, its top first, two triangles a square."""
        rows, columns = self.heights_m.shape
        x, y = (self.origin_m[k] + np.arange(n) * self.pitch_m for k, n in ((0, columns), (1, rows)))
        top = np.stack([*np.meshgrid(x, y), self.heights_m], axis=-1).reshape(-1, 3)
        rim = _rim(rows, columns)
        bottom = top[rim]
        bottom[:, 2] = self.heights_m.min() - SKIRT_M
        faces = (*self._top(), *self._sides(rim, len(top)))
        return Solid("ground", np.concatenate([top, bottom]), faces, seen_from_above=True)

    def _square(self, xy_m: ArrayLike) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
        """Place (u, v) in 0 to 1 within the square, and its column and row, of each point."""
        at = (as_floats(xy_m) - self.origin_m) / self.pitch_m
        last = np.array(self.heights_m.shape[::-1]) - 1
        at = np.clip(at, 0, last)
        corner = np.minimum(at.astype(np.int64), last - 1)
        share = at - corner
        return share[..., 0], share[..., 1], corner[..., 0], corner[..., 1]

    def _top(self) -> Iterator[Face]:
        rows, columns = self.heights_m.shape
        for row in range(rows - 1):
            for column in range(columns - 1):
                a = row * columns + column
                b, c, d = a + 1, a + columns + 1, a + columns
                for corners in ((a, b, c), (a, c, d)):
                    yield Face(corners, (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), self.texture, (0.0, 0.0), None)

    def _sides(self, rim: list[int], start: int) -> Iterator[Face]:
        """The four walls round the ground, and its bottom."""
        rows, columns = self.heights_m.shape
        for k, j in enumerate(rim):
            after = (k + 1) % len(rim)
            # The walls along x come first and third round the rim.
            along_x = k < columns - 1 or rows + columns - 2 <= k < rows + 2 * columns - 3
            s_axis = (1.0, 0.0, 0.0) if along_x else (0.0, 1.0, 0.0)
            corners = (start + k, start + after, rim[after], j)
            yield Face(corners, s_axis, (0.0, 0.0, -1.0), self.texture, (0.0, 0.0), None)
        bottom = tuple(range(start + len(rim) - 1, start - 1, -1))
        yield Face(bottom, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), self.texture, (0.0, 0.0), None)


def _rim(rows: int, columns: int) -> list[int]:
    """The vertices on the edge of the lattice, counterclockwise seen from above."""
    south = [*range(columns - 1)]
    east = [row * columns + columns - 1 for row in range(rows - 1)]
    north = [(rows - 1) * columns + column for column in range(columns - 1, 0, -1)]
    west = [row * columns for row in range(rows - 1, 0, -1)]
    return [*south, *east, *north, *west]
