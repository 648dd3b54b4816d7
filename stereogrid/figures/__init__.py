"""Figures of maps and readings. Each function returns a matplotlib Figure; nothing opens a window."""

from .cubes import cubes_figure
from .pictures import disparity_figure
from .reliability import reliability_figure
from .save import figure_png, save_figure
from .slices import slice_figure

__all__ = [
    "cubes_figure",
    "disparity_figure",
    "figure_png",
    "reliability_figure",
    "save_figure",
    "slice_figure",
]
