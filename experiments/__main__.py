"""`python -m experiments corridor`: the experiments, one command each."""

from stereogrid.early import end_at_once

if __name__ == "__main__":
    end_at_once()

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stereogrid.cli import run as run_command

from .screen import RUNS, WORK, ConfigFile, Drive, Drives, OnlyMatchers, Runs, Work, chosen, print_tables, show

if TYPE_CHECKING:
    from collections.abc import Callable

    from stereogrid.report import ReportTable

    from .drive_report import Outcome
    from .parallel import Stage

# What a command needs it imports itself, for the reasons that stereogrid.cli gives.

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.callback()
def experiments() -> None:
    """Experiments: each leaves its results in runs/<stamp>-<name>/, and runs/latest points there."""


@app.command(epilog="Example: python -m experiments corridor --recording drive.mcap")
def corridor(config: ConfigFile = None, recording: Drive = None, runs: Runs = RUNS) -> None:
    """Drive down a simulated corridor, map it by stereo, score the map against the truth."""
    from .corridor import CorridorConfig, run

    _show_drive(run, chosen(CorridorConfig, config), runs=runs, recording=recording)


@app.command(epilog="Example: python -m experiments outdoor --recording drive.mcap")
def outdoor(config: ConfigFile = None, recording: Drive = None, runs: Runs = RUNS) -> None:
    """Drive over uneven ground outdoors, map it by stereo, score the map against the truth."""
    from .outdoor import OutdoorConfig, run

    _show_drive(run, chosen(OutdoorConfig, config), runs=runs, recording=recording)


@app.command(epilog="Example: python -m experiments realism --data ../shared/data --worlds corridor,outdoor")
def realism(
    config: ConfigFile = None,
    data: Annotated[
        Path | None, typer.Option(envvar="STEREOGRID_DATA", help="shared/data, with stereo/ and sequences/.")
    ] = None,
    worlds: Annotated[str | None, typer.Option(help="Only these, with commas between them.  [all]")] = None,
    runs: Runs = RUNS,
) -> None:
    """How real is it? Lay matching and image statistics of simulated pairs beside those of real ones."""
    from .realism import RealismConfig, run

    parameters = chosen(RealismConfig, config)
    if worlds is not None:
        parameters = replace(parameters, worlds=tuple(each.strip() for each in worlds.split(",")))
    show(lambda stage, command: run(parameters, stage, runs=runs, data=data, command=command))


@app.command(epilog="Example: python -m experiments matchers --pairs shared/data/stereo")
def matchers(
    config: ConfigFile = None,
    pairs: Annotated[
        Path | None, typer.Option(help="A stereo pair with its truth, or a folder of some.  [$STEREOGRID_DATA/stereo]")
    ] = None,
    recording: Drive = None,
    runs: Runs = RUNS,
) -> None:
    """Compare the matchers on pairs of known disparity, and by the map that each makes of one drive."""
    from .matchers import MatchersConfig, run

    given = {"runs": runs, "pairs": pairs, "recording": recording}
    show(lambda stage, command: run(chosen(MatchersConfig, config), stage, command=command, **given))


@app.command(epilog="Example: python -m experiments sigma --data ../shared/data --write")
def sigma(
    data: Annotated[Path, typer.Option(envvar="STEREOGRID_DATA", help="shared/data, whose stereo/ holds the pairs.")],
    matcher: OnlyMatchers = None,
    write: Annotated[bool, typer.Option("--write", help="Put the tables into the library.")] = False,
    runs: Runs = RUNS,
) -> None:
    """Fit each matcher's disparity sigma, and test it on scenes that it was fitted without."""
    from .sigma import run, screen_table

    def fit(stage: "Stage", command: str) -> "tuple[Path, list[ReportTable]]":
        folder, rows = run(data, stage, runs=runs, names=matcher or (), write=write, command=command)
        return folder, [screen_table(rows)]

    show(fit)


@app.command(epilog="Example: python -m experiments correlation --data ../shared/data --write")
def correlation(
    data: Annotated[
        Path, typer.Option(envvar="STEREOGRID_DATA", help="shared/data, with stereo/ and sequences/euroc_static/.")
    ],
    matcher: OnlyMatchers = None,
    write: Annotated[bool, typer.Option("--write", help="Put the numbers into the library.")] = False,
    runs: Runs = RUNS,
) -> None:
    """Measure how far each matcher's errors go together, over the image and from one observation to the next."""
    from .correlation import run
    from .correlation_tables import correlation_tables

    def measure(stage: "Stage", command: str) -> "tuple[Path, list[ReportTable]]":
        folder, found = run(data, stage, runs=runs, names=matcher or (), write=write, command=command)
        return folder, correlation_tables(found)

    show(measure)


@app.command(epilog="Example: python -m experiments fusion --data ../shared/data")
def fusion(
    config: ConfigFile = None,
    data: Annotated[
        Path | None,
        typer.Option(envvar="STEREOGRID_DATA", help="shared/data, with sequences/kitti_straight and rgbd_7scenes."),
    ] = None,
    recording: Drive = None,
    runs: Runs = RUNS,
) -> None:
    """Compare what the grid may be told of how far a matcher's errors go together, and the literal sum of rays."""
    from .fusion import FusionConfig, run

    given = {"runs": runs, "data": data, "recording": recording}
    show(lambda stage, command: run(chosen(FusionConfig, config), stage, command=command, **given))


@app.command(epilog="Example: python -m experiments claim --publish docs/claim")
def claim(
    config: ConfigFile = None,
    work: Work = WORK,
    publish: Annotated[Path | None, typer.Option(help="Copy figures and the first scores there as well.")] = None,
    runs: Runs = RUNS,
) -> None:
    """Test the paper's claim: do maps get better when the mapper is told of the poses' error, and is it bounded?

    Stopped and started again it goes on where it was.
    """
    from .claim import run
    from .claim_config import ClaimConfig

    given = {"runs": runs, "work": work, "publish": publish}
    show(lambda stage, command: run(chosen(ClaimConfig, config), stage, command=command, **given))


@app.command(epilog="Example: python -m experiments claim-tune --config candidates.toml")
def claim_tune(config: ConfigFile = None, work: Work = WORK, runs: Runs = RUNS) -> None:
    """Try candidates for the claim's parameters, on worlds that the claim is not scored on."""
    from .claim import tune
    from .claim_config import TuneConfig

    show(lambda stage, command: tune(chosen(TuneConfig, config), stage, runs=runs, work=work, command=command))


@app.command(epilog="Example: python -m experiments sweep experiments/sweeps/matchers.toml")
def sweep(
    config: Annotated[Path, typer.Argument(help="What to vary, in which worlds, with which seeds: docs/sweeps.md.")],
    scheduler: Annotated[str, typer.Option(help="Of a cluster: tcp://host:8786.  [processes of this machine]")] = "",
    workers: Annotated[int, typer.Option(help="Processes here.  [as many as cores]")] = 0,
    memory_gb: Annotated[float, typer.Option(help="Of each; one that takes more is ended.  [an equal share]")] = 0.0,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Try what failed once more.")] = False,
    dashboard: Annotated[bool, typer.Option("--dashboard", help="dask's page, on 127.0.0.1:8787.")] = False,
    work: Work = RUNS / "sweep",
    runs: Runs = RUNS,
) -> None:
    """Map with any parameters x worlds x seeds, and say which are better, on which world, with which interval.

    Stopped and started again it goes on where it was.
    """
    from .sweep import run
    from .sweep_cluster import Place
    from .sweep_config import load_sweep

    given = load_sweep(config)
    place = Place(scheduler, workers, memory_gb, dashboard)
    show(lambda _stage, command: run(given, place=place, runs=runs, work=work, retry=retry_failed, command=command))


@app.command(epilog="Example: python -m experiments motion --surfaces vinyl,gravel")
def motion(
    config: ConfigFile = None,
    surfaces: Annotated[str | None, typer.Option(help="Only these, with commas between them.  [all]")] = None,
    runs: Runs = RUNS,
) -> None:
    """Drive over marked lines and turns again and again, and fit the motion error to what odometry says of them."""
    from .motion import MotionConfig, run

    parameters = chosen(MotionConfig, config)
    if surfaces is not None:
        parameters = replace(parameters, surfaces=tuple(each.strip() for each in surfaces.split(",")))
    show(lambda stage, command: run(parameters, stage, runs=runs, command=command))


@app.command(epilog="Example: python -m experiments budget --recording corridor.mcap --recording office.mcap")
def budget(config: ConfigFile = None, recording: Drives = None, runs: Runs = RUNS) -> None:
    """Split a map's error: matching, calibration, odometry, cells and fusion made true, or real, one at a time."""
    from .budget import BudgetConfig, run

    parameters = chosen(BudgetConfig, config)
    show(lambda stage, command: run(parameters, stage, runs=runs, recordings=recording or (), command=command))


@app.command(epilog="Example: python -m experiments printed --recording corridor.mcap")
def printed(config: ConfigFile = None, recording: Drive = None, runs: Runs = RUNS) -> None:
    """Map one drive by the chapter's equations as printed and as corrected, and count what goes wrong."""
    from .printed import PrintedConfig, run

    parameters = chosen(PrintedConfig, config)
    show(lambda stage, command: run(parameters, stage, runs=runs, recording=recording, command=command))


@app.command(epilog="Example: python -m experiments energy --pairs ../shared/data/stereo")
def energy(
    pairs: Annotated[Path, typer.Option(help="Folder of pairs with known disparity, one folder each.")],
) -> None:
    """Compare kz2's energies and times with those of the published reference."""
    from .energy import compare, screen_table
    from .parallel import rich_stage

    print_tables([screen_table(compare(pairs, rich_stage))])


@app.command(epilog="Example: make bench-grid, which measures first")
def grid_bench(
    bench: Annotated[Path, typer.Argument(help="What pytest tests/bench --benchmark-json=FILE wrote.")],
    picture: Annotated[Path | None, typer.Option(help="Write the figure there as well.")] = None,
    runs: Runs = RUNS,
) -> None:
    """Lay out the grid's benchmark: speed and memory beside OctoMap's, as tables and a figure."""
    from .grid_bench import run

    folder, tables = run(bench, runs=runs, picture=picture)
    print_tables(tables, notes=True)
    typer.echo(folder / "tables.md")


@app.command(epilog="Example: python -m experiments pictures runs/latest")
def pictures(
    run: Annotated[Path, typer.Argument(help="A run of the corridor experiment, with its drive.mcap.")],
    out: Annotated[Path, typer.Option(help="Folder of the pictures.")] = Path("docs/images"),
) -> None:
    """Make the README's picture anew."""
    from .pictures import corridor_picture

    corridor_picture(run, out / "corridor.png")


@app.command(epilog="Example: python -m experiments config corridor > mine.toml")
def config(
    experiment: Annotated[str, typer.Argument(help="The experiment's name.")],
    out: Annotated[Path | None, typer.Argument(help="Write it there.  [on the screen]")] = None,
    check: Annotated[Path | None, typer.Option(help="Say whether this file is fine, and print nothing else.")] = None,
) -> None:
    """Print an experiment's config.toml with every parameter, its unit and its default, for --config."""
    from stereogrid.commands.config import show_config
    from stereogrid.errors import unknown_name

    from .configs import CONFIGS

    if experiment not in CONFIGS:
        raise unknown_name("experiment with a config", experiment, CONFIGS)
    show_config(CONFIGS[experiment], f"python -m experiments {experiment}", out=out, check=check)


def _show_drive(run: "Callable[..., tuple[Path, dict[str, Outcome]]]", config: object, **given: Path | None) -> None:
    """Run an experiment on one drive, and show the first scores of its arms."""
    from .drive_report import headline_table

    def drive(stage: "Stage", command: str) -> "tuple[Path, list[ReportTable]]":
        folder, outcomes = run(config, stage, command=command, **given)
        return folder, [headline_table(outcomes)]

    show(drive)


if __name__ == "__main__":
    sys.exit(run_command(app))
