"""What happens again and again is said once in a while, and what happens besides is said at once."""

import threading

import pytest

from hardware.live import notes as module
from hardware.live.notes import AGAIN_S, Notes


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    times = [100.0]
    monkeypatch.setattr(module, "now_s", lambda: times[0])
    return times


def test_a_held_key_with_dead_pictures_says_its_line_once_in_two_seconds_though_its_numbers_change(
    clock: list[float],
) -> None:
    notes, said = Notes(), []
    for k in range(101):
        clock[0] = 100.0 + 0.05 * k
        notes.add(f"nothing moves without pictures: nothing new since {0.5 + 0.05 * k:.1f} s")
        said += notes.take()
    assert len(said) == 1 + int(5.0 / AGAIN_S) and said[0].endswith("since 0.5 s")


def test_lines_that_differ_in_more_than_numbers_are_all_said_in_their_order(clock: list[float]) -> None:
    lines = ["/dev/video0 is gone", "/dev/video2 is gone", "motors off", "reset"]
    notes = Notes()
    for line in [*lines, *lines]:
        notes.add(line)
    assert notes.take() == lines and notes.take() == []


def test_what_was_said_long_ago_is_forgotten(clock: list[float]) -> None:
    notes = Notes()
    for k in range(1000):
        clock[0] += 0.1
        notes.add("a fault named " + "x" * k)
    assert len(notes._said) <= AGAIN_S / 0.1 + 1


def test_many_threads_may_speak_at_once() -> None:
    notes, faults = Notes(), []

    def speak(name: str) -> None:
        try:
            for k in range(300):
                notes.add(name * (1 + k))
        except RuntimeError as error:
            faults.append(error)

    threads = [threading.Thread(target=speak, args=(name,)) for name in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not faults and len(notes.take()) == module.MOST
