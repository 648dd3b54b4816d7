"""`python -m experiments corridor`: the experiments, one command each."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from stereogrid.cli import run as run_command

if TYPE_CHECKING:
    from .corridor import Outcome

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
    # Imported here for the reasons that stereogrid.cli gives.
    from stereogrid.config import load_config

    from .corridor import HEADLINE, CorridorConfig
    from .corridor import run as run_corridor
    from .parallel import rich_stage

    start_s = time.perf_counter()
    chosen = load_config(CorridorConfig, config) if config else CorridorConfig()
    command = " ".join(["python -m experiments", *sys.argv[1:]])
    folder, outcomes = run_corridor(chosen, rich_stage, runs=runs, command=command, recording=recording)
    console = Console()
    console.print(_table(outcomes, HEADLINE))
    console.print(
        f"{folder / 'report.html'} after {time.perf_counter() - start_s:.0f} s", highlight=False, soft_wrap=True
    )


@app.command(epilog="Example: python -m experiments pictures runs/latest")
def pictures(
    run: Annotated[Path, typer.Argument(help="A run of the corridor experiment, with its drive.mcap.")],
    out: Annotated[Path, typer.Option(help="Folder of the pictures.")] = Path("docs/images"),
) -> None:
    """Make the README's picture anew."""
    from .pictures import corridor_picture

    corridor_picture(run, out / "corridor.png")


def _table(outcomes: "dict[str, Outcome]", headline: tuple[str, ...]) -> Table:
    table = Table("score", "unit", *outcomes, box=None)
    units = {score.name: score.unit for score in next(iter(outcomes.values())).scores}
    for name in headline:
        values = (f"{outcome.value(name):.3f}" for outcome in outcomes.values())
        table.add_row(name, "" if units[name] == "1" else units[name], *values)
    return table


if __name__ == "__main__":
    sys.exit(run_command(app))
