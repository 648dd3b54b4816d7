"""A smooth way over a plane: straight legs joined by arcs, its stations, and how far from it things are."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from stereogrid.geometry import FloatArray, as_floats

SAMPLE_M = 0.05


@dataclass(frozen=True)
class Route:
    """A polyline waypoints_m (N, 2) [m], asked for by station: the way gone from its start [m]."""

    waypoints_m: FloatArray

    @classmethod
    def rounded(cls, corners_m: ArrayLike, radius_m: float, *, arc_steps: int = 3) -> "Route":
        """The polyline through corners_m (K, 2) whose inner corners are cut by arcs of arc_steps chords each."""
        corners = as_floats(corners_m)
        points = [corners[0]]
        for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
            came = (corner - before) / np.linalg.norm(corner - before)
            goes = (after - corner) / np.linalg.norm(after - corner)
            turn = np.arctan2(came[0] * goes[1] - came[1] * goes[0], came @ goes)
            start = corner - came * radius_m * np.tan(abs(turn) / 2)
            left = np.array([-came[1], came[0]]) * np.sign(turn)
            for k in range(arc_steps + 1):
                angle = abs(turn) * k / arc_steps
                points.append(start + radius_m * (np.sin(angle) * came + (1 - np.cos(angle)) * left))
        return cls(np.array([*points, corners[-1]]))

    @cached_property
    def stations_m(self) -> FloatArray:
        """(N,): the station of each waypoint."""
        lengths = np.linalg.norm(np.diff(self.waypoints_m, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(lengths)])

    @property
    def length_m(self) -> float:
        """Length of the whole way [m]."""
        return float(self.stations_m[-1])

    def at(self, station_m: ArrayLike, lateral_m: ArrayLike = 0.0) -> FloatArray:
        """Points (..., 2) [m] beside the way, lateral_m to its left; on straight lines beyond its ends."""
        station = as_floats(station_m)
        k = np.clip(np.searchsorted(self.stations_m, station, side="right") - 1, 0, len(self.waypoints_m) - 2)
        ahead = self._ahead[k]
        left = np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)
        along = (station - self.stations_m[k])[..., None] * ahead
        points: FloatArray = self.waypoints_m[k] + along + as_floats(lateral_m)[..., None] * left
        return points

    def yaw_rad(self, station_m: float) -> float:
        """Heading at a station [rad]."""
        k = int(np.clip(np.searchsorted(self.stations_m, station_m, side="right") - 1, 0, len(self.waypoints_m) - 2))
        ahead = self._ahead[k]
        return float(np.arctan2(ahead[1], ahead[0]))

    def offset(self, lateral_m: float) -> FloatArray:
        """The waypoints (N, 2) of a line parallel to the way, lateral_m to its left, with mitred corners."""
        ahead = self._ahead
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        before, after = left[[0, *range(len(left))]], left[[*range(len(left)), -1]]
        middle = before + after
        shift: FloatArray = lateral_m * middle / (1 + (before * after).sum(axis=1, keepdims=True))
        return self.waypoints_m + shift

    @cached_property
    def samples_m(self) -> FloatArray:
        """(S, 2): points every SAMPLE_M of the way."""
        return self.at(np.arange(0.0, self.length_m + SAMPLE_M / 2, SAMPLE_M))

    def nearest(self, xy_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """How far points (..., 2) are from the way [m], and the station [m] of its nearest sample, both (...)."""
        distance, index = cKDTree(self.samples_m).query(as_floats(xy_m))
        return np.asarray(distance), np.asarray(index) * SAMPLE_M

    @cached_property
    def _ahead(self) -> FloatArray:
        """Unit directions (N - 1, 2) of the legs."""
        legs = np.diff(self.waypoints_m, axis=0)
        unit: FloatArray = legs / np.linalg.norm(legs, axis=1, keepdims=True)
        return unit
