"""`python -m hardware doctor`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from stereogrid.interrupts import undisturbed


def doctor(
    robot: Annotated[str | None, typer.Option(help="/dev/ttyUSB0, or tcp:host:port: listen to it.")] = None,
    camera: Annotated[
        str | None, typer.Option(help="minoru, LEFT,RIGHT or http://host:port/: watch them.  [a Minoru that is there]")
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="A calibration file to check, against the cameras too.")
    ] = None,
    size: Annotated[str, typer.Option(help="The cameras' pictures [px]; else the calibration's, or 320x240.")] = "",
    fps: Annotated[float, typer.Option(help="Pairs a second asked of the cameras.")] = 30.0,
    swap: Annotated[bool, typer.Option("--swap", help="The left camera is the right one.")] = False,
    folder: Annotated[Path, typer.Option(help="Where recordings will be written.")] = Path(),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Say what is plugged in, what answers, and how to put right what does not. Nothing moves.

    Ends with 1 where there is a problem, with 0 else.
    """
    with undisturbed():
        from stereogrid.screen import told

        from ..doctor.examine import Wanted, examine
        from ..live.rig import parse_size

    wanted = Wanted(robot, camera, calibration, parse_size(size) if size else None, fps, swap, folder)
    checks = list(examine(wanted, say=lambda line: print(line, file=sys.stderr, flush=True)))
    if not told(checks, as_json=as_json):
        raise typer.Exit(1)
