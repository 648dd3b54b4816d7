"""Whether the robot gets on along its path."""

from dataclasses import dataclass

from .follower import PathFollower
from .pioneer import Pioneer, SimulationError

PATIENCE_S, LEAST_M = 6.0, 0.02
"""A robot that gains less than this much of its path in this time is stuck."""


@dataclass
class Headway:
    """Watches a robot on its path; check after every move."""

    _progress_m: float = 0.0
    _since_s: float = 0.0

    def check(self, robot: Pioneer, follower: PathFollower) -> None:
        """Raises SimulationError when the robot is stuck."""
        if follower.progress_m > self._progress_m + LEAST_M:
            self._progress_m, self._since_s = follower.progress_m, robot.time_s
        elif robot.time_s - self._since_s > PATIENCE_S:
            x, y = robot.T_world_base[:2, 3]
            raise SimulationError(f"the robot is stuck at x = {x:.2f} m, y = {y:.2f} m after {robot.time_s:.1f} s")
