"""The figures of the experiment on the motion error."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from stereogrid.motion import MotionFit
from stereogrid.motion.parameters import UNITS, Parameter

COLOURS = ("#8a8a8a", "#1f4e9c", "#c8651b", "#2b8a57", "#7a3b9c")
MISSED = "#d7301f"
SHOWN = {"along": (100, "cm"), "across": (100, "cm"), "heading": (np.degrees(1), "deg"), "turn": (np.degrees(1), "deg")}


def surfaces_figure(fits: Sequence[tuple[str, str, MotionFit]]) -> Figure:
    """A panel a part: sigma after a run's length on each surface, a colour for each preset of faults; crosses: |bias|.

    fits: surface, faults and fit of each.
    """
    surfaces, faults = (list(dict.fromkeys(each[k] for each in fits)) for k in (0, 1))
    figure = Figure(figsize=(11, 7), layout="constrained")
    for axes, part in zip(figure.subplots(2, 2).flat, UNITS, strict=True):
        times, unit = SHOWN[part]
        for surface, name, fit in fits:
            found, k = fit.parts[part], faults.index(name)
            x = surfaces.index(surface) + 0.22 * (k - (len(faults) - 1) / 2)
            sigma, (low, high) = times * found.sigma, (times * bound for bound in found.sigma_bounds)
            # The estimate may lie a hair outside of bounds that were corrected for bias.
            error = [[max(sigma - low, 0)], [max(high - sigma, 0)]]
            label = f"{name}: sigma" if surface == surfaces[0] else None
            axes.errorbar(x, sigma, error, fmt="o", color=COLOURS[k % 5], markersize=4, capsize=2, label=label)
            label = f"{name}: |bias|" if surface == surfaces[0] else None
            axes.plot(x, times * abs(found.bias) * found.reached, "x", color=COLOURS[k % 5], markersize=5, label=label)
        after = "a full turn" if part == "turn" else "5 m"
        axes.set_title(f"{part}, after {after}", fontsize=10)
        axes.set_xticks(range(len(surfaces)), surfaces, rotation=35, ha="right", fontsize=9)
        axes.set(ylabel=unit, ylim=(0, None))
        axes.grid(alpha=0.25)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False)
    return figure


def recovery_figure(found: Sequence[Sequence[tuple[Parameter, float]]]) -> Figure:
    """Every set's estimate over the injected value, a panel a parameter, the sets side by side.

    found: of each set its parameters, each with what it should be.
    """
    columns = [[each[k] for each in found if each[k][1] > 0] for k in range(len(found[0]))]
    figure = Figure(figsize=(11, 5.5), layout="constrained")
    grid = figure.subplots(2, len(columns) // 2, sharex=True, squeeze=False)
    for n, column in enumerate(columns):
        axes = grid[n % 2, n // 2]
        for x, (p, true) in enumerate(column):
            colour = COLOURS[1] if p.low <= true <= p.high else MISSED
            axes.plot([x, x], np.array([p.low, p.high]) / true, color=colour, linewidth=1, alpha=0.7)
            axes.plot(x, p.value / true, ".", color=colour, markersize=4)
        axes.axhline(1, color="0.3", linewidth=0.8)
        axes.set(ylim=(0, 4), xticks=[])
        if column:
            held = np.mean([p.low <= true <= p.high for p, true in column])
            axes.set_title(f"{column[0][0].part} {column[0][0].name}: {100 * held:.0f} % held", fontsize=10)
        axes.grid(alpha=0.25)
    for axes in grid[:, 0]:
        axes.set_ylabel("found / injected")
    return figure
