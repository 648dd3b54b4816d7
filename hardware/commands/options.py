"""Options that several commands have."""

import sys
from pathlib import Path
from typing import Annotated

import typer

CameraOption = Annotated[str, typer.Option(help="minoru, /dev/video0,/dev/video2 or http://127.0.0.1:8102/.")]
CalibrationOption = Annotated[Path | None, typer.Option(help="The rig's, as `calibrate` writes it.")]
MountOption = Annotated[
    str, typer.Option(help="The left lens on the robot: x,y,z[,pitch,yaw,roll] [m, deg]; else the calibration's.")
]
SizeOption = Annotated[str, typer.Option(help="The cameras' pictures [px]; else the calibration's, or 320x240.")]
FpsOption = Annotated[float, typer.Option(help="Pairs a second asked of the cameras.")]
SwapOption = Annotated[bool, typer.Option("--swap", help="The left camera is the right one.")]


def command_line() -> str:
    """The command as it was typed, for what tells how a file came about."""
    return " ".join(["python -m hardware", *sys.argv[1:]])
