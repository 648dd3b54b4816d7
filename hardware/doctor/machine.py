"""The computer itself: programs, Python packages, room on the disk, the clock."""

import importlib.util
import shutil
import time
from collections.abc import Callable
from pathlib import Path

from stereogrid.checks import OK, PROBLEM, WARNING, Check

PAIR_BYTES = 2 * 320 * 240
RATE_HZ = 30.0
"""What is recorded by default, raw: 4.6 MB/s."""
LEAST_FREE_S, FEW_FREE_S = 60.0, 20 * 60.0
BORN_S = 1735689600.0
"""2025-01-01: a clock that says less was never set, as on a small board without a battery for it."""
EXTRAS = {
    "serial": ("pyserial", "hardware", "a robot on a serial line"),
    "viser": ("viser", "view", "the map in a browser"),
}


def check_tool(which: Callable[[str], str | None] = shutil.which) -> Check:
    """v4l2-ctl locks exposure and white balance."""
    path = which("v4l2-ctl")
    if path:
        return Check("v4l2-ctl", OK, path)
    return Check(
        "v4l2-ctl",
        WARNING,
        "not installed: exposure and white balance stay automatic, and differ between the two cameras",
        "sudo apt install v4l-utils",
    )


def check_extra(module: str, has: Callable[[str], object] = importlib.util.find_spec) -> Check:
    """An optional package, by what is imported."""
    package, extra, purpose = EXTRAS[module]
    if has(module) is not None:
        return Check(package, OK, f"installed, for {purpose}")
    return Check(package, WARNING, f"not installed: {purpose} needs it", f'pip install "stereogrid[{extra}]"')


def check_disk(folder: Path, free_bytes: Callable[[Path], int] = lambda path: shutil.disk_usage(path).free) -> Check:
    """Room for recordings in a folder."""
    name = "room for recordings"
    try:
        free = free_bytes(folder)
    except OSError as error:
        return Check(name, PROBLEM, f"{folder}: {error.strerror}", "name a folder that is there: --folder")
    lasts_s = free / (PAIR_BYTES * RATE_HZ)
    found = f"{free / 1e9:.1f} GB free in {folder}: {_duration(lasts_s)} of 320x240 at {RATE_HZ:g} Hz"
    values = {"free_bytes": free}
    if lasts_s >= FEW_FREE_S:
        return Check(name, OK, found, values=values)
    state = PROBLEM if lasts_s < LEAST_FREE_S else WARNING
    return Check(name, state, found, "delete what is not needed, or record to another disk (--out)", values)


def check_clock(epoch_s: Callable[[], float] = time.time) -> Check:
    """The wall clock, which names and dates recordings; stamps are of the monotonic one, as the kernel's are."""
    now = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(epoch_s()))
    if epoch_s() >= BORN_S:
        return Check("clock", OK, now)
    return Check("clock", WARNING, f"{now}: was it ever set?", "sudo timedatectl set-ntp true, before recording")


def check_machine(folder: Path) -> list[Check]:
    """All of the above."""
    return [check_tool(), *(check_extra(module) for module in EXTRAS), check_disk(folder), check_clock()]


def _duration(duration_s: float) -> str:
    if duration_s < 2 * 60:
        return f"{duration_s:.0f} s"
    return f"{duration_s / 60:.0f} min" if duration_s < 2 * 3600 else f"{duration_s / 3600:.0f} h"
