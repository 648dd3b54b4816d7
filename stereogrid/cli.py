"""The `stereogrid` command. The one place where a StereogridError becomes one line and exit code 1."""

from .early import end_at_once

if __name__ == "__main__":
    end_at_once()

import sys
from typing import Annotated, Any

import typer

from . import __version__
from .commands.config import config_command
from .commands.convert import convert_command
from .commands.doctor import doctor
from .commands.export import export_command
from .commands.info import info
from .commands.mapping import map_command
from .commands.motion_error import motion_error
from .commands.repeat import repeat
from .commands.score import score
from .commands.trajectory import trajectory_command
from .commands.view import view_command
from .errors import StereogridError
from .interrupts import raised_interrupts

# What takes seconds to import (Numba, OpenCV, matplotlib) is imported by the commands that need it: --help and errors
# come at once, and Ctrl-C finds run() in place to end the command.

app = typer.Typer(
    name="stereogrid",
    no_args_is_help=True,
    epilog="Example: stereogrid map drive.mcap && stereogrid view runs/latest",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
ClickException: type[Exception] = typer.BadParameter.__mro__[2]
"""Of the click that typer brings, or of click itself, by typer's version."""
INTERRUPTED = 130
"""The exit code that typer gives to Ctrl-C."""


def _tell_version(asked: bool) -> None:
    if asked:
        print(__version__)  # noqa: T201
        raise typer.Exit


@app.callback()
def stereogrid(
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Say which version this is.")
    ] = False,
) -> None:
    """Probabilistic 3D occupancy maps from stereo recordings."""


app.command("map", epilog="Example: stereogrid map drive.mcap --matcher sgbm --cell 0.05 --out map.sgrid")(map_command)
app.command(epilog="Example: stereogrid info drive.mcap")(info)
app.command(epilog="Example: stereogrid repeat runs/latest")(repeat)
app.command(epilog="Example: stereogrid score map.sgrid drive.mcap --range 5")(score)
app.command("view", epilog="Example: stereogrid view runs/latest")(view_command)
app.command("export", epilog="Example: stereogrid export map.sgrid map.bt")(export_command)
app.command("trajectory", epilog="Example: stereogrid trajectory drive.mcap drive.tum --poses truth")(
    trajectory_command
)
app.command("convert", epilog="Example: stereogrid convert path/to/kitti/00 street.mcap --start 10 --end 20")(
    convert_command
)
app.command("motion-error", epilog="Example: stereogrid motion-error runs.csv --out motion.toml --figure motion.png")(
    motion_error
)
app.command("config", epilog="Example: stereogrid config > my.toml")(config_command)
app.command(epilog="Example: stereogrid doctor")(doctor)


def run(command: typer.Typer, arguments: list[str] | None = None) -> int:
    """Run a typer command; errors that the user can put right become one line on stderr. The exit code.

    An interrupt, or a request to terminate, unwinds the command, so that nothing half-written stays.
    """
    try:
        with raised_interrupts():
            return _run(command, arguments)
    except (KeyboardInterrupt, Exception) as error:
        if not was_interrupted(error):
            raise
        return _interrupted()


def _run(command: typer.Typer, arguments: list[str] | None) -> int:
    try:
        code = command(args=arguments, standalone_mode=False)
    except ClickException as error:
        return _refused(error)
    except (StereogridError, MemoryError) as error:
        if was_interrupted(error):
            raise
        what = error if isinstance(error, StereogridError) else f"not enough memory: {error}"
        print(f"error: {what}", file=sys.stderr)  # noqa: T201
        return 1
    except SystemExit as stop:  # how typer ends, well or not
        if stop.code == INTERRUPTED:
            return _interrupted()
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    return _interrupted() if code == INTERRUPTED else code if isinstance(code, int) else 0


def _refused(error: Any) -> int:
    """One line for a command line that cannot be meant; the help for one without a word."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        return int(error.exit_code)
    where = f" (see `{error.ctx.command_path} --help`)" if getattr(error, "ctx", None) else ""
    print(f"error: {' '.join(error.format_message().split())}{where}", file=sys.stderr)  # noqa: T201
    return 1


def _interrupted() -> int:
    print("interrupted; earlier results are as they were", file=sys.stderr)  # noqa: T201
    return INTERRUPTED


def was_interrupted(error: BaseException) -> bool:
    """Whether an error arose from an interrupt: amid a kernel of Numba, or an import, one comes out as another."""
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, KeyboardInterrupt):
        cause = cause.__cause__ or cause.__context__
    return cause is not None


if __name__ == "__main__":
    sys.exit(run(app))
