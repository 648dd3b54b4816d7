"""SIPs and reports of a robot that stands still with its motors on, unless told else."""

from dataclasses import replace
from typing import Any

import numpy as np

from arcos import Sip
from hardware.pioneer import RobotReport
from stereogrid.observation import Odometry

SIP = Sip(
    moving=False,
    x_raw=0,
    y_raw=0,
    heading_raw=0,
    left_mmps=0,
    right_mmps=0,
    battery_dv=129,
    stall_bumpers=0,
    control_raw=0,
    flags=1,
    compass_raw=0,
    sonars=(),
)
REPORT = RobotReport(
    stamp_s=0.0,
    odometry=Odometry(np.eye(4)),
    odometry_lost=0,
    speed_mps=0.0,
    turn_radps=0.0,
    battery_v=12.9,
    motors_on=True,
    e_stopped=False,
    stalled=(False, False),
    front_bumpers=0,
    rear_bumpers=0,
    sonar_m={},
)


def sip(**changes: Any) -> Sip:
    return replace(SIP, **changes)


def report(**changes: Any) -> RobotReport:
    return replace(REPORT, **changes)
