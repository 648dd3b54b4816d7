"""Lines for the user from any thread, which wait for nobody."""

import re
import threading

from ..clock import now_s
from ..mailbox import Mailbox

MOST = 50
AGAIN_S = 2.0
_NUMBER = re.compile(r"(?<!\w)\d[\d.]*")
"""Not the 0 in /dev/video0, which is a name."""


class Notes:
    """Lines that happened, in their order; the same line again within AGAIN_S, or with other numbers, is said once."""

    def __init__(self) -> None:
        self._lines: Mailbox[str] = Mailbox(MOST)
        self._lock = threading.Lock()
        self._said: dict[str, float] = {}

    def add(self, line: str) -> None:
        """Say this when somebody looks."""
        kind, when_s = _NUMBER.sub("#", line), now_s()
        with self._lock:
            self._said = {said: said_s for said, said_s in self._said.items() if when_s - said_s < AGAIN_S}
            if kind in self._said:
                return
            self._said[kind] = when_s
        self._lines.put(line)

    def take(self) -> list[str]:
        """The lines since the last time."""
        taken = []
        while (line := self._lines.get(0.0)) is not None:
            taken.append(line)
        return taken
