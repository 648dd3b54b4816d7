"""How far a match has come, and whether its time is up."""

import threading
import time
from collections.abc import Callable
from typing import Any

from ..errors import InvalidInputError


def check_time_budget(time_budget_s: Any) -> None:
    """Raise InvalidInputError unless the time is None, no limit, or at least 0 [s]."""
    if time_budget_s is not None and not (isinstance(time_budget_s, (int, float)) and time_budget_s >= 0):
        raise InvalidInputError(f"time_budget_s must be at least 0 or None, not {time_budget_s!r}")


class Meter:
    """Counts the steps of a match from several threads, and tells the caller the share that is done."""

    def __init__(self, steps: int, time_budget_s: float | None, progress: Callable[[float], None] | None) -> None:
        self._steps, self._done, self._progress = steps, 0, progress
        self._deadline_s = None if time_budget_s is None else time.monotonic() + time_budget_s
        self._lock = threading.Lock()

    def step(self, count: int = 1) -> None:
        """Some steps are done."""
        if self._progress is None:
            return
        with self._lock:
            self._done += count
            self._progress(self._done / self._steps)

    @property
    def late(self) -> bool:
        """Whether the time is up: the labelling found so far must do."""
        return self._deadline_s is not None and time.monotonic() >= self._deadline_s
