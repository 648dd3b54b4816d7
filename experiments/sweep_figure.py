"""The figure of a sweep: the first parameter along x, the second as colours, the third and the worlds as panels."""

from collections.abc import Mapping, Sequence
from textwrap import wrap

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from stereogrid.scoring.paired import bootstrap_mean

from .claim_statistics import Cell, Values
from .compared import BOOTSTRAP_SEED, labelled
from .fusion_figures import MARKERS
from .sweep_axes import Axis
from .sweep_config import SweepConfig

SPREAD = 0.5
"""Of the room between two values on x, what the colours take."""
NOTHING = Axis(("",), (("",),))
"""Where fewer parameters vary than there are places."""
LONG = 6
"""Letters beyond which the values on x are written aslant, where there are several."""
Seeds = Mapping[int, float]


def sweep_figure(config: SweepConfig, values: Values) -> Figure:
    """The headline score with intervals over the seeds; a column a world, or of one world a value of the third axis."""
    x, colour, panel = (*config.axes, NOTHING, NOTHING, NOTHING)[:3]
    places = [(world, n) for n in range(len(panel.values)) for world in config.the_worlds]
    shape = (len(panel.values), len(config.the_worlds))
    if shape[1] == 1:
        shape = (1, shape[0])
    size = (1.4 + shape[1] * min(max(3.0, 0.55 * len(x.values)), 9), 1.3 + 2.7 * shape[0])
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(*shape, sharex=True, sharey=True, squeeze=False)
    for axes, (world, n) in zip(panels.ravel(), places, strict=True):
        for c in range(len(colour.values)):
            seeds = [seeds_of(config, values, world, (at, c, n)) for at in range(len(x.values))]
            draw_line(axes, seeds, _style(c, len(colour.values)), SPREAD * ((c + 0.5) / len(colour.values) - 0.5))
        axes.set_title("\n".join([world, *wrap(_of_panel(panel, n), 40)]), fontsize=9)
        axes.yaxis.set_major_locator(MaxNLocator(6))
        axes.grid(axis="y", alpha=0.25)
    _name_axes(config, values, x, panels)
    if colour != NOTHING:
        _legend(figure, colour)
    return figure


def seeds_of(config: SweepConfig, values: Values, world: str, at: Sequence[int]) -> Seeds:
    """seed -> the score in a world at a choice of the first axes, its mean over what else varies."""
    n = min(len(at), len(config.axes))
    by_seed: dict[int, list[float]] = {}
    for setting in config.settings:
        if setting.choices[:n] == tuple(at[:n]):
            for seed, value in values.seeds(Cell("", "", setting.label, config.score)).get(world, {}).items():
                by_seed.setdefault(seed, []).append(value)
    return {seed: float(np.mean(found)) for seed, found in by_seed.items()}


def draw_line(axes: Axes, seeds: Sequence[Seeds], style: tuple[str, tuple[float, ...]], shift: float) -> None:
    """Means (X,) joined by a line, with their intervals, and each seed as a small dot."""
    marker, colour = style
    found = [bootstrap_mean(list(each.values()), rng=np.random.default_rng(BOOTSTRAP_SEED)) for each in seeds]
    x = np.arange(len(found)) + shift
    axes.plot(x, [each.mean for each in found], marker, color=colour, linestyle="-", linewidth=0.9, markersize=6)
    for at, mean, each in zip(x, found, seeds, strict=True):
        axes.plot([at, at], [mean.low, mean.high], color=colour, linewidth=1.6)
        axes.plot(np.full(len(each), at + 0.04), list(each.values()), ".", color=colour, markersize=3.5, alpha=0.45)


def _of_panel(panel: Axis, n: int) -> str:
    return "" if panel == NOTHING else f"{panel.label} = {panel.text(n)}"


def _style(n: int, of: int) -> tuple[str, tuple[float, ...]]:
    return MARKERS[n % len(MARKERS)], colormaps["tab10"](n) if of <= 10 else colormaps["viridis"](n / (of - 1))


def _name_axes(config: SweepConfig, values: Values, x: Axis, panels: np.ndarray) -> None:
    labels = [x.text(n) for n in range(len(x.values))]
    aslant = len(labels) > 2 and max(map(len, labels)) > LONG
    turned = {"rotation": 35, "ha": "right"} if aslant else {}
    for axes in panels[-1]:
        axes.set_xticks(range(len(labels)), labels, **turned)
        axes.set_xlim(-0.6, len(labels) - 0.4)
        axes.set_xlabel(x.label if config.axes else "base")
    for axes in panels[:, 0]:
        axes.set_ylabel(labelled(config.score, values.units.get(config.score, "1")))


def _legend(figure: Figure, colour: Axis) -> None:
    styles = [_style(n, len(colour.values)) for n in range(len(colour.values))]
    handles = [
        Line2D([], [], color=c, marker=m, linestyle="-", label=colour.text(n)) for n, (m, c) in enumerate(styles)
    ]
    figure.legend(
        handles=handles, title=colour.label, loc="outside right upper", frameon=False, fontsize=9, title_fontsize=9
    )
