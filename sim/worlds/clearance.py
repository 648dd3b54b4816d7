"""How far places on the ground are from what stands there: a map of distances, for planning ways through a world."""

import cv2
import numpy as np
from numpy.typing import ArrayLike

from stereogrid.geometry import FloatArray, as_floats

from ..scene.scene import World
from ..scene.solids import Solid

PITCH_M = 0.04
BAND_M = (0.05, 1.95)
"""Heights above the ground at which things are in somebody's way."""
MARGIN_M = 8.0
"""The map reaches this far beyond the robot's path; further out nothing is free."""


class Clearance:
    """Distances on the ground of a world from its static solids, where one can get to from the robot's start."""

    def __init__(self, world: World, band_m: tuple[float, float] = BAND_M) -> None:
        self._low_m = world.waypoints_m.min(axis=0) - MARGIN_M
        size = np.ceil((world.waypoints_m.max(axis=0) + MARGIN_M - self._low_m) / PITCH_M).astype(int)
        free = np.full((size[1], size[0]), 255, np.uint8)
        free[0], free[-1], free[:, 0], free[:, -1] = 0, 0, 0, 0
        for solid in world.solids:
            if _in_the_way(solid, world, band_m):
                cells = (solid.vertices_m[:, :2] - self._low_m) / PITCH_M
                # Beyond the map all is the same, and OpenCV's numbers are short.
                cells = np.clip(cells, -100, size + 100)
                cv2.fillConvexPoly(free, cv2.convexHull((cells * 16).round().astype(np.int32)), 0, shift=4)
        column, row = np.round((world.waypoints_m[0] - self._low_m) / PITCH_M).astype(int)
        # Rooms that cannot be walked to count as full.
        _, parts = cv2.connectedComponents(free, connectivity=4)
        free[parts != parts[row, column]] = 0
        self._distance_m = PITCH_M * cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)

    def at(self, xy_m: ArrayLike) -> FloatArray:
        """Distance (...) of points (..., 2) from the nearest obstacle [m], within PITCH_M; 0 where one cannot get."""
        cells = np.round((as_floats(xy_m) - self._low_m) / PITCH_M).astype(int)
        limit = np.array(self._distance_m.shape[::-1]) - 1
        inside = ((cells >= 0) & (cells <= limit)).all(axis=-1)
        column, row = np.moveaxis(np.clip(cells, 0, limit), -1, 0)
        distance: FloatArray = np.where(inside, self._distance_m[row, column], 0.0)
        return distance


def _in_the_way(solid: Solid, world: World, band_m: tuple[float, float]) -> bool:
    """Whether a solid reaches into the band of heights; the ground itself does not count."""
    if solid.seen_from_above:
        return False
    low, high = solid.vertices_m.min(axis=0), solid.vertices_m.max(axis=0)
    ground_m = float(world.ground_height_m((low[:2] + high[:2]) / 2))
    return bool(low[2] - ground_m < band_m[1] and high[2] - ground_m > band_m[0])
