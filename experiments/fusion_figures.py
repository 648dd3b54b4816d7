"""The figure of the arms: a panel a score, a row a world, a dot an arm."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from .compared import Compared
from .fusion_arms import NAMES

MARKERS = "osD^vPX*"
SPREAD = 0.7
"""Of the room between two worlds, what their arms take."""


def arms_figure(worlds: Sequence[Compared], scores: Sequence[str]) -> Figure:
    """Means of the scores by arm with bootstrap 95 % intervals over the units; the reference's dots are ringed."""
    arms = list(dict.fromkeys(arm for world in worlds for arm in world.scores))
    arms.sort(key=lambda arm: NAMES.index(arm) if arm in NAMES else len(NAMES))
    styles = {arm: (MARKERS[n % len(MARKERS)], colormaps["tab10"](n % 10)) for n, arm in enumerate(arms)}
    figure = Figure(figsize=(3.1 * len(scores) + 1.8, 1.6 + 0.75 * len(worlds)), layout="constrained")
    panels = figure.subplots(1, len(scores), sharey=True, squeeze=False)[0]
    for axes, score in zip(panels, scores, strict=True):
        for row, world in enumerate(worlds):
            for n, arm in enumerate(world.scores):
                at = row + SPREAD * ((n + 0.5) / len(world.scores) - 0.5)
                found, (marker, colour) = world.mean(arm, score), styles[arm]
                if np.isfinite([found.low, found.high]).all():
                    axes.plot([found.low, found.high], [at, at], color=colour, linewidth=1.5, alpha=0.7)
                edge = "black" if arm == world.reference else colour
                axes.plot(found.mean, at, marker, color=colour, markeredgecolor=edge, markersize=6.5)
        for border in range(1, len(worlds)):
            axes.axhline(border - 0.5, color="0.85", linewidth=0.8)
        axes.set_xlabel(worlds[0].label(score))
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.grid(axis="x", alpha=0.25)
    panels[0].set_yticks(range(len(worlds)), [world.name for world in worlds])
    panels[0].set_ylim(len(worlds) - 0.5, -0.5)
    handles = [Line2D([], [], color=c, marker=m, linestyle="", label=arm) for arm, (m, c) in styles.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(arms), frameon=False, fontsize=9)
    return figure
