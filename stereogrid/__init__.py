"""stereogrid: how good a 3D probabilistic occupancy map can a robot make from two cheap cameras?

import stereogrid as sg

recording = sg.open_recording("drive.mcap")
matcher = sg.matcher("bm", num_disparities=64)
grid = sg.OccupancyGrid(cell_m=0.05)
for observation in recording:
    disparity = matcher.match(observation.left, observation.right)
    grid.integrate(recording.camera, disparity, observation.T_world_cam)
grid.probability(points_m)
"""

from .camera import Rectification, StereoCamera
from .config import MappingConfig
from .errors import StereogridError
from .grid import OccupancyGrid
from .mapper import Mapper
from .matching import matcher
from .motion import MotionError, NoisyOdometry, OdometryNoise
from .observation import Disparity, Matcher, Observation, Odometry, Recording, Source, Truth
from .recording import open_recording
from .sensor_model import SensorModel

__version__ = "0.1.0"

__all__ = [
    "Disparity",
    "Mapper",
    "MappingConfig",
    "Matcher",
    "MotionError",
    "NoisyOdometry",
    "Observation",
    "OccupancyGrid",
    "Odometry",
    "OdometryNoise",
    "Recording",
    "Rectification",
    "SensorModel",
    "Source",
    "StereoCamera",
    "StereogridError",
    "Truth",
    "matcher",
    "open_recording",
]
