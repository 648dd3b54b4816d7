"""Keys of a real pseudo-terminal, which is as it was afterwards."""

import os
import select
import signal
import termios
from collections.abc import Iterator
from contextlib import suppress

import pytest

from hardware.errors import HardwareError
from hardware.live.keyboard import Keyboard, split_keys


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    """(the end that types, the terminal)."""
    ends = os.openpty()
    yield ends
    for end in ends:
        with suppress(OSError):
            os.close(end)


def all_keys(keyboard: Keyboard, count: int) -> list[str]:
    keys: list[str] = []
    for _ in range(50):
        keys += keyboard.read(0.1)
        if len(keys) >= count:
            break
    return keys


def test_keys_come_one_by_one_without_enter(terminal: tuple[int, int]) -> None:
    hand, tty = terminal
    with Keyboard(tty) as keyboard:
        assert keyboard.read(0.0) == []
        os.write(hand, b"wW \x1b[A\x1bOD+")
        assert all_keys(keyboard, 6) == ["w", "w", "space", "up", "left", "+"]


def test_an_arrow_that_comes_in_pieces_is_one_key_and_a_lone_escape_is_one_too(terminal: tuple[int, int]) -> None:
    hand, tty = terminal
    with Keyboard(tty) as keyboard:
        os.write(hand, b"\x1b")
        assert keyboard.read(1.0) == []
        os.write(hand, b"[C")
        assert keyboard.read(1.0) == ["right"]
        os.write(hand, b"\x1b")
        assert [*keyboard.read(1.0), *keyboard.read(0.05)] == ["escape"]


def test_keys_of_unknown_names_harm_nobody() -> None:
    assert split_keys(b"\xff\x1b[5~w\x00")[0][-2:] == ["w", "\x00"]


def test_what_was_typed_before_can_be_forgotten(terminal: tuple[int, int]) -> None:
    hand, tty = terminal
    with Keyboard(tty) as keyboard:
        os.write(hand, b"wwwm")
        keyboard.flush()
        assert keyboard.read(0.05) == []


@pytest.mark.parametrize("error", [None, KeyboardInterrupt, RuntimeError])
def test_the_terminal_is_put_back_whatever_happens(
    terminal: tuple[int, int], error: type[BaseException] | None
) -> None:
    _, tty = terminal
    before = termios.tcgetattr(tty)
    try:
        with Keyboard(tty):
            assert termios.tcgetattr(tty) != before
            if error is not None:
                raise error
    except (KeyboardInterrupt, RuntimeError):
        pass
    assert termios.tcgetattr(tty) == before


def read_until(hand: int, end: bytes, said: bytes = b"") -> bytes:
    """What the terminal shows, up to this."""
    while not said.endswith(end):
        assert select.select([hand], [], [], 20.0)[0], f"nothing more came after {said!r}"
        said += os.read(hand, 100)
    return said


def test_no_slip_suspends_or_kills_the_program_or_freezes_its_screen_but_ctrl_c_interrupts(
    terminal: tuple[int, int],
) -> None:
    hand, tty = terminal
    pid = os.fork()
    if pid == 0:  # a process whose own terminal this is, as a shell would start it
        os.setsid()
        os.close(os.open(os.ttyname(tty), os.O_RDWR))
        signal.signal(signal.SIGINT, lambda *_: os._exit(7))
        with Keyboard(tty) as keyboard:
            os.write(tty, b"ready")
            while "x" not in keyboard.read(5.0):
                pass
            os.write(tty, b"alive")
            keyboard.read(5.0)
        os._exit(1)
    said = read_until(hand, b"ready")
    os.write(hand, b"\x1a\x1c\x13x")
    read_until(hand, b"alive", said)
    os.write(hand, b"\x03")
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 7


def test_a_terminal_that_is_closed_is_noticed_and_is_no_error(terminal: tuple[int, int]) -> None:
    hand, tty = terminal
    with Keyboard(tty) as keyboard:
        assert not keyboard.gone
        os.close(hand)
        assert keyboard.read(1.0) == [] and keyboard.gone


def test_what_is_no_terminal_is_refused_with_the_way_out() -> None:
    end, other = os.pipe()
    with pytest.raises(HardwareError, match=r"no terminal|not: .*--no-teleop"):
        Keyboard(end)
    os.close(end)
    os.close(other)
