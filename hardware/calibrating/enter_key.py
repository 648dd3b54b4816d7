"""Whether a person has pressed Enter in the terminal, without waiting for it."""

import os
import select
import sys


class EnterKey:
    """Looks at the standard input, where there is one that this program may read."""

    def __init__(self) -> None:
        try:
            self._fd: int | None = sys.stdin.fileno()
        except (AttributeError, OSError, ValueError):  # none, or one that is no file
            self._fd = None

    def pressed(self) -> bool:
        """Whether a line has come since the last time. A closed input is no key."""
        if self._fd is None or self._in_background(self._fd) or not select.select([self._fd], [], [], 0)[0]:
            return False
        read = os.read(self._fd, 4096)
        if not read:
            self._fd = None
        return b"\n" in read

    @staticmethod
    def _in_background(fd: int) -> bool:
        # A program in the background that reads the terminal is stopped by it.
        return os.isatty(fd) and os.tcgetpgrp(fd) != os.getpgrp()
