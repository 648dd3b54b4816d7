"""`python -m hardware drive`."""

import math
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stereogrid.commands.options import (
    RUNS,
    CellOption,
    ConfigOption,
    DisparitiesOption,
    MatcherOption,
    MotionOption,
    NetworkOption,
    RangeOption,
    RunsOption,
    SetOption,
)
from stereogrid.errors import InvalidInputError
from stereogrid.interrupts import undisturbed

from ..errors import HardwareError
from .options import CalibrationOption, CameraOption, FpsOption, MountOption, SizeOption, SwapOption, command_line

FASTEST_MPS, FASTEST_DEGPS = 0.7, 90.0
"""A person at the keys of a robot without any avoidance; its firmware starts out with .7 m/s, too."""
SHORTEST_PATIENCE_S = 2.0

if TYPE_CHECKING:
    from ..live.session import DriveResult


def drive(
    robot: Annotated[str, typer.Option(help="tcp:HOST:PORT or /dev/ttyUSB0.")],
    camera: CameraOption,
    calibration: CalibrationOption = None,
    mount: MountOption = "",
    out: Annotated[Path | None, typer.Option(help="Also save the map here (.sgrid).")] = None,
    record: Annotated[Path | None, typer.Option(help="Record the drive here (.mcap).")] = None,
    config: ConfigOption = None,
    matcher: MatcherOption = None,
    network: NetworkOption = None,
    num_disparities: DisparitiesOption = None,
    cell: CellOption = None,
    max_range: RangeOption = None,
    motion: MotionOption = None,
    settings: SetOption = None,
    size: SizeOption = "",
    fps: FpsOption = 30.0,
    swap: SwapOption = False,
    speed: Annotated[float, typer.Option(help="Full speed [m/s].")] = 0.3,
    turn: Annotated[float, typer.Option(help="Full turn rate [deg/s].")] = 30.0,
    teleop: Annotated[bool, typer.Option(help="Drive by keys; without: map while others drive.")] = True,
    view: Annotated[bool, typer.Option("--view", help="Show the map in the browser while it grows.")] = False,
    view_port: Annotated[int, typer.Option(help="The view's TCP port on this machine's loopback; 0: any.")] = 8103,
    patience: Annotated[float, typer.Option(help="End when robot or cameras are silent for so long [s].")] = 10.0,
    runs: RunsOption = RUNS,
) -> None:
    """Drive the robot by keyboard and map while it goes: runs/<stamp>-drive/ gets the map, figures and report."""
    with undisturbed():
        from stereogrid.commands.chosen import chosen_config
        from stereogrid.files import check_writable
        from stereogrid.runs import check_runs
        from stereogrid.screen import track

        from ..live.helm import Speeds
        from ..live.keyboard import Keyboard
        from ..live.notes import Notes
        from ..live.session import DriveParts, DriveSession, live_view
        from ..pioneer import Limits, connect
        from .opening import AskedRig, check_new

    for name, value, most, unit in (("speed", speed, FASTEST_MPS, "m/s"), ("turn", turn, FASTEST_DEGPS, "deg/s")):
        if not 0 < value <= most:
            raise InvalidInputError(f"--{name} must be more than 0 and at most {most:g} {unit}, not {value:g}")
    if not patience >= SHORTEST_PATIENCE_S:
        raise InvalidInputError(f"--patience must be {SHORTEST_PATIENCE_S:g} s or more, not {patience:g}")
    limits = Limits(speed, math.radians(turn))
    if out is not None:
        if out.suffix.lower() != ".sgrid":
            raise InvalidInputError(f"{out}: a map's name must end with .sgrid; `stereogrid export` writes others")
        check_writable(out)
    if record is not None:
        check_new(record)
    asked = AskedRig.of(camera, calibration, mount, size, fps=fps, swap=swap)
    check_runs(runs)
    notes = Notes()
    if sys.stderr.isatty():
        typer.echo(f"connecting to {robot} and {camera}", err=True)
    with ExitStack() as things:
        keys = things.enter_context(Keyboard()) if teleop else None
        pioneer = things.enter_context(connect(robot, limits=limits, log=notes.add))
        opened = asked.open(things, pioneer)
        mapping = chosen_config(
            opened.rig.camera,
            config,
            matcher=matcher,
            network=network,
            num_disparities=num_disparities,
            cell=cell,
            max_range=max_range,
            motion=motion,
            settings=settings,
        )
        shown = things.enter_context(live_view(opened.rig, mapping, view_port)) if view else None
        if shown:
            notes.add(f"the map grows at {shown.url}")
        recorder = opened.record(record, things, pioneer, robot) if record else None
        parts = DriveParts(opened.cameras, opened.rig, pioneer, notes, keys, recorder, shown)
        session = DriveSession(parts, mapping, Speeds(speed, limits.turn_radps), patience_s=patience)
        facts = {"command": command_line(), "robot": robot, "cameras": opened.cameras.name}
        result = session.run(runs=runs, out=out, facts=facts, track=track)
    _tell(result)


def _tell(result: "DriveResult") -> None:
    """What came out of it on stdout; what went wrong as an error."""
    from stereogrid.screen import print_scores

    saved = result.saved
    places = [str(place) for place in (*(saved.places if saved else ()), *result.recorded)]
    if saved and saved.scores:
        print_scores(saved.scores)
    for place in places:
        typer.echo(place)
    if result.faults:
        kept = f"; all up to there is kept in {', '.join(places)}" if places else ""
        raise HardwareError("; ".join(result.faults) + kept)
