"""The figure of the benchmark: speed against cell size, and what the length of a drive does to size and speed."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

if TYPE_CHECKING:
    from .grid_bench import GrowthRow, SpeedRow

STYLES: dict[str, dict[str, Any]] = {
    "stereogrid": {"marker": "o", "linestyle": "-"},
    "octomap": {"marker": "s", "linestyle": "--", "markerfacecolor": "white"},
}
LABELS = {"stereogrid": "stereogrid", "octomap": "OctoMap"}
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
GREY = "0.2"


def bench_figure(speed: "Sequence[SpeedRow]", growth: "Sequence[GrowthRow]", *, growth_of: str = "") -> Figure | None:
    """A panel for each width of image, then two for the growth; None when there is nothing to draw.

    growth_of: images and range of the growth, for its titles.
    """
    n_rows = bool(speed) + bool(growth)
    if not n_rows:
        return None
    figure = Figure(figsize=(9, 3.8 * n_rows + 0.4), layout="constrained")
    parts = figure.subfigures(n_rows, 1, squeeze=False)[:, 0]
    if speed:
        _speed_panels(parts[0], speed)
    if growth:
        _growth_panels(parts[-1], growth, growth_of)
    return figure


def _speed_panels(part: SubFigure, rows: "Sequence[SpeedRow]") -> None:
    widths, ranges = sorted({row.width_px for row in rows}), sorted({row.range_m for row in rows})
    colours = dict(zip(ranges, COLOURS * len(ranges), strict=False))
    panels = part.subplots(1, len(widths), sharey=True, squeeze=False)[0]
    for axes, width_px in zip(panels, widths, strict=True):
        _draw_speed(axes, [row for row in rows if row.width_px == width_px], colours)
    _legend(part, rows, [Line2D([], [], color=colours[r], linewidth=3, label=f"depths up to {r:g} m") for r in ranges])


def _growth_panels(part: SubFigure, rows: "Sequence[GrowthRow]", growth_of: str) -> None:
    size, rate = part.subplots(1, 2)
    _draw_growth(size, rows, lambda row: row.n_bytes / 1e6, "memory of the map [MB]")
    _draw_growth(rate, rows, lambda row: row.fps, "frames a second of CPU, last 10 m")
    # Speed should hold: an axis cut close to the points would make a slope of their noise.
    low, high = rate.get_ylim()
    rate.set_ylim(low / 2, high * 2)
    for axes in (size, rate):
        axes.set_title(f"{growth_of}, cells of {rows[0].cell_m:g} m".removeprefix(", "), fontsize=10)
    _legend(part, rows, [])


def _legend(part: SubFigure, rows: "Sequence[SpeedRow | GrowthRow]", more: list[Line2D]) -> None:
    """The maps of rows by their styles, and more, above the panels."""
    handles = [Line2D([], [], color=GREY, label=LABELS[name], **STYLES[name]) for name in _names(rows)] + more
    part.legend(handles=handles, loc="outside upper center", ncols=len(handles), frameon=False, fontsize=9)


def _names(rows: "Sequence[SpeedRow | GrowthRow]") -> list[str]:
    return [name for name in STYLES if any(row.contender == name for row in rows)]


def _draw_speed(axes: Axes, rows: "Sequence[SpeedRow]", colours: dict[float, str]) -> None:
    for range_m, colour in colours.items():
        for name in _names(rows):
            own = sorted((r.cell_m, r.fps) for r in rows if (r.contender, r.range_m) == (name, range_m))
            axes.plot(*zip(*own, strict=True), color=colour, **STYLES[name]) if own else None
    cells_m = sorted({row.cell_m for row in rows})
    width_px = rows[0].width_px
    axes.set(xscale="log", yscale="log", xlabel="cell size [m]", ylabel="frames a second of CPU, one core")
    axes.set_title(f"{width_px} x {width_px * 3 // 4} px", fontsize=10)
    axes.label_outer()
    axes.xaxis.set_major_locator(FixedLocator(cells_m))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlim(cells_m[0] / 1.15, cells_m[-1] * 1.15)
    _finish(axes)


def _draw_growth(axes: Axes, rows: "Sequence[GrowthRow]", value: "Callable[[GrowthRow], float]", label: str) -> None:
    for name in _names(rows):
        own = sorted((row.length_m, value(row)) for row in rows if row.contender == name)
        axes.plot(*zip(*own, strict=True), color=GREY, **STYLES[name])
    axes.set(xscale="log", yscale="log", xlabel="length of the drive [m]", ylabel=label)
    axes.xaxis.set_major_locator(FixedLocator(sorted({row.length_m for row in rows})))
    axes.xaxis.set_minor_locator(NullLocator())
    _finish(axes)


def _finish(axes: Axes) -> None:
    """Plain numbers on both axes."""
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_major_formatter(plain)
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 50 * low else (1,)))
    axes.yaxis.set_major_formatter(plain)
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.25)
