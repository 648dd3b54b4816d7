"""One clock for all that is stamped: seconds of time.monotonic(), which is also the kernel's for video buffers."""

import time

_EPOCH_OFFSET_S = time.time() - time.monotonic()
"""Taken once, so that a wall clock that is set while a drive is recorded tears no hole into its stamps."""


def now_s() -> float:
    """Now, on the clock of all stamps here [s]."""
    return time.monotonic()


def slept_s() -> float:
    """How long this computer has slept since it was started [s]: now_s stands still meanwhile."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)


def to_epoch_s(stamp_s: float) -> float:
    """A stamp as seconds since 1970, as recordings hold it."""
    return stamp_s + _EPOCH_OFFSET_S
