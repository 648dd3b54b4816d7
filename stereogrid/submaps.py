"""A drive mapped piece by piece: each piece as if its poses were exact, then laid into the map wherever it may lie."""

from dataclasses import dataclass, field

import numpy as np

from .camera import StereoCamera
from .geometry import FloatArray
from .grid import OccupancyGrid
from .motion import MotionError, PoseUncertainty
from .observation import Disparity, Observation

PLANAR = np.ix_([0, 1, 5], [0, 1, 5])
"""x, y and heading of a pose's covariance (6, 6)."""


@dataclass
class _Piece:
    """What was seen since the last piece ended: the map; and of each pose its covariance (6, 6) and place (2,) [m]."""

    grid: OccupancyGrid
    covariances: list[FloatArray] = field(default_factory=list)
    places_m: list[FloatArray] = field(default_factory=list)
    began_m: float = 0.0


class Submaps:
    """Fuses the observations of one drive, in their order, into a grid.

    Odometry errs little within a piece of a few metres, and by the same amount for all that is seen there; so the piece
    keeps its shape, and its place is as uncertain as the pose in its middle. Fusing each observation with its own share
    of that error would take for independent what is one error, and grow sure of a place that nobody knows.
    """

    def __init__(self, camera: StereoCamera, grid: OccupancyGrid, error: MotionError) -> None:
        self._camera, self._grid, self._error = camera, grid, error
        self._uncertainty = PoseUncertainty(error)
        self._piece = _Piece(grid.emptied())
        self._last_m = 0.0

    def fuse(self, observation: Observation, disparity: Disparity, weight: float) -> None:
        """Fuse one observation; where it begins a new piece, the one before is laid into the grid first."""
        travelled_m, piece = observation.odometry.travelled_m, self._piece
        known_again = travelled_m < self._last_m
        if piece.places_m and (known_again or travelled_m - piece.began_m >= self._error.submap_m):
            self.finish()
            piece = self._piece
        if not piece.places_m:
            piece.began_m = travelled_m
        self._last_m = travelled_m
        piece.grid.integrate(self._camera, disparity, observation.T_world_cam, weight=weight)
        piece.covariances.append(self._uncertainty.step(observation))
        piece.places_m.append(observation.T_world_cam[:2, 3])

    def finish(self) -> None:
        """Lay what is still open into the grid."""
        piece = self._piece
        if piece.places_m:
            middle = len(piece.places_m) // 2
            self._grid.merge(piece.grid.spread(piece.covariances[middle][PLANAR], piece.places_m[middle]))
            self._piece = _Piece(self._grid.emptied())
