"""What commands show: progress on stderr while they work, scores and checks on stdout."""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

from rich.console import Console
from rich.progress import Progress
from rich.progress import track as rich_track
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from .checks import Check
    from .recording import FileRecording
    from .scoring import Score

console = Console()
progress_console = Console(stderr=True)
Item = TypeVar("Item")
STATE_STYLES = {"ok": "green", "warning": "yellow", "problem": "bold red", "not there": "dim"}
PIPED_WIDTH = 160


def track(items: Iterable[Item], what: str, total: int) -> Iterator[Item]:
    """items, with a progress bar on stderr where that is a terminal: elsewhere even an erased bar leaves a line."""
    disable = not progress_console.is_terminal
    yield from rich_track(items, what, total, console=progress_console, transient=True, disable=disable)


@contextmanager
def bar(what: str) -> Iterator[Callable[[float], None]]:
    """A bar that shows the share, 0 to 1, that the yielded function is called with."""
    with Progress(console=progress_console, transient=True, disable=not progress_console.is_terminal) as progress:
        task = progress.add_task(what, total=1.0)
        yield lambda share: progress.update(task, completed=share)


def warn_of(recording: "FileRecording") -> None:
    """Say on stderr, a line each, what of a recording could not be read or used."""
    faults = [f"incomplete: {recording.damage}"] if recording.damage is not None else []
    faults += [f"left out: {count} {what}" for what, count in recording.left_out.items()]
    for fault in faults:
        text = f"warning: {recording.path}: {fault}"
        progress_console.print(text, highlight=False, markup=False, soft_wrap=True)


def print_scores(scores: "Iterable[Score]") -> None:
    """A table on stdout."""
    from .scoring.score import DIMENSIONLESS

    rows = list(scores)
    bounded = any(row.interval_text for row in rows)
    table = Table("score", "value", *(["95 %"] if bounded else []), "unit", "n", box=None)
    for row in rows:
        unit = "" if row.unit == DIMENSIONLESS else row.unit
        table.add_row(row.name, row.text, *([row.interval_text] if bounded else []), unit, f"{row.n:,}")
    console.print(table)


def told(checks: "Sequence[Check]", *, as_json: bool) -> bool:
    """Print what a doctor found, as a table or as JSON; whether there is no problem."""
    from .checks import as_table, healthy

    if as_json:
        print(json.dumps(as_table(checks), indent=1))  # noqa: T201
    else:
        _print_checks(checks)
    return healthy(checks)


def _print_checks(checks: "Sequence[Check]") -> None:
    wide = console if console.is_terminal else Console(width=PIPED_WIDTH)
    table = Table("check", "", "found", box=None, pad_edge=False)
    for check in checks:
        style = STATE_STYLES[check.state]
        found = Text(check.found, "" if check.state != "not there" else style)
        if check.remedy:
            found.append(f"\n-> {check.remedy}", "dim" if check.state == "not there" else "bold")
        table.add_row(Text(check.name), Text(check.state, style), found)
    wide.print(table)
    counts = {state: sum(check.state == state for check in checks) for state in ("problem", "warning")}
    if not any(counts.values()):
        wide.print("all well")
        return
    summary = " and ".join(f"{count} {state}{'s' * (count > 1)}" for state, count in counts.items() if count)
    wide.print(f"{summary}: what to do stands behind ->")
