"""How far it is to the nearest obstacle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import distance_transform_edt, map_coordinates

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_floats
from .blocks import BlockStore
from .boxes import Span, check_memory, dense, padded_size
from .states import Judge, State, states_of

WORKING_BYTES = 32
"""Of a cell while its distance is found: scipy keeps the index of the nearest obstacle and the distance itself."""


@dataclass(frozen=True)
class DistanceField:
    """Euclidean distances between cell centres [m]: from each cell of a box to the nearest obstacle's.

    origin (3,) int64: the index of the cell of distance_m[0, 0, 0]; distance_m (X, Y, Z) float32, infinite where the
    box holds no obstacle. Signed: an obstacle's cell has less the distance to the nearest cell that is none, so that
    the field passes 0 on the faces between the two.
    """

    origin: Array
    cell_m: float
    distance_m: Array

    def at(self, points_m: ArrayLike) -> FloatArray:
        """Distances (N,) [m] at points (N, 3) in world [m], linear between cell centres; NaN outside the box."""
        points = as_floats(points_m)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InvalidInputError(f"points must be (N, 3), not {points.shape}")
        cells = points / self.cell_m - self.origin
        shape = np.array(self.distance_m.shape)
        inside = ((cells >= 0) & (cells <= shape)).all(axis=1)
        found = np.full(len(points), np.nan)
        first = self.distance_m.flat[0]
        if not np.isfinite(first):
            found[inside] = first
            return found
        found[inside] = map_coordinates(self.distance_m, cells[inside].T - 0.5, np.float64, order=1, mode="nearest")
        return found


def distance_field(
    blocks: BlockStore,
    cell_m: float,
    span: Span,
    *,
    judge: Judge,
    unknown_is_obstacle: bool,
    signed: bool,
    limit_gb: float,
) -> DistanceField:
    """The distance field of the cells of a span (3,). Obstacles outside the span do not count."""
    size = " x ".join(str(n) for n in span[1] - span[0])
    check_memory(WORKING_BYTES * padded_size(span), limit_gb, f"a distance field of {size} cells")
    states = dense(blocks, span, lambda words: states_of(words, judge), State.UNKNOWN)
    obstacle = states == State.OCCUPIED
    if unknown_is_obstacle:
        obstacle |= states == State.UNKNOWN
    distance = _distance(~obstacle)
    if signed:
        distance = np.where(obstacle, -_distance(obstacle), distance)
    return DistanceField(span[0], cell_m, distance * np.float32(cell_m))


def _distance(inside: Array) -> Array:
    """float32 distances [cells] of the cells `inside` (X, Y, Z) from the nearest that is not; infinite without one."""
    if inside.all():
        return np.full(inside.shape, np.inf, dtype=np.float32)
    distance: Array = distance_transform_edt(inside).astype(np.float32)
    return distance
