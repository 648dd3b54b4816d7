"""Figures of maps and readings. Each function returns a matplotlib Figure; nothing opens a window."""

from .calibration import calibration_figure, rectified_figure
from .cubes import cubes_figure
from .motion import motion_figure
from .panels import panels_figure
from .pictures import disparity_figure
from .reliability import reliability_figure
from .save import figure_png, save_figure
from .slices import draw_slice, slice_figure, slices_figure
from .tradeoff import TradeoffPoint, tradeoff_figure
from .trajectory import trajectory_figure

__all__ = [
    "TradeoffPoint",
    "calibration_figure",
    "cubes_figure",
    "disparity_figure",
    "draw_slice",
    "figure_png",
    "motion_figure",
    "panels_figure",
    "rectified_figure",
    "reliability_figure",
    "save_figure",
    "slice_figure",
    "slices_figure",
    "tradeoff_figure",
    "trajectory_figure",
]
