"""The `stereogrid` command. The one place where a StereogridError becomes one line and exit code 1."""

import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.console import Console
from rich.progress import Progress
from rich.progress import track as rich_track
from rich.table import Table

from .errors import InvalidInputError, StereogridError
from .motion_cli import motion_error

if TYPE_CHECKING:
    from .camera import StereoCamera
    from .config import MappingConfig, MatcherConfig
    from .observation import Recording
    from .scoring import Score

# What takes seconds to import (Numba, OpenCV, matplotlib) is imported by the commands that need it: --help and errors
# come at once, and Ctrl-C finds run() in place to end the command.

app = typer.Typer(
    name="stereogrid",
    help="Probabilistic 3D occupancy maps from stereo recordings.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
INTERRUPTED = 130
"""The exit code that typer gives to Ctrl-C."""
console = Console()
progress_console = Console(stderr=True)
Item = TypeVar("Item")

RecordingPath = Annotated[Path, typer.Argument(help="A recording: an MCAP file of ours or a KITTI-odometry folder.")]


@app.command("map", epilog="Example: stereogrid map drive.mcap --matcher sgbm --cell 0.05 --out map.sgrid")
def map_command(
    recording: RecordingPath,
    out: Annotated[Path | None, typer.Option(help="Also save the map here (.sgrid).")] = None,
    config: Annotated[Path | None, typer.Option(help="A config.toml; the options below override it.")] = None,
    matcher: Annotated[str | None, typer.Option(help="bm, sgbm, gc, kz2 or onnx.")] = None,
    network: Annotated[Path | None, typer.Option(help="The TOML file that describes onnx's network.")] = None,
    num_disparities: Annotated[int | None, typer.Option(help="Disparities searched [px].")] = None,
    cell: Annotated[float | None, typer.Option(help="Edge of a cell [m].")] = None,
    max_range: Annotated[float | None, typer.Option("--range", help="Depths used up to here [m].")] = None,
    motion: Annotated[Path | None, typer.Option(help="A motion.toml, as motion-error writes it.")] = None,
    pose_source: Annotated[
        str,
        typer.Option("--poses", help="odometry (what the recording claims), truth, or standing (one place)."),
    ] = "odometry",
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Map a recording: runs/<stamp>-<name>/ gets the map, figures, metrics.json, config.toml and report.html."""
    from .mapping_run import map_recording
    from .recording import RawMcapRecording, TruePoses, open_recording

    if pose_source not in ("odometry", "truth", "standing"):
        raise InvalidInputError(f"--poses must be odometry, truth or standing, not {pose_source!r}")
    source = RawMcapRecording(recording, standing=True) if pose_source == "standing" else open_recording(recording)
    chosen = chosen_config(
        source.camera,
        config,
        matcher=matcher,
        network=network,
        num_disparities=num_disparities,
        cell=cell,
        max_range=max_range,
        motion=motion,
    )
    result = map_recording(
        TruePoses(source) if pose_source == "truth" else source,
        chosen,
        name=recording.resolve().stem,
        runs=runs,
        out=out,
        command=" ".join(["stereogrid", *sys.argv[1:]]),
        track=track,
    )
    print_scores(result.scores)
    console.print(f"{result.grid!r}\n{result.folder}", highlight=False, soft_wrap=True)


def chosen_config(
    camera: "StereoCamera",
    config: Path | None,
    *,
    matcher: str | None = None,
    network: Path | None = None,
    num_disparities: int | None = None,
    cell: float | None = None,
    max_range: float | None = None,
    motion: Path | None = None,
) -> "MappingConfig":
    """The config of a file, or what suits the camera, with the options that were given on the command line."""
    from .config import MappingConfig, load_config

    chosen = load_config(MappingConfig, config) if config else MappingConfig.for_camera(camera)
    chosen = replace(chosen, matcher=_chosen_matcher(chosen.matcher, matcher, network, num_disparities))
    return _overridden(chosen, cell, max_range, motion)


def _chosen_matcher(
    config: "MatcherConfig", name: str | None, network: Path | None, num_disparities: int | None
) -> "MatcherConfig":
    """config with the options that were given on the command line; another matcher does not keep its network."""
    name = name or ("onnx" if network else config.name)
    # Whole, because the run's own config.toml will name it from elsewhere.
    kept = str(network.resolve()) if network else config.network if name == config.name else ""
    count = config.num_disparities if num_disparities is None else num_disparities
    return replace(config, name=name, network=kept, num_disparities=count)


def _overridden(
    config: "MappingConfig", cell: float | None, max_range: float | None, motion: Path | None
) -> "MappingConfig":
    """config with the options that were given on the command line."""
    from .config import load_config
    from .motion import MotionError

    if motion is not None:
        error = load_config(MotionError, motion)
        if error.is_zero and error.way != "none":
            raise InvalidInputError(f"{motion}: tells of no error, so way = {error.way!r} has nothing to go by")
        config = replace(config, motion_error=error)
    if cell is not None:
        config = replace(config, grid=replace(config.grid, cell_m=cell))
    if max_range is not None:
        config = replace(config, model=replace(config.model, max_range_m=max_range))
    return config


@app.command(epilog="Example: stereogrid info drive.mcap")
def info(recording: RecordingPath) -> None:
    """Say what a recording or a map (.sgrid, OctoMap's .bt or .ot) holds."""
    import numpy as np

    from .grid import OccupancyGrid
    from .recording import open_recording, poses

    if recording.suffix in (".sgrid", ".bt", ".ot"):
        console.print(repr(OccupancyGrid.load(recording)), highlight=False, soft_wrap=True)
        return
    source = open_recording(recording)
    positions = poses(source)[:, :3, 3]
    length_m = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    console.print(
        f"{type(source).__name__}: {len(source)} observations, path {length_m:.2f} m\n{source.camera}",
        highlight=False,
        soft_wrap=True,
    )
    for key, value in getattr(source, "metadata", {}).items():
        lines = value.splitlines() or [""]
        more = f" ... ({len(lines)} lines)" if len(lines) > 1 else ""
        console.print(f"{key}: {lines[0]}{more}", highlight=False, markup=False, soft_wrap=True)
    for line in _doubts(source):
        console.print(line, highlight=False, soft_wrap=True)


def _doubts(source: "Recording") -> "Iterator[str]":
    """What is not as it should be in a recording."""
    from .recording import McapRecording, RawMcapRecording

    if isinstance(source, RawMcapRecording):
        skew_ms = 1e3 * abs(source.skew_s)
        yield f"skew of the pictures of a pair: {skew_ms.mean():.1f} ms, at most {skew_ms.max():.1f} ms"
        for topic in source.unstamped:
            yield f"all of {topic} has one header stamp: the times at which it was recorded are used instead"
        for what, count in source.left_out.items():
            yield f"left out: {count} {what}"
    if isinstance(source, McapRecording | RawMcapRecording) and source.damage is not None:
        yield f"incomplete: {source.damage}"


@app.command(epilog="Example: stereogrid score map.sgrid drive.mcap --range 5")
def score(
    grid: Annotated[Path, typer.Argument(help="A map file: .sgrid, or OctoMap's .bt or .ot.")],
    recording: Annotated[Path, typer.Argument(help="The recording it was made from, with its truth (an MCAP file).")],
    max_range: Annotated[float, typer.Option("--range", help="Score cells seen within this range [m].")] = 5.0,
) -> None:
    """Score a map against the true mesh and poses that a simulated recording carries. Needs the extra `score`."""
    from .grid import OccupancyGrid
    from .recording import open_recording
    from .scoring.truth import MapTruth

    loaded = OccupancyGrid.load(grid)
    source = open_recording(recording)
    with _bar("scoring") as show:
        truth = MapTruth.of_recording(
            source, loaded.cell_m, max_range_m=max_range, progress=lambda done, total: show(0.6 * done / total)
        )
        scores = truth.score(loaded, prior=loaded.model.prior)
    print_scores(scores)


@app.command("export", epilog="Example: stereogrid export map.sgrid map.bt")
def export_command(
    grid: Annotated[Path, typer.Argument(help="A map file: .sgrid, or OctoMap's .bt or .ot.")],
    out: Annotated[Path, typer.Argument(help="Where to write; .bt, .glb, .ot, .pcd, .pgm, .ply or .yaml.")],
    threshold: Annotated[float | None, typer.Option(help="Draw cells with p above it (.glb, .pcd, .ply); .5.")] = None,
    cubes: Annotated[bool, typer.Option("--cubes", help="A mesh of cubes instead of points (.ply).")] = False,
    ascii: Annotated[bool, typer.Option("--ascii", help="Text instead of binary (.pcd).")] = False,
    low: Annotated[float | None, typer.Option(help="Lowest height that counts [m] (.pgm, .yaml); .1.")] = None,
    high: Annotated[float | None, typer.Option(help="Highest height that counts [m] (.pgm, .yaml); 1.5.")] = None,
) -> None:
    """Write a map in the format of another program, which the suffix of the file chooses."""
    from .exporting import check_export, export
    from .grid import OccupancyGrid

    options = {"threshold": threshold, "cubes": cubes or None, "ascii": ascii or None, "low_m": low, "high_m": high}
    given = {name: value for name, value in options.items() if value is not None}
    check_export(out, **given)
    export(OccupancyGrid.load(grid), out, **given)


app.command("motion-error", epilog="Example: stereogrid motion-error runs.csv --out motion.toml --figure motion.png")(
    motion_error
)


@app.command("config", epilog="Example: stereogrid config my.toml")
def config_command(path: Annotated[Path, typer.Argument(help="Where to write it.")]) -> None:
    """Write a config.toml with every parameter at its default."""
    from .config import MappingConfig, save_config

    save_config(MappingConfig(), path)


def track(items: Iterable[Item], what: str, total: int) -> Iterator[Item]:
    """items, with a progress bar on stderr where that is a terminal: elsewhere even an erased bar leaves a line."""
    disable = not progress_console.is_terminal
    yield from rich_track(items, what, total, console=progress_console, transient=True, disable=disable)


@contextmanager
def _bar(what: str) -> Iterator[Callable[[float], None]]:
    """A bar that shows the share, 0 to 1, that the yielded function is called with."""
    with Progress(console=progress_console, transient=True, disable=not progress_console.is_terminal) as progress:
        task = progress.add_task(what, total=1.0)
        yield lambda share: progress.update(task, completed=share)


def print_scores(scores: "Iterable[Score]") -> None:
    """A table on stdout."""
    from .scoring.score import DIMENSIONLESS

    table = Table("score", "value", "unit", "n", box=None)
    for row in scores:
        unit = "" if row.unit == DIMENSIONLESS else row.unit
        table.add_row(row.name, row.text, unit, f"{row.n:,}")
    console.print(table)


def run(command: typer.Typer, arguments: list[str] | None = None) -> int:
    """Run a typer command; errors that the user can put right become one line on stderr. The exit code.

    An interrupt, or a request to terminate, unwinds the command, so that nothing half-written stays.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        command(args=arguments)
    except (StereogridError, MemoryError) as error:
        what = error if isinstance(error, StereogridError) else f"not enough memory: {error}"
        print(f"error: {what}", file=sys.stderr)  # noqa: T201
        return 1
    except SystemError as error:
        if not was_interrupted(error):
            raise
        return _interrupted()
    except SystemExit as stop:  # how typer ends, well or not
        if stop.code == INTERRUPTED:
            return _interrupted()
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    return 0


def _interrupted() -> int:
    print("interrupted; earlier results are as they were", file=sys.stderr)  # noqa: T201
    return INTERRUPTED


def was_interrupted(error: BaseException) -> bool:
    """Whether an error arose from an interrupt: amid a kernel of Numba one comes out as a SystemError."""
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, KeyboardInterrupt):
        cause = cause.__cause__ or cause.__context__
    return cause is not None


def main() -> None:
    """The console script."""
    sys.exit(run(app))


if __name__ == "__main__":
    main()
