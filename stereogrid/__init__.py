"""stereogrid: how good a 3D probabilistic occupancy map can a robot make from two cheap cameras?

import stereogrid as sg

recording = sg.open_recording("drive.mcap")
matcher = sg.matcher("bm", num_disparities=64)
grid = sg.OccupancyGrid(cell_m=0.05)
for observation in recording:
    disparity = matcher.match(observation.left, observation.right)
    grid.integrate(recording.camera, disparity, observation.T_world_cam)
grid.probability(points_m)
sg.slice_figure(grid, height_m=0.4).savefig("slice.png")
"""

import os
from importlib import import_module

TYPE_CHECKING = False
"""For type checkers, who take it for typing's, which takes longer to import than all else before end_at_once()."""

if TYPE_CHECKING:
    from typing import Any

    from .camera import Rectification, StereoCamera
    from .config import MappingConfig
    from .errors import StereogridError
    from .exporting import export
    from .figures import cubes_figure, disparity_figure, slice_figure
    from .grid import OccupancyGrid, State
    from .mapper import Mapper
    from .matching import matcher
    from .motion import Growth, MotionError, MotionNoise, NoisyOdometry, OdometryNoise, PoseUncertainty
    from .observation import Disparity, Matcher, Observation, Odometry, Recording, Source, Truth
    from .recording import open_recording
    from .scoring.truth import MapTruth
    from .sensor_model import SensorModel

__version__ = "0.1.0"

__all__ = [
    "Disparity",
    "Growth",
    "MapTruth",
    "Mapper",
    "MappingConfig",
    "Matcher",
    "MotionError",
    "MotionNoise",
    "NoisyOdometry",
    "Observation",
    "OccupancyGrid",
    "Odometry",
    "OdometryNoise",
    "PoseUncertainty",
    "Recording",
    "Rectification",
    "SensorModel",
    "Source",
    "State",
    "StereoCamera",
    "StereogridError",
    "Truth",
    "cubes_figure",
    "disparity_figure",
    "export",
    "matcher",
    "open_recording",
    "slice_figure",
]

_HOMES = {
    "camera": ("Rectification", "StereoCamera"),
    "config": ("MappingConfig",),
    "errors": ("StereogridError",),
    "exporting": ("export",),
    "figures": ("cubes_figure", "disparity_figure", "slice_figure"),
    "grid": ("OccupancyGrid", "State"),
    "mapper": ("Mapper",),
    "matching": ("matcher",),
    "motion": ("Growth", "MotionError", "MotionNoise", "NoisyOdometry", "OdometryNoise", "PoseUncertainty"),
    "observation": ("Disparity", "Matcher", "Observation", "Odometry", "Recording", "Source", "Truth"),
    "recording": ("open_recording",),
    "scoring.truth": ("MapTruth",),
    "sensor_model": ("SensorModel",),
}


if not os.access(__path__[0], os.W_OK):  # nearly always it can be, and what takes long is not imported
    from .kernel_cache import find_place

    find_place()


def __getattr__(name: str) -> "Any":
    """Import a public name when it is first asked for (PEP 562): Numba and OpenCV together take seconds."""
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f".{home}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
