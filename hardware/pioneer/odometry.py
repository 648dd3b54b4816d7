"""From the robot's reports in raw units that wrap to metres and radians that do not."""

import math
from dataclasses import dataclass, field

import arcos
from stereogrid import geometry
from stereogrid.geometry import from_yaw
from stereogrid.observation import Odometry

from .limits import MM
from .robot import RobotReport
from .stamps import SteadyStamps

PLAY_RAW = 1.0
"""Counters may go to and fro by one without any motion."""


@dataclass
class Path:
    """The length of a path whose points jitter by PLAY_RAW: what moved further than that, as a pointer with play."""

    length: float = 0.0
    _x: float = 0.0
    _y: float = 0.0

    def go(self, dx: float, dy: float = 0.0) -> None:
        """The point moved."""
        # Kept relative to the point itself: the pointer trails behind it.
        self._x += dx
        self._y += dy
        behind = math.hypot(self._x, self._y)
        if behind > PLAY_RAW:
            self.length += behind - PLAY_RAW
            self._x *= PLAY_RAW / behind
            self._y *= PLAY_RAW / behind


@dataclass
class Tracker:
    """Follows one robot's reports. lost: how often so far its motion is not known.

    The first pose is the origin, whatever the robot's own counters say. Over a gap that could hide a whole turn of the
    position counter, or a new connection, the pose is kept as it was and `lost` goes up: where the robot went meanwhile
    is not guessed.
    """

    robot: arcos.Robot
    low_battery_v: float
    lost: int = 0
    _x_raw: float = 0.0
    _y_raw: float = 0.0
    _heading_raw: int = 0
    _off_raw: int = 0
    _driven: Path = field(default_factory=Path)
    _turned: Path = field(default_factory=Path)
    _last: tuple[arcos.Sip, float] | None = None
    _stamps: SteadyStamps = field(default_factory=SteadyStamps)

    def reconnected(self) -> None:
        """The same robot, whose counters may have started again."""
        self.lost += 1
        self._last = None

    def report(self, sip: arcos.Sip, arrived_s: float) -> RobotReport:
        """The report of a SIP that came at arrived_s."""
        if self._last is None:
            # Our heading less the robot's own: it may have begun to count elsewhere, or anew.
            self._off_raw = self._heading_raw - sip.heading_raw
        else:
            self._step(*self._last, sip, arrived_s)
        self._last = sip, arrived_s
        left_mps, right_mps = (MM * self.robot.velocity_mmps * raw for raw in (sip.left_mmps, sip.right_mmps))
        battery_v = 0.1 * sip.battery_dv
        return RobotReport(
            stamp_s=self._stamps.steady(arrived_s),
            odometry=self._odometry(),
            odometry_lost=self.lost,
            speed_mps=0.5 * (left_mps + right_mps),
            turn_radps=500 * (right_mps - left_mps) * self.robot.turn_per_difference,
            battery_v=battery_v,
            motors_on=sip.motors_on,
            e_stopped=sip.e_stopped,
            stalled=sip.stalled,
            front_bumpers=sip.front_bumpers,
            rear_bumpers=sip.rear_bumpers,
            sonar_m={sonar.number: MM * self.robot.range_mm * sonar.range_raw for sonar in sip.sonars},
            fault=obstacle(sip) or (f"battery {battery_v:.1f} V" if battery_v < self.low_battery_v else ""),
        )

    def _step(self, old: arcos.Sip, old_s: float, new: arcos.Sip, new_s: float) -> None:
        turn = arcos.heading_step(old.heading_raw, new.heading_raw)
        self._heading_raw += turn
        self._turned.go(turn)
        if self.robot.max_mmps * (new_s - old_s) >= arcos.position.POSITION_LIMIT * self.robot.distance_mm:
            self.lost += 1
            return
        dx, dy = arcos.position_step(old.x_raw, new.x_raw), arcos.position_step(old.y_raw, new.y_raw)
        # In our axes, which are turned against the robot's.
        off_rad = self._off_raw * self.robot.angle_rad
        self._x_raw += math.cos(off_rad) * dx - math.sin(off_rad) * dy
        self._y_raw += math.sin(off_rad) * dx + math.cos(off_rad) * dy
        self._driven.go(dx, dy)

    def _odometry(self) -> Odometry:
        unit_m = MM * self.robot.distance_mm
        return Odometry(
            from_yaw(self._heading_raw * self.robot.angle_rad, [self._x_raw * unit_m, self._y_raw * unit_m, 0.0]),
            travelled_m=self._driven.length * unit_m,
            turned_rad=self._turned.length * self.robot.angle_rad,
        )


def obstacle(sip: arcos.Sip) -> str:
    """What in a report stops the robot at once, "" for nothing."""
    if sip.e_stopped:
        return "e-stop"
    for end, bits in (("front", sip.front_bumpers), ("rear", sip.rear_bumpers)):
        if bits:
            return f"{end} bumper {', '.join(str(k + 1) for k in range(bits.bit_length()) if bits >> k & 1)}"
    left, right = sip.stalled
    if left or right:
        return "both wheels stall" if left and right else f"{'left' if left else 'right'} wheel stalls"
    return ""


def between(a: RobotReport, b: RobotReport, stamp_s: float) -> Odometry:
    """The odometry at a moment from a's stamp to b's, in even motion."""
    share = (stamp_s - a.stamp_s) / (b.stamp_s - a.stamp_s)
    return Odometry(
        geometry.between(a.odometry.T_odom_base, b.odometry.T_odom_base, share),
        travelled_m=a.odometry.travelled_m + share * (b.odometry.travelled_m - a.odometry.travelled_m),
        turned_rad=a.odometry.turned_rad + share * (b.odometry.turned_rad - a.odometry.turned_rad),
    )
