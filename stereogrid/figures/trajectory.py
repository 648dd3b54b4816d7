"""The camera's way: seen from above, its height over the way, and how far it is from the true one."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..errors import InvalidInputError
from ..geometry import FloatArray
from .colours import PATH_COLOUR, TRUTH_COLOUR
from .save import NotebookFigure

FLATTEST_M = 0.2
"""A height axis shows this much at least: millimetres of a level floor are no mountains."""


def trajectory_figure(path_m: FloatArray, *, true_path_m: FloatArray | None = None, title: str = "") -> Figure:
    """Positions (M, 3) in world [m] that the recording claims, beside the true ones (M, 3), NaN where unknown.

    Raises InvalidInputError for fewer than two positions: nothing moved.
    """
    if len(path_m) < 2:
        raise InvalidInputError("one position is no way")
    true = true_path_m if true_path_m is not None and not np.isnan(true_path_m).all() else None
    figure = NotebookFigure(figsize=(9, 6.6 if true is None else 8.4), layout="constrained")
    if true is None:
        above, height = figure.subplots(2, 1, height_ratios=[2.4, 1])
    else:
        above, height, error = figure.subplots(3, 1, height_ratios=[2.4, 1, 1])
        height.sharex(error)
        _draw_error(error, path_m, true)
    _draw_above(above, path_m, true)
    above.set_title(title or f"the camera's way, {_way_m(path_m)[-1]:.2f} m")
    _draw_height(height, path_m, true)
    if true is not None:
        height.set_xlabel("")
    handles, _ = above.get_legend_handles_labels()
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)
    for axes in figure.axes:
        axes.grid(alpha=0.25)
    return figure


def _draw_above(axes: Axes, path_m: FloatArray, true: FloatArray | None) -> None:
    if true is not None:
        axes.plot(true[:, 0], true[:, 1], color=TRUTH_COLOUR, linewidth=3.2, alpha=0.6, label="true")
    axes.plot(path_m[:, 0], path_m[:, 1], color=PATH_COLOUR, linewidth=1.4, label="claimed")
    for at, marker, label in ((path_m[0], "o", "start"), (path_m[-1], "s", "end")):
        axes.plot(*at[:2], marker, color="black", markerfacecolor="white", markersize=6, label=label, linestyle="none")
    axes.set(xlabel="x (world) [m]", ylabel="y (world) [m]", aspect="equal")
    # A straight way is to have some width, too.
    axes.set_adjustable("datalim")


def _draw_height(axes: Axes, path_m: FloatArray, true: FloatArray | None) -> None:
    way_m = _way_m(path_m)
    if true is not None:
        axes.plot(way_m, true[:, 2], color=TRUTH_COLOUR, linewidth=3.2, alpha=0.6)
    axes.plot(way_m, path_m[:, 2], color=PATH_COLOUR, linewidth=1.4)
    low, high = axes.get_ylim()
    spare = max(0.0, FLATTEST_M - (high - low)) / 2
    axes.set(ylim=(low - spare, high + spare), xlabel="way [m]", ylabel="z (world) [m]")


def _draw_error(axes: Axes, path_m: FloatArray, true: FloatArray) -> None:
    off_m = np.linalg.norm(path_m - true, axis=1)
    axes.plot(_way_m(path_m), off_m, color="black", linewidth=1.2)
    axes.set(xlabel="way [m]", ylabel="claimed - true [m]")
    axes.set_ylim(0, max(1.1 * float(np.nanmax(off_m)), 0.01))


def _way_m(path_m: FloatArray) -> FloatArray:
    """How far the camera has come at each position (M,) [m]."""
    steps = np.linalg.norm(np.diff(path_m, axis=0), axis=1)
    way: FloatArray = np.concatenate([[0.0], np.cumsum(steps)])
    return way
