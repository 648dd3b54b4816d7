"""Quality against time: one point for each method on each scene."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from .save import NotebookFigure

MARKERS = "os^DvPX*"
ROOM_FOR_FIVES = 2000.0
"""An axis that spans more has labels at powers of ten alone."""
Colour = tuple[float, float, float, float]


@dataclass(frozen=True)
class TradeoffPoint:
    """A method's quality on a scene and what it cost, in the figure's units; low and high: its interval, or NaN."""

    method: str
    scene: str
    cost: float
    quality: float
    low: float = np.nan
    high: float = np.nan


def tradeoff_figure(points: Sequence[TradeoffPoint], *, cost: str, quality: str, log_quality: bool = True) -> Figure:
    """Quality over cost, both named with their units: a marker shape a method, a colour a scene; cost on a log axis.

    log_quality: quality too, unless one is 0, which a log axis cannot show. Of several scenes, each one's points are
    joined in the order of their cost, so that it can be followed through the methods.
    """
    methods, scenes = (list(dict.fromkeys(getattr(p, kind) for p in points)) for kind in ("method", "scene"))
    markers = {method: MARKERS[n % len(MARKERS)] for n, method in enumerate(methods)}
    colours = {scene: colormaps["tab10"](n % 10) for n, scene in enumerate(scenes)}
    handles = [Line2D([], [], color="0.3", marker=markers[m], linestyle="", label=m) for m in methods]
    figure = NotebookFigure(figsize=(7.5, 4.8), layout="constrained")
    axes = figure.add_subplot(xlabel=cost, ylabel=quality)
    if len(scenes) > 1:
        for scene in scenes:
            _join(axes, [p for p in points if p.scene == scene], colours[scene])
        handles += [Line2D([], [], color=colours[s], linewidth=3, label=s) for s in scenes]
    for p in points:
        _mark(axes, p, markers[p.method], colours[p.scene])
    axes.set_xscale("log")
    _label_plainly(axes.xaxis)
    if log_quality and all(p.quality > 0 for p in points):
        axes.set_yscale("log")
        _label_plainly(axes.yaxis)
    axes.grid(alpha=0.25)
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=9)
    return figure


def _join(axes: Axes, points: Sequence[TradeoffPoint], colour: Colour) -> None:
    along = sorted(points, key=lambda p: p.cost)
    axes.plot([p.cost for p in along], [p.quality for p in along], color=colour, linewidth=0.8, alpha=0.4)


def _mark(axes: Axes, p: TradeoffPoint, marker: str, colour: Colour) -> None:
    error = [[p.quality - p.low], [p.high - p.quality]] if np.isfinite([p.low, p.high]).all() else None
    axes.errorbar(p.cost, p.quality, error, fmt=marker, color=colour, markersize=8, capsize=3, zorder=3)


def _label_plainly(axis: Axis) -> None:
    """Plain numbers at 1, 2 and 5 times the powers of ten of a logarithmic axis; at 1 alone where they would touch."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < ROOM_FOR_FIVES * low else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
