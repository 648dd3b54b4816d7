"""A robot without physics, for tests of its firmware: it does at once what its wheels are told, unless it is held."""

from dataclasses import dataclass, field

import numpy as np

from sim.robot.odometry import EFFECTIVE_TRACK_M, WHEEL_RADIUS_M, WheelOdometry
from stereogrid.geometry import FloatArray

TICK_S = 1 / 30


@dataclass
class KinematicBody:
    """held: it cannot move, and its motors stall when told to. bumpers: set by the test. coasting: motors are off."""

    battery_v: float = 12.9
    held: bool = False
    bumpers: tuple[int, int] = (0, 0)
    stalled: tuple[bool, bool] = (False, False)
    coasting: bool = True
    time_s: float = 0.0
    odometry: WheelOdometry = field(default_factory=WheelOdometry)
    wheel_speeds_mps: FloatArray = field(default_factory=lambda: np.zeros(2))

    @property
    def T_world_base(self) -> FloatArray:
        return self.odometry.T_odom_base

    @T_world_base.setter
    def T_world_base(self, pose: FloatArray) -> None:
        self.odometry.T_odom_base = pose

    def sonar_m(self) -> FloatArray:
        return np.linspace(0.1, 5.0, 16)

    def drive(self, speed_mps: float, turn_radps: float) -> None:
        half = turn_radps * EFFECTIVE_TRACK_M / 2
        asked = np.array([speed_mps - half, speed_mps + half])
        self.stalled = (bool(self.held and asked[0]), bool(self.held and asked[1]))
        self._tick(np.zeros(2) if self.held else asked)
        self.coasting = False

    def coast(self) -> None:
        self.stalled = (False, False)
        self._tick(np.zeros(2))
        self.coasting = True

    def _tick(self, speeds_mps: FloatArray) -> None:
        self.wheel_speeds_mps = speeds_mps
        self.odometry.update(*(speeds_mps * TICK_S / WHEEL_RADIUS_M))
        self.time_s += TICK_S
