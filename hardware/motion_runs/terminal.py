"""Questions, answers and keys on a terminal."""

import sys
import termios
from collections.abc import Iterator
from contextlib import contextmanager

from stereogrid.errors import InvalidInputError

from ..live.keyboard import Keyboard
from .driving import Pressed


class Terminal:
    """The terminal that this program was started in. Raises InvalidInputError when its input is something else."""

    def __init__(self) -> None:
        if not sys.stdin.isatty():
            raise InvalidInputError("the runs need a terminal: any key of it stops the robot; this input is none")

    def tell(self, line: str) -> None:
        """See Person."""
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()

    def ask(self, question: str) -> str:
        """See Person."""
        return input(question)

    def confirm(self, question: str) -> str:
        """See Person."""
        # An Enter too many at the last question must not move the robot.
        termios.tcflush(sys.stdin, termios.TCIFLUSH)
        return input(question)

    def progress(self, line: str) -> None:
        """See Person."""
        sys.stdout.write(f"\r{line}\x1b[K")
        sys.stdout.flush()

    @contextmanager
    def watching(self) -> Iterator[Pressed]:
        """See Person."""
        with Keyboard() as keyboard:
            # What was typed before is no wish to stop.
            termios.tcflush(sys.stdin, termios.TCIFLUSH)
            yield lambda timeout_s: bool(keyboard.read(timeout_s)) or keyboard.gone
        self.tell("")
