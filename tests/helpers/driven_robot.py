"""A robot that is served, who drives it, and when it stood: for tests and benchmarks of what stops it.

Times are taken where the robot is, from what reached its firmware and from its wheels.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from served_robot import Heard, ListeningFirmware, ServedRobot
from troubled_links import TroubledLink

from arcos import Code, Command
from hardware.pioneer import RobotDriver
from sim.firmware.tcp import TcpLink
from sim.firmware.terminal import TerminalLink

ROOT = Path(__file__).parents[2]
HELPERS = ROOT / "tests/helpers"


@contextmanager
def served(
    kind: str, *, error_rate: float = 0.0, firmware: ListeningFirmware | None = None
) -> Iterator[tuple[ServedRobot, TroubledLink]]:
    """A robot that is served over a link of a kind; the link's troubles are off."""
    link = TroubledLink(TcpLink(0) if kind == "tcp" else TerminalLink(), error_rate=error_rate, seed=11)
    with ServedRobot(link, firmware=firmware) as robot:
        yield robot, link


def until(true: Callable[[], object], within_s: float = 15.0) -> None:
    """Wait until something is true, which it must become."""
    end_s = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end_s, "it did not happen"
        time.sleep(0.005)


def drive_for(driver: RobotDriver, duration_s: float, speed_mps: float = 0.25, turn_radps: float = 0.1) -> float:
    """Drive by fresh commands; when the last was given."""
    end_s = time.monotonic() + duration_s
    asked_s = 0.0
    while time.monotonic() < end_s:
        asked_s = time.monotonic()
        driver.drive(speed_mps, turn_radps)
        time.sleep(0.05)
    return asked_s


def first(robot: ServedRobot, code: Code, argument: int | None, since_s: float, within_s: float = 15.0) -> Heard:
    """The first such packet that reached the robot since then."""
    found: list[Heard] = []

    def come() -> bool:
        found[:] = [h for h in robot.heard if h.stamp_s > since_s and h.command == Command(code, argument)]
        return bool(found)

    until(come, within_s)
    return found[0]


def stood_at_s(robot: ServedRobot) -> float:
    """When its wheels came to rest for good; waits for it."""
    until(lambda: len(robot.ticks) > 30 and all(speed < 1e-9 for _, speed in robot.ticks[-15:]))
    return max((s for s, speed in robot.ticks if speed > 0), default=0.0)


def moved_since(robot: ServedRobot, since_s: float) -> float:
    """The highest speed of its wheels since then [m/s]."""
    return max((speed for s, speed in robot.ticks if s > since_s), default=0.0)


class Caller:
    """A program of its own that drives the robot."""

    def __init__(self, address: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(HELPERS / "robot_caller.py"), address],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self.process.stdout is not None
        said = self.process.stdout.readline()
        self.driver_pid = int(said) if said else pytest.fail(self.process.communicate()[1])

    def signal(self, number: int) -> float:
        """Send a signal; when."""
        now_s = time.monotonic()
        self.process.send_signal(number)
        return now_s

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()
        until(lambda: not Path(f"/proc/{self.driver_pid}").exists())


@contextmanager
def calling(address: str) -> Iterator[Caller]:
    caller = Caller(address)
    try:
        yield caller
    finally:
        caller.end()
