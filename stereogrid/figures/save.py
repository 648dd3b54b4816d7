"""One way to turn a Figure into bytes."""

import io
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..files import written_beside

DOTS_PER_INCH = 150
NOTEBOOK_DOTS_PER_INCH = 75


class NotebookFigure(Figure):
    """A Figure that a notebook shows, without pyplot."""

    def _repr_png_(self) -> bytes:
        return figure_png(self, NOTEBOOK_DOTS_PER_INCH)


def figure_png(figure: Figure, dots_per_inch: int = DOTS_PER_INCH) -> bytes:
    """The figure as PNG bytes; the same figure gives the same bytes."""
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dots_per_inch, bbox_inches="tight", metadata={"Software": None})
    return buffer.getvalue()


def save_figure(figure: Figure, path: str | Path, dots_per_inch: int = DOTS_PER_INCH) -> Path:
    """Write the figure to path (.png), beside and then renamed."""
    path = Path(path)
    with written_beside(path) as temporary:
        temporary.write_bytes(figure_png(figure, dots_per_inch))
    return path
