"""The error budget as one figure: a row an error, and in it the two readings and the ladder."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .budget_arms import Step
from .budget_report import ERRORS, Budget, Error

MARKERS = "os^Dv"
WHOLE, PART = "0.45", "0.82"
"""Greys of a cause, and of what is a part of it."""


def budget_figure(budget: Budget, errors: Sequence[Error] = ERRORS) -> Figure:
    """Bars of what each cause gains or costs, with intervals over the seeds; marks of the worlds; and the ladder."""
    figure = Figure(figsize=(13.5, 3.6 * len(errors) + 0.6), layout="constrained")
    panels = figure.subplots(len(errors), 3, squeeze=False, width_ratios=[1.15, 1, 1])
    (gain, gains), (cost, costs) = budget.readings.items()
    for (left, middle, right), error in zip(panels, errors, strict=True):
        _bars(left, budget, gains, error)
        _bars(middle, budget, costs, error)
        _rungs(right, budget, error)
        left.set_xlabel(f"taken away: {error.label}")
        middle.set_xlabel(f"added: {error.label}")
        right.set_xlabel(error.label)
    panels[0, 0].set_title(f"What mending one cause gains\n({gain})", fontsize=11)
    panels[0, 1].set_title(f"What one cause costs\n({cost})", fontsize=11)
    panels[0, 2].set_title("Made true one after the other", fontsize=11)
    worlds = list(budget.by_world(gains[0], errors[0]))
    handles = [
        Line2D([], [], color="black", marker=m, markerfacecolor="white", linestyle="", label=world)
        for world, m in zip(worlds, MARKERS * len(worlds), strict=False)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(worlds), frameon=False, fontsize=10)
    return figure


def _bars(axes: Axes, budget: Budget, steps: Sequence[Step], error: Error) -> None:
    for row, step in enumerate(steps):
        gap = budget.gap(step, error)
        look = {"color": PART, "height": 0.45, "hatch": "///"} if step.part else {"color": WHOLE, "height": 0.75}
        axes.barh(row, gap.mean, edgecolor="0.3", linewidth=0.6, **look)
        if np.isfinite([gap.low, gap.high]).all():
            axes.plot([gap.low, gap.high], [row, row], color="black", linewidth=2)
        for marker, value in zip(MARKERS, budget.by_world(step, error).values(), strict=False):
            axes.plot(value, row, marker, color="black", markerfacecolor="white", markersize=4.5, zorder=3)
    axes.axvline(0, color="black", linewidth=0.8)
    axes.set_yticks(range(len(steps)), [f"   {s.what}" if s.part else s.what for s in steps])
    for label, step in zip(axes.get_yticklabels(), steps, strict=True):
        label.set(fontsize=8 if step.part else 10, style="italic" if step.part else "normal")
    axes.invert_yaxis()
    axes.grid(axis="x", alpha=0.3)


def _rungs(axes: Axes, budget: Budget, error: Error) -> None:
    rungs = budget.ladder
    means = [float(budget.error(arm, error).mean()) for _, arm in rungs]
    axes.barh(range(len(rungs)), means, color="0.65", edgecolor="0.3", linewidth=0.6, height=0.75)
    for row, mean in enumerate(means):
        axes.annotate(f"{mean:.3f}", (mean, row), (4, 0), textcoords="offset points", va="center", fontsize=9)
    axes.set_yticks(range(len(rungs)), [name for name, _ in rungs])
    axes.set_xlim(0, 1.18 * max(means))
    axes.invert_yaxis()
    axes.grid(axis="x", alpha=0.3)
