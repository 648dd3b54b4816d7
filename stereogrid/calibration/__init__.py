"""Two cameras look at a chessboard: what they are (K, distortion) and how they stand to one another."""

from .calibration_file import CalibrationFile, CameraNames, load_calibration, save_calibration
from .chessboard import Chessboard, find_corners, find_corners_of_pair
from .mount import Mount
from .rectified import RectifiedRig, Rig
from .residuals import Residuals, far_pairs, residuals
from .rig import CalibrationErrors, StereoCalibration
from .solve import calibrate_corners, calibrate_stereo, calibrate_views, without_far_pairs
from .views import BoardViews, find_views

__all__ = [
    "BoardViews",
    "CalibrationErrors",
    "CalibrationFile",
    "CameraNames",
    "Chessboard",
    "Mount",
    "RectifiedRig",
    "Residuals",
    "Rig",
    "StereoCalibration",
    "calibrate_corners",
    "calibrate_stereo",
    "calibrate_views",
    "far_pairs",
    "find_corners",
    "find_corners_of_pair",
    "find_views",
    "load_calibration",
    "residuals",
    "save_calibration",
    "without_far_pairs",
]
