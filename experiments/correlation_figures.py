"""The figures of the correlation experiment: rho over the image, and rho over motion."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .correlation_length import UNCORRELATED, Autocorrelation
from .correlation_motion import DECORRELATED, Bin, Decorrelation
from .sigma_scenes import REAL


def rho_figure(found: Mapping[str, Mapping[str, Autocorrelation]]) -> Figure:
    """rho by the distance between two pixels, a panel a matcher: real scenes in full, simulated ones dashed."""
    figure = Figure(figsize=(3.6 * len(found) + 2, 4), layout="constrained")
    panels = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    for axes, (name, of_row) in zip(panels, found.items(), strict=True):
        for row, each in of_row.items():
            is_real = row.split(" / ")[0] in REAL
            axes.plot(each.radial, "-" if is_real else "--", label=f"{row}: L = {each.length_px:.1f} px", lw=1.2)
        axes.axhline(UNCORRELATED, color="0.8", zorder=0)
        axes.set_title(name)
        axes.set_xlabel("distance of two pixels [px]")
        axes.legend(fontsize=6)
    panels[0].set_ylabel("correlation of their errors")
    return figure


def motion_figure(found: Mapping[str, Decorrelation]) -> Figure:
    """rho of one surface point's errors in two views, by its image motion and by the distance moved."""
    figure = Figure(figsize=(3.6 * len(found) + 1, 6), layout="constrained")
    panels = figure.subplots(2, len(found), sharey=True, squeeze=False)
    for place, (name, each) in enumerate(found.items()):
        for axes, bins, what in zip(
            panels[:, place], (each.by_px, each.by_m), ("image motion [px]", "moved [m]"), strict=True
        ):
            _draw(axes, bins, each.at_rest)
            axes.set_xlabel(what)
        panels[0, place].set_title(name)
    panels[0, 0].legend(fontsize=7)
    for axes in panels[:, 0]:
        axes.set_ylabel("correlation of a point's errors")
    return figure


def _draw(axes: Axes, bins: Sequence[Bin], at_rest: float) -> None:
    middle = [each.middle for each in bins]
    for part, style in (("rho", "k-o"), ("near", "C0--"), ("far", "C1--")):
        axes.semilogx(middle, [getattr(each, part) for each in bins], style, ms=3, label={"rho": "all"}.get(part, part))
    axes.axhline(at_rest, color="C2", lw=1, label="at rest")
    axes.axhline(DECORRELATED, color="0.8", zorder=0)
    axes.set_ylim(-0.2, 1)
