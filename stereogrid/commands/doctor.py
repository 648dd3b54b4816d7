"""`stereogrid doctor`."""

from pathlib import Path
from typing import Annotated

import typer

from .options import RUNS, RunsOption


def doctor(
    runs: RunsOption = RUNS,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Say whether this computer can do what stereogrid needs, and what to do where it cannot.

    Ends with 1 where there is a problem, with 0 else.
    """
    from ..doctor import examine
    from ..screen import told

    if not told(list(examine(Path(runs))), as_json=as_json):
        raise typer.Exit(1)
