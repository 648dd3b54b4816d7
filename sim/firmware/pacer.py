"""Ticks that follow a clock."""

import time
from collections.abc import Callable

MOST_TICKS = 5
"""Ticks made up for in one go. A machine that is later than that lets simulated time slip."""


class Pacer:
    """Says when ticks of tick_s are due. slips: how often the machine was too late; lost_s: what was let go by that."""

    def __init__(
        self,
        tick_s: float,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._tick_s, self._clock, self._sleep = tick_s, clock, sleep
        self.slips = 0
        self.lost_s = 0.0
        self.restart()

    def restart(self) -> None:
        """The next tick is one tick from now."""
        self._next_s = self._clock() + self._tick_s

    def now_s(self) -> float:
        """What the clock says."""
        return self._clock()

    def wait(self) -> int:
        """Wait until a tick is due; how many are: 1 to MOST_TICKS."""
        now_s = self._clock()
        while now_s < self._next_s:
            self._sleep(self._next_s - now_s)
            now_s = self._clock()
        due = 1 + int((now_s - self._next_s) / self._tick_s)
        if due <= MOST_TICKS:
            self._next_s += due * self._tick_s
            return due
        self.slips += 1
        self.lost_s += (due - MOST_TICKS) * self._tick_s
        self._next_s += due * self._tick_s
        return MOST_TICKS
