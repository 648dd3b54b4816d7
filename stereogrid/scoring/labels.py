"""The truth a map is scored against: each cell of a box is OCCUPIED, INTERIOR or FREE."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt

from ..errors import InvalidInputError, MapTooLargeError
from ..geometry import FloatArray
from .kernels import mark_met_cells
from .solids import inside_solids

if TYPE_CHECKING:
    import trimesh

FREE, OCCUPIED, INTERIOR = np.uint8(0), np.uint8(1), np.uint8(2)

TOUCH_CELLS = 1e-4
"""How near, in cells, a triangle must come to a cube to meet it.

Cubes are closed: a wall that lies exactly on a cell boundary occupies the layers on both its sides, always
and wherever it faces. A half-open rule would give a wall one layer or the other depending on which way it
faces, and float noise would pick among them at random; shrunken cubes would lose such a wall altogether. The
growth is larger than the rounding of float32 vertices (up to 100 m away at 5 cm cells) and far below a cell.
"""

BYTES_PER_CELL = 24
"""Peak memory of scoring: labels, visible set, and the distance to the surface while it is computed."""

MAX_BYTES = 4 << 30


@dataclass(frozen=True)
class CellLabels:
    """True labels of a box of cells in world.

    cell_m: side [m]. origin_index (3,) int64: index of the first cell; cell (i, j, k) of the box spans
    [(origin_index + (i, j, k)) * cell_m, ... + cell_m]. label (nx, ny, nz) uint8: FREE, OCCUPIED or INTERIOR.
    """

    cell_m: float
    origin_index: NDArray[np.int64]
    label: NDArray[np.uint8]

    @property
    def bounds_m(self) -> FloatArray:
        """(2, 3) lower and upper corner of the box in world [m]."""
        return np.stack([self.origin_index, self.origin_index + self.label.shape]) * self.cell_m

    @cached_property
    def distance_to_occupied_m(self) -> NDArray[np.float32]:
        """Distance (nx, ny, nz) of each centre to the nearest OCCUPIED centre [m], infinity where there is none.

        Exact between centres; from the surface itself it differs by half a cell's diagonal at most.
        """
        elsewhere = self.label != OCCUPIED
        if elsewhere.all():
            return np.full(self.label.shape, np.inf, dtype=np.float32)
        distance: NDArray[np.float32] = (distance_transform_edt(elsewhere) * self.cell_m).astype(np.float32)
        return distance

    def centres_m(self, mask: NDArray[np.bool_]) -> FloatArray:
        """Centres (N, 3) in world [m] of the cells where mask (nx, ny, nz) is True, in C order."""
        centres: FloatArray = (np.argwhere(mask) + self.origin_index + np.float64(0.5)) * self.cell_m
        return centres

    def index_of(self, points_m: FloatArray) -> NDArray[np.int64]:
        """Index (N, 3) into label of the cells that hold points (N, 3) [m]; may lie outside the box."""
        return np.floor(points_m / self.cell_m).astype(np.int64) - self.origin_index


def label_cells(
    mesh: "trimesh.Trimesh",
    cell_m: float,
    bounds_m: ArrayLike | None = None,
    *,
    max_bytes: int = MAX_BYTES,
) -> CellLabels:
    """Label the cells of bounds_m (2, 3) [m], by default the mesh's bounds and one cell around them.

    OCCUPIED: the closed cube meets a triangle (`TOUCH_CELLS` says what happens on a boundary). INTERIOR:
    the centre lies inside a closed solid (`inside_solids`) and the cell is not OCCUPIED. FREE: the rest.
    Bounds are widened to whole cells. Raises InvalidInputError when the mesh is empty or not finite, or the
    cell size or the bounds make no sense; MapTooLargeError, naming the need, when scoring the box would take
    more than max_bytes.
    """
    if not (np.isfinite(cell_m) and cell_m > 0):
        raise InvalidInputError(f"cell_m must be positive and finite, not {cell_m}")
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise InvalidInputError("the true mesh has no faces, or a vertex that is not finite")
    origin, shape = _box(mesh.bounds, cell_m, bounds_m)
    _check_memory(shape, cell_m, max_bytes)
    vertices = np.asarray(mesh.vertices, dtype=np.float64) / cell_m - origin
    faces = np.asarray(mesh.faces, dtype=np.int64)
    met = np.zeros(shape, dtype=np.bool_)
    mark_met_cells(vertices[faces], 0.5 + TOUCH_CELLS, met)
    label = np.where(inside_solids(vertices, faces, shape), INTERIOR, FREE)
    label[met] = OCCUPIED
    return CellLabels(float(cell_m), origin, label)


def _box(
    mesh_bounds_m: FloatArray, cell_m: float, bounds_m: ArrayLike | None
) -> tuple[NDArray[np.int64], tuple[int, int, int]]:
    """First index (3,) and shape of the smallest box of whole cells around the bounds."""
    bounds = np.asarray(mesh_bounds_m if bounds_m is None else bounds_m, dtype=np.float64)
    if bounds.shape != (2, 3) or not np.isfinite(bounds).all() or (bounds[0] > bounds[1]).any():
        raise InvalidInputError(f"bounds_m must be (2, 3) and finite, the lower corner first, not {bounds.tolist()}")
    # Bounds that are multiples of the cell size but for rounding must not gain a layer.
    margin = int(bounds_m is None)
    first = np.floor(bounds[0] / cell_m + TOUCH_CELLS).astype(np.int64) - margin
    last = np.ceil(bounds[1] / cell_m - TOUCH_CELLS).astype(np.int64) + margin
    nx, ny, nz = (int(n) for n in np.maximum(last - first, 1))
    return first, (nx, ny, nz)


def _check_memory(shape: tuple[int, int, int], cell_m: float, max_bytes: int) -> None:
    need = shape[0] * shape[1] * shape[2] * BYTES_PER_CELL
    if need > max_bytes:
        raise MapTooLargeError(
            f"scoring {shape[0]} x {shape[1]} x {shape[2]} cells of {cell_m:g} m needs "
            f"{need / 2**30:.1f} GiB, the limit is {max_bytes / 2**30:.1f} GiB; "
            "choose larger cells or smaller bounds"
        )
