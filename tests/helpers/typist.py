"""Somebody at a terminal: starts a command on a pseudo-terminal of its own, reads what it says, types."""

import os
import pty
import re
import select
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType

ROOT = Path(__file__).parents[2]
PATIENCE_S = 60.0
"""A loaded machine takes long to import what a command needs."""


class Typist:
    """`python -m <arguments>` with the terminal as its controlling one, so that Ctrl-C and Ctrl-Z are what they are.

    said: all that it wrote so far, without colours and carriage returns. Leaving the `with` kills what still runs.
    """

    def __init__(self, *arguments: str, cwd: Path | None = None) -> None:
        self._handle, theirs = pty.openpty()
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm", "COLUMNS": "160"}
        self.process = subprocess.Popen(
            [sys.executable, "-c", "import fcntl, termios, runpy, sys; fcntl.ioctl(0, termios.TIOCSCTTY, 0);"
             "sys.argv[0] = sys.argv.pop(1); runpy.run_module(sys.argv[0], run_name='__main__', alter_sys=True)",
             *arguments],
            stdin=theirs, stdout=theirs, stderr=theirs, cwd=cwd, env=environment, start_new_session=True,
        )  # fmt: skip
        os.close(theirs)
        self.said = ""
        self._seen = 0

    def __enter__(self) -> "Typist":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._handle)

    def expect(self, pattern: str, within_s: float = PATIENCE_S) -> str:
        """Wait until it says what matches, after what was expected before; the match."""
        end_s = time.monotonic() + within_s
        while True:
            found = re.compile(pattern).search(self.said, self._seen)
            if found:
                self._seen = found.end()
                return found[0]
            if not self._read(end_s - time.monotonic()):
                raise AssertionError(f"it never said {pattern!r}; it said:\n{self.said}")

    def type(self, text: str) -> None:
        """Press keys; a line ends with \\n."""
        os.write(self._handle, text.encode())

    def answer(self, pattern: str, text: str) -> str:
        """Wait for a question, and answer it with a line."""
        found = self.expect(pattern)
        self.type(f"{text}\n")
        return found

    def end(self, within_s: float = PATIENCE_S) -> int:
        """Wait until it ends; its exit code."""
        end_s = time.monotonic() + within_s
        while self._read(end_s - time.monotonic()):
            pass
        return self.process.wait(max(1.0, end_s - time.monotonic()))

    def _read(self, timeout_s: float) -> bool:
        """Some of what it says; false at its end, or when it says nothing in time."""
        if timeout_s <= 0 or not select.select([self._handle], [], [], timeout_s)[0]:
            return False
        try:
            data = os.read(self._handle, 4096)
        except OSError:  # nobody holds the other end any more
            return False
        self.said += re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|\r", "", data.decode(errors="replace"))
        return bool(data)
