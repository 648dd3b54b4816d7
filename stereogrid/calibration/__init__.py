"""Two cameras look at a chessboard: what they are (K, distortion) and how they stand to one another."""

from .chessboard import Chessboard, find_corners
from .rig import CalibrationErrors, StereoCalibration
from .solve import calibrate_corners, calibrate_stereo

__all__ = [
    "CalibrationErrors",
    "Chessboard",
    "StereoCalibration",
    "calibrate_corners",
    "calibrate_stereo",
    "find_corners",
]
