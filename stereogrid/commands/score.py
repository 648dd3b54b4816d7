"""`stereogrid score`."""

from pathlib import Path
from typing import Annotated

import typer

from ..screen import bar, console, print_scores
from .options import MapPath


def score(
    grid: MapPath,
    recording: Annotated[Path, typer.Argument(help="The recording it was made from, with its truth (an MCAP file).")],
    max_range: Annotated[
        float | None, typer.Option("--range", help="Score cells seen within this range [m].  [the map's own]")
    ] = None,
) -> None:
    """Score a map against the true mesh and poses that a simulated recording carries. Needs the extra `score`."""
    from ..grid import OccupancyGrid
    from ..recording import open_recording
    from ..scoring.truth import MapTruth

    loaded = OccupancyGrid.load(grid)
    source = open_recording(recording)
    range_m = loaded.model.max_range_m if max_range is None else max_range
    with bar("scoring") as show:
        truth = MapTruth.of_recording(
            source, loaded.cell_m, max_range_m=range_m, progress=lambda done, total: show(0.6 * done / total)
        )
        scores = truth.score(loaded, prior=loaded.model.prior, intervals=True)
    print_scores(scores)
    console.print(f"of the cells that the cameras could see within {range_m:g} m", highlight=False, soft_wrap=True)
    console.print(truth.interval_note, highlight=False, soft_wrap=True)
