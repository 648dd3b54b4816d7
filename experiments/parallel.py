"""Jobs on both cores, and the progress bars that show them."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager
from threading import Event
from typing import Any, Protocol, TypeVar

from rich.console import Console
from rich.progress import Progress

from stereogrid.mapping_run import Track

WORKERS = 2
Item = TypeVar("Item")
Key = TypeVar("Key")


class Step(Protocol):
    """Advances a bar by one when called; `to` sets it to a share of the whole, 0 to 1."""

    def __call__(self) -> None: ...

    def to(self, share: float) -> None:
        """Set the bar."""
        ...


Stage = Callable[[str, float], AbstractContextManager[Step]]
"""stage("mapping", 5) shows a bar of five steps for as long as it is open."""


def counted(step: Step) -> Track:
    """A tracker of items that advances step once an item."""

    def track(items: Iterable[Item], what: str, total: int) -> Iterator[Item]:  # noqa: ARG001
        for item in items:
            yield item
            step()

    return track


def until(stop: Event, track: Track) -> Track:
    """track, cut short once stop is set: the job that reads the items ends with CancelledError."""

    def stopping(items: Iterable[Item], what: str, total: int) -> Iterator[Item]:
        for item in track(items, what, total):
            if stop.is_set():
                raise CancelledError
            yield item

    return stopping


def in_parallel(
    jobs: Mapping[Key, Callable[[], Any]], done: Callable[[], None] = lambda: None, stop: Event | None = None
) -> dict[Key, Any]:
    """The jobs' results by name. Threads serve: OpenCV, Numba and embree let go of the interpreter.

    done is called after each job. The first exception, an interrupt too, stops what has not begun, sets stop for
    what runs, and is raised.
    """
    with ThreadPoolExecutor(WORKERS) as pool:
        futures = {pool.submit(job): name for name, job in jobs.items()}
        try:
            results = {}
            for future in as_completed(futures):
                results[futures[future]] = future.result()
                done()
        except BaseException:
            if stop is not None:
                stop.set()
            pool.shutdown(cancel_futures=True)
            raise
    return {name: results[name] for name in jobs}


@contextmanager
def rich_stage(what: str, total: float) -> Iterator[Step]:
    """A Stage that draws its bar on stderr, where that is a terminal, and leaves nothing behind."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(what, total=total)

        class Bar:
            def __call__(self) -> None:
                progress.advance(task)

            def to(self, share: float) -> None:
                progress.update(task, completed=share * total)

        yield Bar()


@contextmanager
def silent_stage(what: str, total: float) -> Iterator[Step]:  # noqa: ARG001
    """A Stage that shows nothing."""

    class Silence:
        def __call__(self) -> None:
            pass

        def to(self, share: float) -> None:
            pass

    yield Silence()
