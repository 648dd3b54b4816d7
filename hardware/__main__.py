"""`python -m hardware drive --robot tcp:127.0.0.1:8101 --camera http://127.0.0.1:8102/`; doctor, calibrate and more."""

from stereogrid.early import end_at_once

if __name__ == "__main__":
    end_at_once()

import sys

import typer

from stereogrid.cli import run

from .commands.calibrate import calibrate
from .commands.doctor import doctor
from .commands.drive import drive
from .commands.motion import motion
from .commands.record import record

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.callback()
def hardware() -> None:
    """The real robot and its two cameras."""


app.command(epilog="Example: python -m hardware doctor")(doctor)
app.command(epilog="Example: python -m hardware calibrate left*.jpg right*.jpg --out rig.toml")(calibrate)
app.command(
    epilog="Example: python -m hardware record --robot /dev/ttyUSB0 --camera minoru --calibration rig.toml --out a.mcap"
)(record)
app.command(epilog="Example: python -m hardware drive --robot /dev/ttyUSB0 --camera minoru --calibration rig.toml")(
    drive
)
app.command(epilog="Example: python -m hardware motion --robot /dev/ttyUSB0 --distance 2 --out runs.csv")(motion)

if __name__ == "__main__":
    sys.exit(run(app))
