"""Interrupts that are raised, or that wait until what is being done is done."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def raised_interrupts() -> Iterator[None]:
    """Within it an interrupt, unless it is ignored, and a request to terminate are raised as KeyboardInterrupt."""
    if threading.current_thread() is not threading.main_thread():  # where no signal arrives
        yield
        return
    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    numbers = [signal.SIGTERM] if ignored else [signal.SIGTERM, signal.SIGINT]
    before = {each: signal.getsignal(each) for each in numbers}
    try:
        for each in numbers:
            signal.signal(each, signal.default_int_handler)
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


@contextmanager
def held_interrupts(*others: signal.Signals) -> Iterator[Callable[[], bool]]:
    """Within it an interrupt (SIGINT) or a request to terminate does no more than make the function given true.

    others: signals that shall do the same.

    Raised in the midst of a kernel of Numba it would come out as another error, and in a destructor as none.
    """
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():  # where no signal arrives
        yield stop.is_set
        return
    before = {each: signal.signal(each, lambda *_: stop.set()) for each in (signal.SIGINT, signal.SIGTERM, *others)}
    try:
        yield stop.is_set
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Within it an interrupt waits, and is raised at its end: for imports, since some libraries swallow one there."""
    with held_interrupts() as interrupted:
        yield
    if interrupted():
        raise KeyboardInterrupt
