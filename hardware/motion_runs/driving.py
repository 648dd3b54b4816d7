"""One leg of a run, driven by a robot: it ends at its end, by a key, by a fault or when it takes too long."""

import math
import time
from collections.abc import Callable
from contextlib import suppress

from stereogrid.geometry import yaw_rad

from ..clock import now_s
from ..errors import RobotError
from ..pioneer.robot import RobotDriver, RobotReport
from .legs import Leg, Steering

STEP_S = 0.05
"""Between two commands: a key is seen in this time."""
SETTLE_S = 5.0
STILL_MPS, STILL_RADPS = 0.003, math.radians(0.3)
BEYOND = {"straight": 0.2, "turn": math.radians(20)}
"""The wheels never go further than the leg and this [m or rad], nor back by half of it: odometry must be wrong then."""
LATE_S = 1.0
"""Reports that are older than this are none; the driver has stopped the robot by then."""

Pressed = Callable[[float], bool]
"""Waits for a key for so many seconds; whether one was pressed."""


class StoppedError(RobotError):
    """A leg did not come to its end; the robot stands, its motors are off."""


def drive_leg(
    robot: RobotDriver, leg: Leg, pressed: Pressed, progress: Callable[[float], None] = lambda _: None
) -> RobotReport:
    """Arm, drive the leg, stop, motors off; the first report of the robot at rest behind it.

    pressed: any key stops; progress: is told how much is done [m or rad]. Raises StoppedError with the reason.
    """
    try:
        robot.arm()
        _drive(robot, leg, pressed, progress)
        robot.stop()
        return at_rest(robot)
    finally:
        # Whatever happened, Ctrl-C too; that a robot which is gone cannot be told is no news.
        with suppress(RobotError):
            robot.disarm()


def _drive(robot: RobotDriver, leg: Leg, pressed: Pressed, progress: Callable[[float], None]) -> None:
    start = newest(robot)
    steering = Steering(leg, start.odometry.T_odom_base)
    end_s = now_s() + 1.3 * leg.takes_s + 5.0
    while True:
        report = newest(robot)
        if report.odometry_lost != start.odometry_lost:
            raise StoppedError("reports were missing, so odometry does not know where the robot is")
        velocity = steering.velocity(report.odometry.T_odom_base, STEP_S)
        _check_way(leg, steering.done, start, report)
        progress(steering.done)
        if velocity is None:
            return
        if now_s() > end_s:
            raise StoppedError(f"it takes too long: only {leg.describe(steering.done)}; do the wheels turn freely?")
        _ask(robot, *velocity)
        if pressed(STEP_S):
            raise StoppedError(f"stopped by a key, {leg.describe(steering.done)}")


def _check_way(leg: Leg, done: float, start: RobotReport, report: RobotReport) -> None:
    """Raise StoppedError where the pose does not say what the wheels do: the one led by it would never arrive."""
    one, other = start.odometry, report.odometry
    way = other.turned_rad - one.turned_rad if leg.is_turn else other.travelled_m - one.travelled_m
    back = -math.copysign(1.0, leg.amount) * done
    if way > abs(leg.amount) + BEYOND[leg.kind] or back > 0.5 * BEYOND[leg.kind]:
        raise StoppedError(f"odometry makes no sense: {leg.describe(done)}, while the wheels went {leg.describe(way)}")


def _ask(robot: RobotDriver, speed_mps: float, turn_radps: float) -> None:
    try:
        robot.drive(speed_mps, turn_radps)
    except RobotError as error:
        raise StoppedError(str(error)) from error


def newest(robot: RobotDriver) -> RobotReport:
    """The robot's newest report, waited for where it is old. Raises StoppedError where none comes."""
    end_s = now_s() + LATE_S
    while True:
        report = robot.latest()
        if report is not None and now_s() - report.stamp_s <= LATE_S:
            return report
        if now_s() > end_s:
            raise StoppedError("the robot sends no reports")
        time.sleep(STEP_S)


def at_rest(robot: RobotDriver) -> RobotReport:
    """Wait until the robot stands still; the report that says so. Raises StoppedError where it does not."""
    reports = robot.subscribe(1)
    before: RobotReport | None = None
    try:
        end_s = now_s() + SETTLE_S
        while now_s() < end_s:
            report = reports.newest(LATE_S)
            if report is None:
                raise StoppedError("the robot sends no reports")
            if before is not None and _still(before, report):
                return report
            before = report
    finally:
        reports.close()
    raise StoppedError("the robot does not come to rest: is the floor level?")


def _still(before: RobotReport, report: RobotReport) -> bool:
    slow = abs(report.speed_mps) < STILL_MPS and abs(report.turn_radps) < STILL_RADPS
    return slow and not moved(before, report)


def moved(before: RobotReport, report: RobotReport, *, by_m: float = 0.002, by_rad: float = math.radians(0.2)) -> bool:
    """Whether the robot stands elsewhere in a later report, or may: odometry that was lost in between does not tell."""
    one, other = before.odometry.T_odom_base, report.odometry.T_odom_base
    turned_rad = abs(math.remainder(yaw_rad(other) - yaw_rad(one), 2 * math.pi))
    away_m = math.dist(one[:3, 3], other[:3, 3])
    return report.odometry_lost != before.odometry_lost or away_m > by_m or turned_rad > by_rad
