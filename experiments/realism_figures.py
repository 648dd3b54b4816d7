"""Simulated and real images side by side: their numbers as strips of dots, and the images themselves."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .realism_measures import MEASURES

if TYPE_CHECKING:
    from .realism_report import Groups, Measured

SHOWN = (
    "bm_density",
    "bm_bad_1_0",
    "sgbm_density",
    "sgbm_bad_1_0",
    "local_gray",
    "flat",
    "slope",
    "noise_gray",
)
COLUMNS = 4
WIDE = 2.0
"""Height of a preset's row, that of a real place being 1."""
REAL_COLOUR = "#222222"
RANGE_COLOUR = "#e4e4e4"


def strips_figure(groups: "Groups") -> Figure:
    """One axes a measure, one row a real place or a preset; a dot a pair, a bar the mean of the row's places."""
    worlds = list(dict.fromkeys(place for place, preset in groups if preset))
    colours = {world: colormaps["tab10"](k % 10) for k, world in enumerate(worlds)}
    rows = _rows(groups)
    n_rows = -(-len(SHOWN) // COLUMNS)
    places = _places(rows)
    figure = Figure(figsize=(12, n_rows * (0.25 * places[-1] + 1.2) + 0.5), layout="constrained")
    all_axes = figure.subplots(n_rows, COLUMNS, sharey=True)
    for axes, name in zip(all_axes.flat, SHOWN, strict=True):
        _strip(axes, name, dict(zip(places, rows.values(), strict=True)), colours)
    for axes in all_axes[:, 0]:
        axes.set_yticks(places, list(rows), fontsize=8)
    handles = [Line2D([], [], marker="o", ls="", color=colours[world], label=world) for world in worlds]
    handles += [Line2D([], [], marker="o", ls="", color=REAL_COLOUR, label="real")]
    handles += [Line2D([], [], marker="|", ls="", color="k", ms=11, mew=2, label="mean")]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)
    return figure


def _rows(groups: "Groups") -> dict[str, list["Measured"]]:
    """Real places by name, then the presets, all worlds together."""
    rows: dict[str, list[Measured]] = {}
    for (place, preset), group in groups.items():
        rows.setdefault(f"simulated, {preset}" if preset else place, []).extend(group)
    return rows


def _places(rows: Mapping[str, Sequence["Measured"]]) -> list[float]:
    """Where each row stands, downwards; a preset's is wider, for its worlds lie beside each other in it."""
    half = [0.5 if all(m.scene.is_real for m in group) else WIDE / 2 for group in rows.values()]
    return [float(y) for y in 2 * np.cumsum(half) - half]


def _strip(
    axes: Axes, name: str, rows: Mapping[float, Sequence["Measured"]], colours: Mapping[str, tuple[float, ...]]
) -> None:
    """The dots of a measure; rows: the pairs by where their row stands."""
    known = [m.values[name] for group in rows.values() for m in group if m.scene.is_real]
    known = [value for value in known if np.isfinite(value)]
    if known:
        axes.axvspan(min(known), max(known), color=RANGE_COLOUR, lw=0, zorder=0)
    lanes = {world: 0.7 * WIDE * ((k + 0.5) / len(colours) - 0.5) for k, world in enumerate(colours)}
    for y, group in rows.items():
        x = np.array([m.values[name] for m in group])
        dots = [REAL_COLOUR if m.scene.is_real else colours[m.scene.place] for m in group]
        lane = y + np.array([lanes.get(m.scene.place, 0.0) if m.scene.preset else 0.0 for m in group])
        axes.scatter(x, lane, c=dots, s=9, alpha=0.75, linewidths=0, zorder=2)
        if np.isfinite(x).sum() > 1:
            half = 0.4 * (WIDE if group[0].scene.preset else 1.0)
            axes.plot([np.nanmean(x)] * 2, [y - half, y + half], color="k", lw=1.6, zorder=3)
    _label(axes, name, bottom=max(rows) + WIDE / 2)
    n_real = sum(group[0].scene.is_real for group in rows.values())
    axes.axhline(n_real, color="0.5", lw=0.8)


def _label(axes: Axes, name: str, *, bottom: float) -> None:
    measure = MEASURES[name]
    unit = "" if measure.unit == "1" else f" [{measure.unit}]"
    axes.set_title(f"{measure.heading}{unit}", fontsize=9)
    axes.set_ylim(bottom, 0)
    axes.tick_params(axis="x", labelsize=8)
    if measure.unit in ("%", "gray"):
        axes.set_xlim(left=0)
    if name.endswith("density"):
        axes.set_xlim(0, 100)


def pictures_figure(groups: "Groups") -> Figure:
    """The first real image of each place; below, a row a world: the middle of its drive with each preset."""
    real = [(place, group[0].scene.left) for (place, preset), group in groups.items() if not preset]
    rows = [real[k : k + COLUMNS] for k in range(0, len(real), COLUMNS)]
    for world in dict.fromkeys(place for place, preset in groups if preset):
        seen = {preset: group for (place, preset), group in groups.items() if place == world and preset}
        rows.append([(f"{world}, {preset}", group[len(group) // 2].scene.left) for preset, group in seen.items()])
    figure = Figure(figsize=(12, 2.4 * len(rows)), layout="constrained")
    all_axes = figure.subplots(len(rows), max(map(len, rows)), squeeze=False)
    for axes in all_axes.flat:
        axes.set_axis_off()
    for axes_row, row in zip(all_axes, rows, strict=True):
        for axes, (title, image) in zip(axes_row, row, strict=False):
            axes.imshow(image, cmap="gray", vmin=0, vmax=255)
            axes.set_title(title, fontsize=9)
    return figure
