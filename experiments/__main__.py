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
    from stereogrid.report import ReportTable

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


@app.command(epilog="Example: python -m experiments matchers --pairs shared/data/stereo")
def matchers(
    config: Annotated[Path | None, typer.Option(help="A config.toml, as a run leaves one.")] = None,
    pairs: Annotated[
        Path | None, typer.Option(help="A stereo pair with its truth, or a folder of some.  [$STEREOGRID_DATA/stereo]")
    ] = None,
    recording: Annotated[Path | None, typer.Option(help="Map this recorded drive again.")] = None,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Compare the matchers on pairs of known disparity, and by the map that each makes of one drive."""
    from stereogrid.config import load_config

    from .matchers import MatchersConfig
    from .matchers import run as run_matchers
    from .parallel import rich_stage

    start_s = time.perf_counter()
    chosen = load_config(MatchersConfig, config) if config else MatchersConfig()
    command = " ".join(["python -m experiments", *sys.argv[1:]])
    folder, tables = run_matchers(chosen, rich_stage, runs=runs, pairs=pairs, recording=recording, command=command)
    console = Console()
    for table in tables:
        console.print(_rich(table))
    console.print(
        f"{folder / 'report.html'} after {time.perf_counter() - start_s:.0f} s", highlight=False, soft_wrap=True
    )


@app.command(epilog="Example: python -m experiments sigma --data ../shared/data --write")
def sigma(
    data: Annotated[Path, typer.Option(envvar="STEREOGRID_DATA", help="shared/data, whose stereo/ holds the pairs.")],
    matcher: Annotated[list[str] | None, typer.Option(help="Only this one; may be given again.  [all]")] = None,
    write: Annotated[bool, typer.Option("--write", help="Put the tables into the library.")] = False,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Fit each matcher's disparity sigma, and test it on scenes that it was fitted without."""
    from .parallel import rich_stage
    from .sigma import run as run_sigma

    start_s = time.perf_counter()
    command = " ".join(["python -m experiments", *sys.argv[1:]])
    folder, rows = run_sigma(data, rich_stage, runs=runs, names=matcher or (), write=write, command=command)
    table = Table("matcher", "fitted on", "tested on", "1s", "2s", "", "1s raw", "2s raw", "1s all", "2s all", box=None)
    for row in rows:
        shares = (row.one_raw, row.two_raw, row.one_all, row.two_all)
        found = (f"{row.one:.1f}", f"{row.two:.1f}", "" if row.within else "*", *(f"{share:.1f}" for share in shares))
        table.add_row(row.matcher, row.fitted_on, row.scenes, *found)
    console = Console()
    console.print(table)
    console.print(f"{folder} after {time.perf_counter() - start_s:.0f} s", highlight=False, soft_wrap=True)


@app.command(epilog="Example: python -m experiments correlation --data ../shared/data --write")
def correlation(
    data: Annotated[
        Path, typer.Option(envvar="STEREOGRID_DATA", help="shared/data, with stereo/ and sequences/euroc_static/.")
    ],
    matcher: Annotated[list[str] | None, typer.Option(help="Only this one; may be given again.  [all]")] = None,
    write: Annotated[bool, typer.Option("--write", help="Put the numbers into the library.")] = False,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Measure how far each matcher's errors go together, over the image and from one observation to the next."""
    from .correlation import run as run_correlation
    from .correlation_tables import correlation_tables
    from .parallel import rich_stage

    start_s = time.perf_counter()
    command = " ".join(["python -m experiments", *sys.argv[1:]])
    folder, found = run_correlation(data, rich_stage, runs=runs, names=matcher or (), write=write, command=command)
    console = Console()
    for table in correlation_tables(found):
        console.print(_rich(table))
    console.print(f"{folder} after {time.perf_counter() - start_s:.0f} s", highlight=False, soft_wrap=True)


@app.command(epilog="Example: python -m experiments fusion --data ../shared/data")
def fusion(
    config: Annotated[Path | None, typer.Option(help="A config.toml, as a run leaves one.")] = None,
    data: Annotated[
        Path | None,
        typer.Option(envvar="STEREOGRID_DATA", help="shared/data, with sequences/kitti_straight and rgbd_7scenes."),
    ] = None,
    recording: Annotated[Path | None, typer.Option(help="Map this recorded drive again.")] = None,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Compare what the grid may be told of how far a matcher's errors go together, and the literal sum of rays."""
    from stereogrid.config import load_config

    from .fusion import FusionConfig
    from .fusion import run as run_fusion
    from .parallel import rich_stage

    start_s = time.perf_counter()
    chosen = load_config(FusionConfig, config) if config else FusionConfig()
    command = " ".join(["python -m experiments", *sys.argv[1:]])
    folder, tables = run_fusion(chosen, rich_stage, runs=runs, data=data, recording=recording, command=command)
    console = Console()
    for table in tables:
        console.print(_rich(table))
    console.print(
        f"{folder / 'report.html'} after {time.perf_counter() - start_s:.0f} s", highlight=False, soft_wrap=True
    )


@app.command(epilog="Example: python -m experiments energy --pairs ../shared/data/stereo")
def energy(
    pairs: Annotated[Path, typer.Option(help="Folder of pairs with known disparity, one folder each.")],
) -> None:
    """Compare kz2's energies and times with those of the published reference."""
    from .energy import compare
    from .parallel import rich_stage

    table = Table("pair", "energy", "less the reference's best", "CPU s", "wall s", "CPU / reference's", box=None)
    for result in compare(pairs, rich_stage):
        best, seconds = result.reference or (None, None)
        relation = ("-", "-") if best is None else (f"{result.energy - best}", f"{result.cpu_s / seconds:.2f}")
        times = (f"{result.cpu_s:.1f}", f"{result.wall_s:.1f}")
        table.add_row(result.pair, str(result.energy), relation[0], *times, relation[1])
    Console().print(table)


@app.command(epilog="Example: make bench-grid, which measures first")
def grid_bench(
    bench: Annotated[Path, typer.Argument(help="What pytest tests/bench --benchmark-json=FILE wrote.")],
    picture: Annotated[Path | None, typer.Option(help="Write the figure there as well.")] = None,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Lay out the grid's benchmark: speed and memory beside OctoMap's, as tables and a figure."""
    from .grid_bench import run as run_bench

    folder, tables = run_bench(bench, runs=runs, picture=picture)
    console = Console()
    for table in tables:
        console.print(_rich(table))
        console.print(f"{table.caption}. {table.note}\n", highlight=False)
    console.print(f"{folder / 'tables.md'}", highlight=False, soft_wrap=True)


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


def _rich(table: "ReportTable") -> Table:
    shown = Table(*table.header, box=None)
    for row in table.rows:
        shown.add_row(*row)
    return shown


if __name__ == "__main__":
    sys.exit(run_command(app))
