"""A check that any recording allows: how far below the camera does the map's ground lie?"""

import numpy as np
from scipy.spatial import KDTree

from ..geometry import Array, FloatArray
from .map_scores import ScoredMap
from .score import Score

HALF_WIDTH_M = 2.0
"""Columns of cells so far from the camera's path count: about a lane."""
CLEARANCE_M = 0.2
"""Cells nearer than this below the camera are not ground."""
DEEPEST_M = 3.0


def camera_height(grid: ScoredMap, positions_m: FloatArray) -> Score:
    """Median height of the camera above the map's ground [m], over the columns of cells along its path.

    positions_m (M, 3): left camera in world. The ground of a column is the centre of its highest cell with
    p > .5 between CLEARANCE_M and DEEPEST_M below the camera. NaN where the map has none.
    """
    centres = grid.occupied_centres()
    cells = np.floor(centres / grid.cell_m).astype(np.int64)
    order = np.lexsort((cells[:, 2], cells[:, 1], cells[:, 0]))
    cells, centres = cells[order], centres[order]
    columns = KDTree(centres[:, :2])
    heights = [np.empty(0)]
    for at in positions_m:
        near = np.sort(np.array(columns.query_ball_point(at[:2], HALF_WIDTH_M), dtype=np.int64))
        heights.append(_heights_above(cells[near], at[2] - centres[near, 2]))
    all_heights = np.concatenate(heights)
    value = float(np.median(all_heights)) if len(all_heights) else np.nan
    return Score("camera_height_m", value, "m", len(all_heights))


def _heights_above(cells: Array, below_m: FloatArray) -> FloatArray:
    """Depth (C,) under the camera of the highest ground cell of each column; cells (N, 3) in lexical order."""
    ground = (below_m > CLEARANCE_M) & (below_m < DEEPEST_M)
    cells, below_m = cells[ground], below_m[ground]
    last_of_column = np.append((np.diff(cells[:, :2], axis=0) != 0).any(axis=1), True)[: len(cells)]
    heights: FloatArray = below_m[last_of_column]
    return heights
