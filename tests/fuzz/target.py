"""What is fuzzed: a reader of foreign bytes, and the rules that it obeys whatever the bytes."""

import signal
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from arcos import ArcosError
from stereogrid.errors import StereogridError

SLOWEST_S = 10.0
"""For an input of a few kilobytes; on a machine that does other things too."""
MOST_BYTES = 256 << 20
"""More than this no input of a few kilobytes may make a reader ask for."""
ALLOWED = (StereogridError, ArcosError)

REACHING_OUT = ("os.system", "subprocess.Popen", "os.exec", "os.posix_spawn", "socket.connect", "pickle.find_class")

Read = Callable[[bytes, Path], None]


@dataclass(frozen=True)
class Target:
    """samples(folder): valid inputs; read(data, folder): hands data to the reader, through files in folder if need be.

    The reader answers, or raises one of ALLOWED.
    """

    samples: Callable[[Path], list[bytes]]
    read: Read


class RuleBrokenError(Exception):
    """A rule was broken; the message says which."""


class Watch:
    """Whether a reader keeps to its folder and executes nothing; one for the process, since audit hooks stay."""

    def __init__(self) -> None:
        self._folder: Path | None = None
        self._seen: list[str] = []
        sys.addaudithook(self._hear)

    @contextmanager
    def inside(self, folder: Path) -> Iterator[None]:
        """Within it, writing or reading outside of the folder, and executing anything, breaks a rule."""
        self._folder, self._seen = folder.resolve(), []
        try:
            yield
        finally:
            self._folder = None
        if self._seen:
            raise RuleBrokenError(self._seen[0])

    def _hear(self, event: str, args: tuple[Any, ...]) -> None:
        folder = self._folder
        if folder is None:
            return
        if event in (
            "os.system",
            "subprocess.Popen",
            "os.exec",
            "os.posix_spawn",
            "socket.connect",
            "pickle.find_class",
        ):
            self._seen.append(f"it reached out: {event} {args[:1]}")
        elif event == "open" and isinstance(args[0], str | bytes) and not self._is_allowed(args, folder):
            self._seen.append(f"it opened {args[0]!r}")

    @staticmethod
    def _is_allowed(args: tuple[Any, ...], folder: Path) -> bool:
        path = args[0].decode(errors="replace") if isinstance(args[0], bytes) else args[0]
        # Modules are imported, and kernels come from Numba's cache.
        code = path.endswith((".py", ".pyc", ".nbi", ".nbc", ".so", ".json", ".zip")) or "__pycache__" in path
        return code or path.startswith(("/proc/", "/sys/", "/dev/")) or Path(path).resolve().is_relative_to(folder)


def attempt(target: Target, data: bytes, folder: Path, watch: Watch) -> bool:
    """Let the reader have data: True where it answers, False where it refuses. Raises whatever breaks a rule."""
    tracemalloc.reset_peak() if tracemalloc.is_tracing() else tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    with _in_time(), watch.inside(folder):
        try:
            target.read(data, folder)
            answered = True
        except ALLOWED:
            answered = False
    peak = tracemalloc.get_traced_memory()[1] - before
    if peak > MOST_BYTES:
        raise RuleBrokenError(f"{peak >> 20} MB for {len(data)} bytes")
    return answered


@contextmanager
def _in_time() -> Iterator[None]:
    def late(number: int, frame: FrameType | None) -> None:
        raise RuleBrokenError(f"more than {SLOWEST_S:g} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, SLOWEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
