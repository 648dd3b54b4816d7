"""`stereogrid export`."""

from pathlib import Path
from typing import Annotated

import typer

from ..screen import console
from .options import MapPath


def export_command(
    grid: MapPath,
    out: Annotated[Path, typer.Argument(help="Where to write; .bt, .glb, .ot, .pcd, .pgm, .ply or .yaml.")],
    threshold: Annotated[float | None, typer.Option(help="Draw cells with p above it (.glb, .pcd, .ply); .5.")] = None,
    cubes: Annotated[bool, typer.Option("--cubes", help="A mesh of cubes instead of points (.ply).")] = False,
    ascii: Annotated[bool, typer.Option("--ascii", help="Text instead of binary (.pcd).")] = False,
    low: Annotated[float | None, typer.Option(help="Lowest height that counts [m] (.pgm, .yaml); .1.")] = None,
    high: Annotated[float | None, typer.Option(help="Highest height that counts [m] (.pgm, .yaml); 1.5.")] = None,
) -> None:
    """Write a map in the format of another program, which the suffix of the file chooses."""
    from ..exporting import check_export, export
    from ..grid import OccupancyGrid

    options = {"threshold": threshold, "cubes": cubes or None, "ascii": ascii or None, "low_m": low, "high_m": high}
    given = {name: value for name, value in options.items() if value is not None}
    check_export(out, **given)
    export(OccupancyGrid.load(grid), out, **given)
    console.print(f"{out}: {out.stat().st_size / 1e6:.1f} MB", highlight=False, soft_wrap=True)
