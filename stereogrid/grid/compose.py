"""Maps made of cells and of other maps, without an observation."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_floats
from .blocks import blocks_of

if TYPE_CHECKING:
    from .occupancy import OccupancyGrid

FARTHEST_CELL = 2**50
PIECE_BLOCKS = 4096


def fill(grid: "OccupancyGrid", cells: ArrayLike, log_odds: ArrayLike, n_updates: ArrayLike = 1) -> None:
    """Give cells (N, 3) of an empty grid the log-odds (N,), as if updated n_updates () or (N,) times.

    Log-odds are rounded to 1 / 256 nat and clamped. Raises InvalidInputError for a cell that occurs twice or a value
    that makes no sense, MapTooLargeError beyond the grid's memory limit.
    """
    indices, values, counts = _checked_cells(cells), _checked_values(log_odds), np.asarray(n_updates)
    if values.shape != (len(indices),):
        raise InvalidInputError(f"log_odds must be ({len(indices)},), one a cell, not {values.shape}")
    if counts.dtype.kind not in "iu" or counts.shape not in ((), values.shape) or (counts < 1).any():
        raise InvalidInputError("n_updates must be an integer of 1 or more, or one such for each cell")
    grid._check_growth(blocks_of(indices))
    grid.blocks.put(indices, grid.blocks.rule.pack(values, np.broadcast_to(counts, values.shape)))
    if grid.n_known != len(indices):
        raise InvalidInputError(f"{len(indices) - grid.n_known} of {len(indices)} cells occur more than once")


def _checked_cells(cells: ArrayLike) -> Array:
    """cells as (N, 3) int64."""
    indices = np.asarray(cells)
    if indices.size == 0:
        return np.zeros((0, 3), dtype=np.int64)
    if indices.dtype.kind not in "iu" or indices.ndim != 2 or indices.shape[1] != 3:
        raise InvalidInputError(f"cells must be integers (N, 3), not {indices.dtype} {indices.shape}")
    if indices.min() < -FARTHEST_CELL or indices.max() > FARTHEST_CELL:
        raise InvalidInputError(f"cells must lie within +-2^50, not {indices.min()} to {indices.max()}")
    return indices.astype(np.int64)


def _checked_values(log_odds: ArrayLike) -> FloatArray:
    values = as_floats(log_odds)
    if not (np.abs(values) <= 2.0**31).all():
        raise InvalidInputError("log_odds must be finite, within +-2^31")
    return values


def merge(grid: "OccupancyGrid", other: "OccupancyGrid") -> None:
    """Add to grid what other has seen. Raises InvalidInputError or MapTooLargeError and then leaves grid as it was."""
    for what, mine, theirs in (
        ("cells", f"{grid.cell_m} m", f"{other.cell_m} m"),
        ("prior", grid.model.prior, other.model.prior),
        ("clamp", grid.clamp, other.clamp),
        ("fusion", grid.fusion, other.fusion),
    ):
        if mine != theirs:
            raise InvalidInputError(f"maps of different {what} cannot be merged: {mine} and {theirs}")
    blocks, others = other.blocks.indices(), other.blocks.words
    grid._check_growth(blocks)
    rows = grid.blocks.rows(blocks)
    words = grid.blocks.words
    for start in range(0, len(rows), PIECE_BLOCKS):
        piece = rows[start : start + PIECE_BLOCKS]
        words[piece] = grid.blocks.rule.merged(words[piece], others[start : start + len(piece)])
