"""`stereogrid motion-error`: a robot's motion error from repeated runs over marks."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from ..motion import MotionFit


def motion_error(
    runs: Annotated[Path, typer.Argument(help="A CSV file, one row a mark; docs/motion.md names its columns.")],
    out: Annotated[Path | None, typer.Option(help="Write the fit here for `stereogrid map --motion` (.toml).")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw runs, fit and band here (.png).")] = None,
    surface: Annotated[str | None, typer.Option(help="Fit the runs on this surface alone.  [all together]")] = None,
    truth_mm: Annotated[
        float, typer.Option(help="How well marks are measured: standard deviation of x, y [mm].")
    ] = 0.0,
    truth_deg: Annotated[float, typer.Option(help="As well, of the true heading [degrees].")] = 0.0,
    way: Annotated[str, typer.Option(help="What maps make of it: linear, none, pose, rss or submaps.")] = "pose",
    keep_bias: Annotated[
        bool, typer.Option("--keep-bias", help="Leave the bias in b, for a robot that is not corrected by it.")
    ] = False,
    bootstrap: Annotated[
        str, typer.Option(help="Intervals from runs drawn anew from the fit, or resampled from the file.")
    ] = "drawn",
    seed: Annotated[int, typer.Option(min=0, help="Of the bootstrap.")] = 0,
) -> None:
    """Fit the motion error to repeated runs over marks, for maps that reckon with it."""
    import numpy as np

    from ..errors import InvalidInputError
    from ..files import check_writable
    from ..motion import FitOptions, Measured, MotionError, fit_motion, read_runs
    from ..tomlfile import save_config

    MotionError(way=way)  # refuses one that there is not before the work
    if figure is not None and figure.suffix.lower() != ".png":
        raise InvalidInputError(f"{figure}: the figure is a .png")
    for path in (out, figure):
        if path is not None:
            if path.resolve() == runs.resolve() or (path is figure and out and out.resolve() == path.resolve()):
                raise InvalidInputError(f"{path}: is named twice, and would be written over")
            check_writable(path)
    measured = Measured(truth_mm / 1000, float(np.radians(truth_deg)))
    options = FitOptions(measured, keep_bias=keep_bias, bootstrap=bootstrap)
    chosen = read_runs(runs)
    if surface is not None:
        chosen = chosen.on(surface)
    fit = fit_motion(chosen, np.random.default_rng(seed), options)
    if out is not None:
        save_config(replace(fit.error, way=way), out)
    if figure is not None:
        from ..figures import motion_figure, save_figure

        save_figure(motion_figure(chosen, fit), figure)
    _print(fit)


def _print(fit: "MotionFit") -> None:
    from ..motion.parameters import HEADER, parameters

    console = Console()
    table = Table(*HEADER, box=None)
    for each in parameters(fit):
        table.add_row(*each.cells)
    console.print(table)
    for n, share in {part.n: part.relative_error for part in fit.parts.values()}.items():
        note = f"{n} runs know a sigma to about {100 * share:.0f} %: 1 / sqrt(2 (n - 1))"
        console.print(note, highlight=False, soft_wrap=True)
    for warning in fit.warnings:
        console.print(f"warning: {warning}", highlight=False, soft_wrap=True)
