"""The occupancy grid: sparse blocks of cells, updated by small Numba kernels."""

from .occupancy import FUSIONS, OccupancyGrid

__all__ = ["FUSIONS", "OccupancyGrid"]
