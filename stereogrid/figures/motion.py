"""The errors of repeated runs, and the motion error that was fitted to them."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import ndtri

from ..geometry import FloatArray
from ..motion import FittedGrowth, MotionFit, Runs
from ..motion.legs import EXACT, LegsOf
from .save import NotebookFigure

BAND = float(ndtri(0.975))
BLUE, ORANGE = "#1f4e9c", "#c8651b"


@dataclass(frozen=True)
class _Panel:
    """What a panel shows: whose legs, of what kind of runs, and times what they are in the units of its axes."""

    title: str
    kind: str
    legs: LegsOf
    over: str
    error: str
    to_over: float
    to_error: float


_PANELS = {
    "along": _Panel("along the way", "straight", EXACT.along, "distance [m]", "error [cm]", 1, 100),
    "across": _Panel(
        "across, without what the heading at the marks does",
        "straight",
        EXACT.across,
        "distance [m]",
        "error [cm]",
        1,
        100,
    ),
    "heading": _Panel(
        "heading, straight runs", "straight", EXACT.heading, "distance [m]", "error [deg]", 1, np.degrees(1)
    ),
    "turn": _Panel(
        "heading, turns on the spot", "turn", EXACT.turn, "angle turned [deg]", "error [deg]", *np.degrees([1, 1])
    ),
}


def motion_figure(runs: Runs, fit: MotionFit) -> Figure:
    """A panel for each part of the fit: odometry - truth of each run, the bias, and where 95 % of runs should be.

    The band is the bias +- 1.96 sigma; of a fit that keeps the bias, +- 1.96 sigma.
    """
    rows = (len(fit.parts) + 1) // 2
    columns = min(len(fit.parts), 2)
    figure = NotebookFigure(figsize=(5.2 * columns, 3.5 * rows + 0.5), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for each in axes.flat[len(fit.parts) :]:
        each.remove()
    for each, (name, part) in zip(axes.flat, fit.parts.items(), strict=False):
        # What is left across the way also shows how the heading wanders between the marks: see Measured.across.
        wander = fit.error.heading.a if name == "across" else 0.0
        _draw(each, _PANELS[name], runs, part, keeps_bias=fit.keeps_bias, wander=wander)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def _draw(axes: Axes, panel: _Panel, runs: Runs, part: FittedGrowth, *, keeps_bias: bool, wander: float) -> None:
    errors = [panel.legs(run)[:2] for run in runs.of_kind(panel.kind)]
    farthest = max(float(steps.sum()) for _, steps in errors)
    length = np.linspace(0, farthest, 200)
    leg = float(np.mean(np.concatenate([steps for _, steps in errors])))
    sigma = np.sqrt(np.square([part.growth.sigma(each) for each in length]) + wander * leg**2 * length / 12)
    bias = part.bias * length
    centre = np.zeros_like(bias) if keeps_bias else bias
    low, high = (panel.to_error * (centre + sign * BAND * sigma) for sign in (-1, 1))
    axes.fill_between(
        panel.to_over * length, low, high, color=ORANGE, alpha=0.18, linewidth=0, label="95 % of runs, fitted"
    )
    axes.plot(panel.to_over * length, panel.to_error * bias, "--", color=ORANGE, linewidth=1.5, label="bias")
    for number, (erred, steps) in enumerate(errors):
        label = "runs: odometry - truth" if number == 0 else None
        over, shown = panel.to_over * _summed(steps), panel.to_error * _summed(erred)
        axes.plot(over, shown, "o-", color=BLUE, markersize=3, linewidth=0.8, alpha=0.6, label=label)
    axes.axhline(0, color="0.5", linewidth=0.6, zorder=0)
    axes.set(xlabel=panel.over, ylabel=panel.error, xlim=(0, None))
    axes.set_title(f"{panel.title} ({part.n} runs)", fontsize=10)
    axes.grid(alpha=0.25)


def _summed(legs: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(legs)])
