"""The claim as figures: what each arm changes, and whether the error is bounded."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from .claim_config import ClaimConfig
from .claim_statistics import LIKE_THESE, THESE, Cell, Difference, Values
from .claim_tables import CORE, Differences
from .claim_units import ANY
from .fusion_figures import MARKERS, SPREAD

BETTER = {"auc_all": "higher is better", "log_loss_all": "lower is better", "ece_width_all": "lower is better"}
NOMINAL, SLACK = 0.95, 0.02
COVERAGES = {
    "bound_coverage_along": "along the ray",
    "bound_coverage_along_inliers": "along the ray, without mismatches",
    "bound_coverage_surface": "to the true surface on the ray",
}
Style = tuple[str, tuple[float, ...]]


def styles(config: ClaimConfig) -> dict[str, Style]:
    """A marker and a colour for each arm, alike in all figures."""
    return {arm: (MARKERS[n % len(MARKERS)], colormaps["tab10"](n % 10)) for n, arm in enumerate(config.by_arm)}


def forest_figure(config: ClaimConfig, fusion: str, differences: Differences) -> Figure:
    """Differences from the reference with their intervals: a panel a score, a row a noise and world, a dot an arm."""
    arms = {arm: style for arm, style in styles(config).items() if arm in config.others(fusion)}
    rows = [(noise.name, world) for noise in config.noises for world in (*config.worlds, THESE)]
    figure = Figure(figsize=(3.3 * len(CORE) + 2.6, 1.4 + 0.42 * len(rows)), layout="constrained")
    panels = figure.subplots(1, len(CORE), sharey=True, squeeze=False)[0]
    for axes, score in zip(panels, CORE, strict=True):
        wide = []
        for row, (noise, world) in enumerate(rows):
            for n, (arm, style) in enumerate(arms.items()):
                cell, at = Cell(noise, fusion, arm, score), _beside(row, n, len(arms))
                if found := differences.get((cell, world)):
                    _draw_difference(axes, at, found, style)
                if world == THESE and (wider := differences.get((cell, LIKE_THESE))):
                    wide.append((wider.interval, at, style[1]))
        limits = axes.get_xlim()  # the widest intervals need not be seen whole
        for interval, at, colour in wide:
            axes.plot([interval.low, interval.high], [at, at], color=colour, linewidth=0.7, alpha=0.6)
        axes.set_xlim(limits)
        axes.axvline(0, color="0.3", linewidth=0.9)
        axes.set_xlabel(f"{score} - that of {config.reference}\n({BETTER[score]})")
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.grid(axis="x", alpha=0.25)
    _name_rows(panels, rows)
    _legend(figure, arms)
    return figure


def _draw_difference(axes: Axes, at: float, found: Difference, style: Style) -> None:
    """A difference with its interval, thicker over all worlds; filled where it is marked in the tables."""
    marker, colour = style
    width = 2.6 if found.world == THESE else 1.2
    axes.plot([found.interval.low, found.interval.high], [at, at], color=colour, linewidth=width)
    filled = colour if found.excludes_zero else "white"
    axes.plot(found.interval.mean, at, marker, color=colour, markerfacecolor=filled, markersize=5.5)


def coverage_figure(config: ClaimConfig, values: Values) -> Figure:
    """Share of the hits that are as near the truth as is claimed: a panel a kind of error, a dot an arm and world."""
    arms, rows = styles(config), [(noise.name, THESE) for noise in config.noises]
    figure = Figure(figsize=(3.3 * len(COVERAGES) + 2.6, 1.4 + 0.75 * len(rows)), layout="constrained")
    panels = figure.subplots(1, len(COVERAGES), sharex=True, sharey=True, squeeze=False)[0]
    for axes, (score, what) in zip(panels, COVERAGES.items(), strict=True):
        axes.axvspan(NOMINAL - SLACK, NOMINAL + SLACK, color="0.88")
        axes.axvline(NOMINAL, color="0.3", linewidth=0.9)
        for row, (noise, _) in enumerate(rows):
            for n, (arm, (marker, colour)) in enumerate(arms.items()):
                by_world = values.worlds(Cell(noise, ANY, arm, score)).values()
                means = [np.nanmean(each) for each in by_world if np.isfinite(each).any()]
                at = [_beside(row, n, len(arms))] * len(means)
                axes.plot(means, at, color=colour, linewidth=1.2)
                axes.plot(means, at, marker, color=colour, markersize=5, alpha=0.8)
        axes.set_xlabel(f"share of hits within 1.96 sigma,\n{what}")
        axes.grid(axis="x", alpha=0.25)
    _name_rows(panels, rows)
    _legend(figure, arms)
    return figure


def _beside(row: int, n: int, of: int) -> float:
    return row + SPREAD * ((n + 0.5) / of - 0.5)


def _name_rows(panels: Sequence[Axes], rows: Sequence[tuple[str, str]]) -> None:
    """The worlds at the left, the noise before the first of them, and a line below the last of each noise."""
    labels = []
    for row, (noise, world) in enumerate(rows):
        is_first = row == 0 or rows[row - 1][0] != noise
        labels.append(f"{noise}   {world}" if is_first and world != THESE else noise if is_first else world)
        for axes in panels:
            if row and is_first:
                axes.axhline(row - 0.5, color="0.6", linewidth=0.8)
    panels[0].set_yticks(range(len(rows)), labels)
    panels[0].set_ylim(len(rows) - 0.5, -0.5)


def _legend(figure: Figure, arms: dict[str, Style]) -> None:
    handles = [Line2D([], [], color=c, marker=m, linestyle="", label=arm) for arm, (m, c) in arms.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(arms), 8), frameon=False)
