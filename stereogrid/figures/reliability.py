"""The reliability diagram: are cells of probability p occupied that often?"""

from matplotlib.figure import Figure

from ..scoring import ReliabilityTable
from .save import NotebookFigure


def reliability_figure(table: ReliabilityTable, *, title: str = "") -> Figure:
    """Observed frequency of occupied cells over the mean p of each bin, with the counts below."""
    figure = NotebookFigure(figsize=(5.2, 5.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    above.plot([0, 1], [0, 1], "--", color="0.6", linewidth=1, label="calibrated")
    full = table.count > 0
    above.plot(table.mean_p[full], table.frequency[full], "o-", color="#1f4e9c", label="map")
    above.set(ylabel="share truly occupied", xlim=(0, 1), ylim=(0, 1), title=title or "Reliability")
    above.legend(loc="upper left", fontsize=8)
    widths = table.edges[1:] - table.edges[:-1]
    below.bar(table.edges[:-1], table.count, width=widths, align="edge", color="#9db8de", edgecolor="white")
    below.set(xlabel="p(occupied) of the map", ylabel="cells", yscale="log")
    for axes in (above, below):
        axes.grid(alpha=0.25)
    return figure
