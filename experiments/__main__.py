"""`python -m experiments corridor`: the experiments, one command each."""

import sys
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from stereogrid.cli import run as run_command
from stereogrid.config import load_config

from . import corridor as corridor_experiment
from . import pictures as picture_experiment
from .parallel import rich_stage

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.callback()
def experiments() -> None:
    """Experiments: each leaves its results in runs/<stamp>-<name>/, and runs/latest points there."""


@app.command(epilog="Example: python -m experiments corridor --recording drive.mcap")
def corridor(
    config: Annotated[Path | None, typer.Option(help="A config.toml, as a run leaves one.")] = None,
    recording: Annotated[Path | None, typer.Option(help="Map this recorded drive again.")] = None,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Drive down a simulated corridor, map it by stereo, score the map against the truth."""
    start_s = time.perf_counter()
    chosen = load_config(corridor_experiment.CorridorConfig, config) if config else corridor_experiment.CorridorConfig()
    command = " ".join(["python -m experiments", *sys.argv[1:]])
    folder, outcomes = corridor_experiment.run(chosen, rich_stage, runs=runs, command=command, recording=recording)
    console = Console()
    console.print(_table(outcomes))
    console.print(
        f"{folder / 'report.html'} after {time.perf_counter() - start_s:.0f} s", highlight=False, soft_wrap=True
    )


@app.command(epilog="Example: python -m experiments pictures runs/latest")
def pictures(
    run: Annotated[Path, typer.Argument(help="A run of the corridor experiment, with its drive.mcap.")],
    out: Annotated[Path, typer.Option(help="Folder of the pictures.")] = Path("docs/images"),
) -> None:
    """Make the README's picture anew."""
    picture_experiment.corridor_picture(run, out / "corridor.png")


def _table(outcomes: dict[str, corridor_experiment.Outcome]) -> Table:
    table = Table("score", "unit", *outcomes, box=None)
    units = {score.name: score.unit for score in next(iter(outcomes.values())).scores}
    for name in corridor_experiment.HEADLINE:
        values = (f"{outcome.value(name):.3f}" for outcome in outcomes.values())
        table.add_row(name, "" if units[name] == "1" else units[name], *values)
    return table


if __name__ == "__main__":
    sys.exit(run_command(app))
