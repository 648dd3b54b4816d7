"""The occupancy grid: sparse blocks of cells, updated by small Numba kernels."""

from .cells import DEFAULT_CLAMP, OCTOMAP_CLAMP
from .fusion import FUSIONS
from .occupancy import OccupancyGrid
from .states import State

__all__ = ["DEFAULT_CLAMP", "FUSIONS", "OCTOMAP_CLAMP", "OccupancyGrid", "State"]
