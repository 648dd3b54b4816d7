"""What the pictures of a map share: its occupied cells, and colours by height."""

import numpy as np

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray
from ..grid import OccupancyGrid

# The ends and the quarters of matplotlib's viridis: low is dark.
SHADES = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]])


def occupied_cells(grid: OccupancyGrid, threshold: float) -> tuple[Array, FloatArray]:
    """Cells (N, 3) int64 with p > threshold, and p (N,). Raises InvalidInputError where there is none."""
    if not 0 <= threshold < 1:
        raise InvalidInputError(f"threshold must be a probability below 1, not {threshold}")
    cells, p = grid.known_cells()
    kept = p > threshold
    if not kept.any():
        raise InvalidInputError(f"the map has no cell with p > {threshold:g} to be exported")
    return cells[kept], p[kept]


def point_cloud(grid: OccupancyGrid, threshold: float, fields: list[tuple[str, str]]) -> Array:
    """Records (N,) of the occupied cells: x, y, z of their centres [m] as float32, and fields, where probability is p
    and red, green, blue are colours by height."""
    cells, p = occupied_cells(grid, threshold)
    out = np.empty(len(cells), dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), *fields])
    centres_m = (cells + 0.5) * grid.cell_m
    values = {"probability": p} | dict(zip(("red", "green", "blue"), colours(centres_m[:, 2]).T, strict=True))
    out["x"], out["y"], out["z"] = centres_m.T
    for name, _ in fields:
        out[name] = values[name]
    return out


def colours(height_m: FloatArray) -> Array:
    """Colours (N, 3) uint8 of heights (N,), from the lowest to the highest of them."""
    share = (height_m - height_m.min()) / max(float(np.ptp(height_m)), 1e-9)
    at = np.linspace(0, 1, len(SHADES))
    return np.stack([np.interp(share, at, shade) for shade in SHADES.T], axis=-1).round().astype(np.uint8)
