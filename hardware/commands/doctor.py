"""`python -m hardware doctor`."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stereogrid.interrupts import undisturbed

if TYPE_CHECKING:
    from ..doctor.check import Check

STYLES = {"ok": "green", "warning": "yellow", "problem": "bold red", "not there": "dim"}
PIPED_WIDTH = 160


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
        from ..doctor.check import as_table, healthy
        from ..doctor.examine import Wanted, examine
        from ..live.rig import parse_size

    wanted = Wanted(robot, camera, calibration, parse_size(size) if size else None, fps, swap, folder)
    checks = list(examine(wanted, say=lambda line: print(line, file=sys.stderr, flush=True)))
    if as_json:
        print(json.dumps(as_table(checks), indent=1))
    else:
        _print(checks)
    if not healthy(checks):
        raise typer.Exit(1)


def _print(checks: "list[Check]") -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    if not console.is_terminal:
        console = Console(width=PIPED_WIDTH)
    table = Table("check", "", "found", box=None, pad_edge=False)
    for check in checks:
        style = STYLES[check.state]
        found = Text(check.found, "" if check.state != "not there" else style)
        if check.remedy:
            found.append(f"\n-> {check.remedy}", "dim" if check.state == "not there" else "bold")
        table.add_row(Text(check.name), Text(check.state, style), found)
    console.print(table)
    counts = {state: sum(check.state == state for check in checks) for state in ("problem", "warning")}
    if not any(counts.values()):
        console.print("all well")
        return
    told = " and ".join(f"{count} {state}{'s' * (count > 1)}" for state, count in counts.items() if count)
    console.print(f"{told}: what to do stands behind ->")
