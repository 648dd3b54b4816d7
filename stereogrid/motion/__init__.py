"""The robot's motion error: how it grows (eps of Eq. 13), what it does to each pose, and seeded noise like it.

And how it is fitted to repeated runs over marks.
"""

from .error import WAYS, Growth, MotionError
from .fit import FitOptions, FittedGrowth, MotionFit, fit_motion
from .legs import Measured
from .noise import MotionNoise, NoisyOdometry, OdometryNoise
from .runs import Run, Runs
from .runs_csv import append_readings, read_runs, write_runs
from .uncertainty import PoseUncertainty

__all__ = [
    "WAYS",
    "FitOptions",
    "FittedGrowth",
    "Growth",
    "Measured",
    "MotionError",
    "MotionFit",
    "MotionNoise",
    "NoisyOdometry",
    "OdometryNoise",
    "PoseUncertainty",
    "Run",
    "Runs",
    "append_readings",
    "fit_motion",
    "read_runs",
    "write_runs",
]
