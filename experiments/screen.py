"""What the commands share: options, a run with its progress bars, and its tables on the screen."""

import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from stereogrid.report import ReportTable

    from .parallel import Stage

ConfigFile = Annotated[Path | None, typer.Option("--config", help="A config.toml, as a run leaves one.")]
Drive = Annotated[Path | None, typer.Option("--recording", help="Map this recorded drive again.")]
Runs = Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")]
OnlyMatchers = Annotated[list[str] | None, typer.Option("--matcher", help="Only this one; may be given again.  [all]")]
RUNS = Path("runs")
Config = TypeVar("Config")
Run = Callable[["Stage", str], "tuple[Path, Iterable[ReportTable]]"]
"""run(stage, command): the run folder, and the tables for the screen."""


def chosen(kind: type[Config], path: Path | None) -> Config:
    """The config in a file, or the defaults."""
    from stereogrid.config import load_config

    return load_config(kind, path) if path else kind()


def show(run: Run) -> None:
    """Run an experiment, print its tables and where the rest is."""
    from .parallel import rich_stage

    start_s = time.perf_counter()
    folder, tables = run(rich_stage, " ".join(["python -m experiments", *sys.argv[1:]]))
    print_tables(tables)
    report = folder / "report.html"
    place = report if report.exists() else folder
    Console().print(f"{place} after {time.perf_counter() - start_s:.0f} s", highlight=False, soft_wrap=True)


def print_tables(tables: "Iterable[ReportTable]", *, captions: bool = False) -> None:
    """The tables one below the other, each with its caption and note where these are wanted."""
    console = Console()
    for table in tables:
        shown = Table(box=None)
        for n, heading in enumerate(table.header):
            shown.add_column(heading, no_wrap=n < table.n_names)
        for row in table.rows:
            shown.add_row(*row)
        console.print(shown)
        if captions:
            console.print(f"{table.caption}. {table.note}\n", highlight=False)
