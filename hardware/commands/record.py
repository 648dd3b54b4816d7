"""`python -m hardware record`."""

import signal
from contextlib import ExitStack
from pathlib import Path
from time import sleep
from typing import Annotated

import typer

from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.interrupts import held_interrupts, undisturbed

from ..clock import now_s
from .options import CalibrationOption, CameraOption, FpsOption, MountOption, SizeOption, SwapOption

SHOWN_EVERY_S = 0.1


def record(
    out: Annotated[Path, typer.Option(help="The MCAP file to write.")],
    camera: CameraOption,
    robot: Annotated[str | None, typer.Option(help="tcp:HOST:PORT or /dev/ttyUSB0; without: pictures only.")] = None,
    calibration: CalibrationOption = None,
    mount: MountOption = "",
    size: SizeOption = "",
    fps: FpsOption = 30.0,
    swap: SwapOption = False,
    duration: Annotated[float | None, typer.Option(help="End after so long [s]; without: at Ctrl-C.")] = None,
) -> None:
    """Record raw pictures and the robot's reports until Ctrl-C; `stereogrid map` maps the file.

    The robot's motors stay off: push it, or drive it by its joystick.
    """
    with undisturbed():
        from ..live.notes import Notes
        from ..live.screen import Screen
        from ..pioneer import connect
        from ..recording.status import RecordStatus
        from .opening import AskedRig, check_new

    if duration is not None and not duration > 0:
        raise InvalidInputError(f"--duration must be > 0 s, not {duration:g}")
    check_new(out)
    asked = AskedRig.of(camera, calibration, mount, size, fps=fps, swap=swap)
    with ExitStack() as things:
        opened = asked.open(things)
        notes = Notes()
        pioneer = things.enter_context(connect(robot, log=notes.add)) if robot else None
        # From here on an interrupt, or a terminal that is closed, ends the recording, and closes what is open in its
        # order.
        interrupted = things.enter_context(held_interrupts(signal.SIGHUP))
        drive = opened.record(out, things, pioneer, robot or "")
        recorder = drive.recorder
        screen = things.enter_context(Screen())
        status = RecordStatus(drive, opened.cameras, pioneer)
        ends_s = now_s() + duration if duration is not None else float("inf")
        while not (interrupted() or drive.ended or recorder.problem() or now_s() >= ends_s):
            screen.say(notes.take())
            screen.status(status.line(), "Ctrl-C ends the recording")
            sleep(SHOWN_EVERY_S)
        drive.close()
    if recorder.problem():
        raise RecordingError(f"{recorder.problem()}; kept: {status.summary()}")
    typer.echo(status.summary())
