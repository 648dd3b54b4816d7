"""Wheel odometry: where the robot believes it is, from how far its wheels turned."""

from dataclasses import dataclass, field

import numpy as np

from stereogrid.geometry import FloatArray, from_yaw
from stereogrid.observation import Odometry

WHEEL_RADIUS_M = 0.110
EFFECTIVE_TRACK_M = 0.588
"""The P3-AT's published track for turning; its wheels are 0.398 m apart, but skidding costs a third of the turn."""


@dataclass
class WheelOdometry:
    """Integrates wheel turns from the identity: the frame odom is where the robot started."""

    T_odom_base: FloatArray = field(default_factory=lambda: np.eye(4))
    travelled_m: float = 0.0
    turned_rad: float = 0.0

    def update(self, left_rad: float, right_rad: float) -> None:
        """Advance by the turns of the left and the right wheels since the last update, along an arc."""
        left_m, right_m = WHEEL_RADIUS_M * left_rad, WHEEL_RADIUS_M * right_rad
        ahead_m, turn_rad = 0.5 * (left_m + right_m), (right_m - left_m) / EFFECTIVE_TRACK_M
        # The chord of an arc: sinc(0) = 1 makes the straight line no special case.
        chord_m = ahead_m * np.sinc(turn_rad / (2 * np.pi))
        half = turn_rad / 2
        self.T_odom_base = self.T_odom_base @ from_yaw(turn_rad, [chord_m * np.cos(half), chord_m * np.sin(half), 0.0])
        self.travelled_m += abs(ahead_m)
        self.turned_rad += abs(turn_rad)

    def reading(self) -> Odometry:
        """The present belief."""
        return Odometry(self.T_odom_base, self.travelled_m, self.turned_rad)
