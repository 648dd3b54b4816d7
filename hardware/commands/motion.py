"""`python -m hardware motion`."""

import math
import sys
from pathlib import Path
from typing import Annotated

import typer

from stereogrid.errors import InvalidInputError
from stereogrid.interrupts import undisturbed


def motion(
    robot: Annotated[str, typer.Option(help="/dev/ttyUSB0, a pseudo-terminal, or tcp:host:port.")],
    out: Annotated[Path, typer.Option(help="The CSV file of runs; one that exists is gone on with.")],
    distance: Annotated[float | None, typer.Option(help="Drive straight ahead so far [m].")] = None,
    turn: Annotated[float | None, typer.Option(help="Turn on the spot so far, each way in turn [degrees].")] = None,
    runs: Annotated[int, typer.Option(help="So many of each must be in the file.")] = 10,
    surface: Annotated[str, typer.Option(help="What is driven on, such as carpet; for the file.")] = "",
    every: Annotated[float, typer.Option(help="Stop at marks this far apart, and at the end [m].")] = 1.0,
    every_turn: Annotated[float, typer.Option(help="The same of turns [degrees], 150 at most.")] = 90.0,
) -> None:
    """Drive the same line or turn again and again, and note where the robot really was, for its motion error.

    The robot moves after Enter alone, and any key stops it. Every mark is kept at once: Ctrl-C loses none, and the same
    command goes on from there.
    """
    with undisturbed():
        from stereogrid.files import check_writable

        from ..motion_runs.plan import Plan
        from ..motion_runs.session import Session
        from ..motion_runs.terminal import Terminal
        from ..pioneer import connect

    turn_rad = None if turn is None else math.radians(turn)
    plan = Plan(distance, turn_rad, runs, surface.strip(), every_m=every, every_rad=math.radians(every_turn))
    check_writable(out)
    person = Terminal()
    try:
        with connect(robot, log=lambda line: print(line, file=sys.stderr)) as driver:
            session = Session(driver, person, plan, out)
            session.run()
    except KeyboardInterrupt:
        if out.exists():
            person.tell(f"\n{out} keeps every mark so far; the same command goes on from there")
        raise
    _say_next(out, surface.strip(), sum(plan.left(session.held).values()))


def _say_next(out: Path, surface: str, left: int) -> None:
    """What `stereogrid motion-error` makes of the file, and what to type then."""
    from stereogrid.commands.motion_error import motion_error

    if not out.exists():
        return
    print(f"\n{out}" + (f": {left} runs are left; the same command goes on with them" if left else ": complete"))
    try:
        motion_error(out, surface=surface or None)
    except InvalidInputError as error:
        print(error)
        return
    named = f" --surface {surface}" if surface else ""
    print(f"next: stereogrid motion-error {out}{named} --out motion.toml --figure motion.png")
