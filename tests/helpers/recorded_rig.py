"""Pairs and reports as cameras and robot would send them, for what records them."""

from typing import Any

import numpy as np

from hardware.cameras.pairs import RawPair
from hardware.pioneer.robot import RobotReport
from stereogrid.calibration import RectifiedRig
from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.observation import Odometry

CAMERA = StereoCamera(focal_px=170, cx_px=79.5, cy_px=59.5, baseline_m=0.06, width_px=160, height_px=120)
RIG = RectifiedRig(CAMERA, from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4]))
FPS, REPORTS_HZ = 30, 10


def pair(k: int, skew_s: float = 0.004) -> RawPair:
    """Pair k of a noisy scene, whose first pixel says which it is."""
    left, right = np.random.default_rng(k % 7).integers(0, 256, (2, *CAMERA.shape), dtype=np.uint8)
    left[0, 0] = k % 256
    stamp_s = 100.01 + k / FPS
    return RawPair(left, right, stamp_s, stamp_s + skew_s)


def report(k: int, **changed: Any) -> RobotReport:
    """Report k of a robot that drives straight ahead."""
    said = {
        "stamp_s": 100 + k / REPORTS_HZ,
        "odometry": Odometry(from_yaw(0.0, [0.02 * k, 0, 0]), 0.02 * k),
        "odometry_lost": 0,
        "speed_mps": 0.2,
        "turn_radps": 0.0,
        "battery_v": 12.7,
        "motors_on": True,
        "e_stopped": False,
        "stalled": (False, False),
        "front_bumpers": 0,
        "rear_bumpers": 0,
        "sonar_m": {k % 8: 1.0 + k % 8},
        "fault": "",
    }
    return RobotReport(**{**said, **changed})
