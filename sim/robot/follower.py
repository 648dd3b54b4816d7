"""Keeping to a path: pure pursuit with gentle starts and stops."""

from dataclasses import dataclass

import numpy as np

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, yaw_rad

from ..scene.route import Route

MAX_SPEED_MPS = 0.7
MAX_TURN_RADPS = 0.8
ACCELERATION_MPS2 = 0.4
TURN_ACCELERATION_RADPS2 = 1.5
LOOKAHEAD_M = 0.5
ARRIVED_M = 0.03


@dataclass
class PathFollower:
    """Drives along waypoints_m (N, 2) at speed_mps, up to end_m of the path's length (all of it by default)."""

    waypoints_m: FloatArray
    speed_mps: float = 0.4
    end_m: float | None = None

    def __post_init__(self) -> None:
        if not 0 < self.speed_mps <= MAX_SPEED_MPS:
            raise InvalidInputError(f"speed_mps must be in (0, {MAX_SPEED_MPS}], not {self.speed_mps}")
        self._route = Route(self.waypoints_m)
        self.length_m = self._route.length_m if self.end_m is None else min(self.end_m, self._route.length_m)
        self.progress_m = 0.0
        self._speed_mps = 0.0
        self._turn_radps = 0.0

    @property
    def arrived(self) -> bool:
        """Whether the end of the path is reached."""
        return self.progress_m >= self.length_m - ARRIVED_M

    def command(self, T_world_base: FloatArray, dt_s: float) -> tuple[float, float]:
        """Forward speed [m/s] and turn rate [rad/s] for the next dt_s."""
        here = T_world_base[:2, 3]
        self._advance(here)
        goal = self._route.at(self.progress_m + LOOKAHEAD_M) - here
        distance_m = float(np.hypot(*goal))
        bearing = float(np.arctan2(goal[1], goal[0])) - yaw_rad(T_world_base)
        bearing = float(np.arctan2(np.sin(bearing), np.cos(bearing)))
        left_m = max(self.length_m - self.progress_m, 0.01)
        speed = min(self.speed_mps, float(np.sqrt(2 * ACCELERATION_MPS2 * left_m)))
        speed *= max(0.2, np.cos(bearing)) if abs(bearing) < np.pi / 2 else 0.0
        curvature = 2 * np.sin(bearing) / max(distance_m, 0.1)
        turn = speed * curvature if speed > 0 else np.copysign(MAX_TURN_RADPS, bearing)
        turn = float(np.clip(turn, -MAX_TURN_RADPS, MAX_TURN_RADPS))
        self._speed_mps += float(np.clip(speed - self._speed_mps, *_limits(ACCELERATION_MPS2 * dt_s)))
        self._turn_radps += float(np.clip(turn - self._turn_radps, *_limits(TURN_ACCELERATION_RADPS2 * dt_s)))
        return self._speed_mps, self._turn_radps

    def _advance(self, here: FloatArray) -> None:
        """Move the progress to the nearest point of the path a little ahead; it never goes back."""
        k, stations_m = self._segment(self.progress_m), self._route.stations_m
        start, end = self.waypoints_m[k], self.waypoints_m[k + 1]
        along = (here - start) @ (end - start) / np.linalg.norm(end - start)
        # At a corner the next leg takes over once it is the nearer one.
        station = stations_m[k] + min(along, stations_m[k + 1] - stations_m[k])
        if k + 2 < len(self.waypoints_m):
            after = self.waypoints_m[k + 2] - end
            beyond = (here - end) @ after / np.linalg.norm(after)
            if beyond > stations_m[k + 1] - station:
                station = stations_m[k + 1] + beyond
        self.progress_m = max(self.progress_m, float(station))

    def _segment(self, station_m: float) -> int:
        return int(np.clip(np.searchsorted(self._route.stations_m, station_m) - 1, 0, len(self._route.stations_m) - 2))


def _limits(size: float) -> tuple[float, float]:
    return -size, size
