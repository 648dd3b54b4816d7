"""An interrupt that comes at a bad moment waits for a good one, and is not lost."""

import os
import signal

import pytest

from stereogrid.interrupts import held_interrupts, undisturbed


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_during_imports_is_raised_after_them(number: signal.Signals) -> None:
    swallowed = finished = False
    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt), undisturbed():
        try:
            os.kill(os.getpid(), number)
        except BaseException:  # as some libraries do while they are imported
            swallowed = True
        finished = True
    assert finished and not swallowed
    assert signal.getsignal(number) is before


def test_without_an_interrupt_nothing_is_raised() -> None:
    with undisturbed():
        pass
    with held_interrupts() as interrupted:
        assert not interrupted()


def test_what_goes_wrong_while_interrupts_are_held_is_raised_and_they_are_free_again() -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(ImportError), undisturbed():
        raise ImportError
    assert signal.getsignal(signal.SIGINT) is before
