"""Where lines go: a status that stays at the bottom of a terminal, or plain lines in a log."""

import time
from collections.abc import Iterable
from contextlib import suppress
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.text import Text

PLAIN_PERIOD_S = 1.0


class Screen:
    """Shows on stderr what is said and how things stand. Use as a context manager.

    A terminal that is gone takes no lines, and is no reason to fail.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._live = Live(console=self._console, auto_refresh=False, transient=True, redirect_stdout=False)
        self._plain_s = -PLAIN_PERIOD_S

    def __enter__(self) -> "Screen":
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):
            self._live.stop()

    def say(self, lines: Iterable[str]) -> None:
        """Lines that stay."""
        with suppress(OSError):
            for line in lines:
                self._console.print(line, highlight=False, markup=False, soft_wrap=True)

    def status(self, line: str, help_line: str) -> None:
        """How things stand now."""
        with suppress(OSError):
            if self._console.is_terminal:
                self._live.update(Text(f"{line}\n{help_line}".rstrip()), refresh=True)
            elif time.monotonic() - self._plain_s >= PLAIN_PERIOD_S:
                self._plain_s = time.monotonic()
                self.say([line])
