"""A leg ends where the pose does not say what the wheels do: led by such a pose the robot would never arrive."""

import math
from dataclasses import replace

import pytest
from robot_reports import REPORT

from hardware.motion_runs.driving import StoppedError, _check_way
from hardware.motion_runs.legs import TURNING, Leg
from hardware.pioneer import RobotReport

STRAIGHT, TURN = Leg("straight", 0.3), Leg("turn", -math.pi / 2, TURNING)


def after(*, travelled_m: float = 0.0, turned_rad: float = 0.0) -> RobotReport:
    return replace(REPORT, odometry=replace(REPORT.odometry, travelled_m=travelled_m, turned_rad=turned_rad))


@pytest.mark.parametrize(
    ("leg", "done", "report"),
    [
        (STRAIGHT, 0.29, after(travelled_m=0.31)),
        (STRAIGHT, -0.05, after(travelled_m=0.05)),
        (TURN, -1.5, after(turned_rad=1.55)),
    ],
)
def test_a_way_that_the_wheels_agree_with_goes_on(leg: Leg, done: float, report: RobotReport) -> None:
    _check_way(leg, done, REPORT, report)


@pytest.mark.parametrize(
    ("leg", "done", "report"),
    [
        (STRAIGHT, 0.1, after(travelled_m=0.51)),
        (STRAIGHT, -0.15, after(travelled_m=0.15)),
        (TURN, -0.5, after(turned_rad=math.radians(111))),
        (TURN, math.radians(11), after(turned_rad=math.radians(11))),
    ],
)
def test_one_that_they_do_not_agree_with_ends_the_leg(leg: Leg, done: float, report: RobotReport) -> None:
    with pytest.raises(StoppedError, match=r"odometry makes no sense: .* while the wheels went"):
        _check_way(leg, done, REPORT, report)
