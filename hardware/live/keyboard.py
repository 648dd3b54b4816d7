"""Single keys from a terminal, which is put back as it was whatever happens."""

import os
import select
import sys
import termios
import tty
from types import TracebackType

from ..errors import HardwareError

NAMED = {
    b"\x1b[A": "up",
    b"\x1b[B": "down",
    b"\x1b[C": "right",
    b"\x1b[D": "left",
    b"\x1bOA": "up",
    b"\x1bOB": "down",
    b"\x1bOC": "right",
    b"\x1bOD": "left",
    b"\x1b": "escape",
    b" ": "space",
}
_LONGEST = 3


class Keyboard:
    """Keys of a terminal, without Enter and unseen; Ctrl-C still interrupts. Use as a context manager.

    Ctrl-Z, Ctrl-S and Ctrl-\\ do nothing: who drives a robot must not be able to suspend the program or its status
    line, or to kill it with its map, by a slip. Raises HardwareError where fd is no terminal.
    """

    def __init__(self, fd: int | None = None) -> None:
        self._fd = sys.stdin.fileno() if fd is None else fd
        if not os.isatty(self._fd):
            raise HardwareError(
                "the keys to drive with are read from a terminal, which standard input is not: "
                "start it in one, or choose --no-teleop"
            )
        self._gone = False
        self._before = termios.tcgetattr(self._fd)
        self._pending = b""

    @property
    def gone(self) -> bool:
        """Whether the terminal was closed."""
        return self._gone

    def __enter__(self) -> "Keyboard":
        tty.setcbreak(self._fd)
        settings = termios.tcgetattr(self._fd)
        settings[0] &= ~termios.IXON
        disabled = bytes([os.fpathconf(self._fd, "PC_VDISABLE")])
        settings[6][termios.VSUSP] = settings[6][termios.VQUIT] = disabled
        termios.tcsetattr(self._fd, termios.TCSADRAIN, settings)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            termios.tcsetattr(self._fd, termios.TCSAFLUSH, self._before)
        except termios.error:
            self._gone = True

    def flush(self) -> None:
        """Forget what was typed and not read."""
        termios.tcflush(self._fd, termios.TCIFLUSH)

    def read(self, timeout_s: float) -> list[str]:
        """The keys that came, by their letter or their name in NAMED; [] when none does within timeout_s."""
        ready, _, _ = select.select([self._fd], [], [], timeout_s)
        if not ready:
            # An escape that nothing followed was the key itself.
            keys, self._pending = split_keys(self._pending, whole=True)
            return keys
        try:
            data = os.read(self._fd, 1024)
        except OSError:
            data = b""
        self._gone = not data
        keys, self._pending = split_keys(self._pending + data)
        return keys


def split_keys(data: bytes, *, whole: bool = False) -> tuple[list[str], bytes]:
    """The keys in what a terminal sent, and the beginning of one whose rest may still come (none when whole)."""
    keys: list[str] = []
    while data:
        if not whole and len(data) < _LONGEST and any(name.startswith(data) and name != data for name in NAMED):
            return keys, data
        size = next((n for n in range(_LONGEST, 0, -1) if data[:n] in NAMED), 1)
        key, data = data[:size], data[size:]
        keys.append(NAMED.get(key) or key.decode("ascii", "replace").lower())
    return keys, b""
