"""`python -m hardware calibrate`: from pictures in files, or from the cameras themselves."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from stereogrid.errors import InvalidInputError, StereogridError
from stereogrid.interrupts import undisturbed
from stereogrid.screen import track

from .options import command_line

if TYPE_CHECKING:
    from stereogrid.calibration import Mount

    from ..calibrating.outcome import Outcome

console = Console(soft_wrap=True, highlight=False, markup=False)


def calibrate(
    pictures: Annotated[
        list[Path] | None,
        typer.Argument(help="Pictures of a chessboard, or a folder of them: left01.png, right01.png, ..."),
    ] = None,
    out: Annotated[Path, typer.Option(help="The calibration to write (.toml).")] = Path("rig.toml"),
    camera: Annotated[
        str | None, typer.Option(help="Live instead of files: minoru, two devices, or an MJPEG server's address.")
    ] = None,
    columns: Annotated[int, typer.Option(help="Inner corners in a row of the board.")] = 9,
    rows: Annotated[int, typer.Option(help="Inner corners in a column of it.")] = 6,
    square: Annotated[float, typer.Option(help="Side of its squares [m]: measure them.")] = 0.025,
    report: Annotated[
        Path | None, typer.Option(help="Folder of the report and of live pictures.  [OUT without .toml, -report]")
    ] = None,
    drop_bad: Annotated[
        bool, typer.Option("--drop-bad", help="Leave out pairs that are far worse than the others.")
    ] = False,
    swap: Annotated[bool, typer.Option("--swap", help="What is called left is the right camera.")] = False,
    width: Annotated[int, typer.Option(help="Of live V4L2 cameras, as they will be used: width [px].")] = 320,
    height: Annotated[int, typer.Option(help="As well, height [px].")] = 240,
    fps: Annotated[float, typer.Option(help="As well, pictures a second.")] = 30.0,
    port: Annotated[int, typer.Option(help="The live page's TCP port on this machine's loopback; 0: any.")] = 0,
    camera_height: Annotated[
        float | None, typer.Option(help="Where it sits on the robot: left lens above the ground [m].")
    ] = None,
    camera_forward: Annotated[float, typer.Option(help="As well, ahead of the middle between the wheels [m].")] = 0.1,
    camera_left: Annotated[float, typer.Option(help="As well, to the left of the robot's centre line [m].")] = 0.03,
    camera_pitch: Annotated[float, typer.Option(help="As well, looking down by [degrees].")] = 0.0,
) -> None:
    """Calibrate two cameras from a chessboard: a calibration file and a report with figures.

    Live, a page in the browser says what pose to show, and takes each pair by itself.
    """
    if bool(pictures) == bool(camera):
        raise InvalidInputError("give pictures of a chessboard or a folder of them, or --camera; one of the two")
    with undisturbed():
        from stereogrid.calibration import Chessboard, Mount
        from stereogrid.files import check_writable, make_folder

        from ..calibrating.from_cameras import calibrate_live, pictures_folder
        from ..calibrating.from_files import calibrate_pairs
        from ..calibrating.outcome import keep_outcome
        from ..calibrating.picture_files import find_pairs
        from ..cameras import open_cameras

    board = Chessboard(columns, rows, square)
    mount = None if camera_height is None else Mount(camera_forward, camera_left, camera_height, camera_pitch)
    if out.suffix.lower() != ".toml":
        raise InvalidInputError(f"{out}: the calibration is a .toml")
    check_writable(out)
    if mount is None and out.exists():
        mount = _earlier_mount(out)
    folder = report or out.with_name(f"{out.stem}-report")

    def conclude(outcome: "Outcome") -> str:
        make_folder(folder)
        page = keep_outcome(outcome, out, folder, mount=mount, command=command_line())
        _print(outcome)
        console.print(f"{out}\n{page}")
        if mount is None:
            console.print("where the camera sits on the robot is not in it: give --camera-height, or add [mount] to it")
        return f"stereo rms {outcome.errors.stereo_rms_px:.2f} px: written to {out}, and a report to {page}"

    if camera is None:
        conclude(calibrate_pairs(find_pairs(pictures or []), board, swap=swap, drop_far=drop_bad, track=track))
        return
    with open_cameras(camera, size_px=(width, height), fps=fps, swap=swap) as cameras:
        calibrate_live(
            cameras,
            board,
            pictures_folder(folder),
            conclude,
            source=camera,
            swap=swap,
            drop_far=drop_bad,
            port=port,
            track=track,
            say=console.print,
        )


def _earlier_mount(out: Path) -> "Mount | None":
    """Where the cameras sit by the calibration that is about to be replaced, where that can be read."""
    from stereogrid.calibration import Mount, load_calibration

    try:
        T_base_cam = load_calibration(out).T_base_cam
    except StereogridError:
        return None
    if T_base_cam is None:
        return None
    console.print(f"where the camera sits is kept as {out} has it")
    return Mount.of(T_base_cam)


def _print(outcome: "Outcome") -> None:
    table = Table("what", "value", "how to read it", box=None)
    for row in outcome.rows:
        table.add_row(*row)
    console.print(table)
    for line in outcome.calibration.left_out:
        console.print(f"left out: {line}")
    for line in outcome.warnings:
        console.print(f"warning: {line}")
