"""What the commands share: options, a run with its progress bars, and its tables on the screen."""

import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from .narrow import narrowed

if TYPE_CHECKING:
    from stereogrid.report import ReportTable

    from .parallel import Stage

ConfigFile = Annotated[Path | None, typer.Option("--config", help="A config.toml, as a run leaves one.")]
Drive = Annotated[Path | None, typer.Option("--recording", help="Map this recorded drive again.")]
Drives = Annotated[
    list[Path] | None, typer.Option("--recording", help="Map this recorded drive again; may be given again.")
]
Runs = Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")]
OnlyMatchers = Annotated[list[str] | None, typer.Option("--matcher", help="Only this one; may be given again.  [all]")]
Work = Annotated[Path, typer.Option("--work", help="Where finished units are kept, to go on from.")]
RUNS = Path("runs")
WORK = RUNS / "claim"
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


def print_tables(tables: "Iterable[ReportTable]", *, notes: bool = False) -> None:
    """The tables one below the other, each under its caption, where there are several or notes are wanted.

    What is too wide for the screen is folded and parted (experiments.narrow), and never cut.
    """
    console, tables = Console(), list(tables)
    for n, table in enumerate(tables):
        if notes or len(tables) > 1:
            console.print(f"{chr(10) if n else ''}{table.caption}", style="bold", highlight=False)
        common, parts = narrowed(table, console.width)
        if common:
            console.print(f" {common}", highlight=False)
        for part in parts:
            console.print(_rich(part))
        if notes and table.note:
            console.print(table.note, highlight=False)


def _rich(table: "ReportTable") -> Table:
    shown = Table(box=None)
    for heading in table.header:
        shown.add_column(Text(heading), no_wrap=True)
    for row in table.rows:
        shown.add_row(*map(Text, row))
    return shown
