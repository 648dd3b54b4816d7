"""How long it takes until the robot stands, event by event; nothing is asserted. `python tests/bench/stops.py`

From .25 m/s (keys) or .3 m/s, on the simulated firmware with a body that follows its ramps: what it says of an e-stop
or a bumper is when it was obeyed, not how hard a real robot brakes.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from driven_robot import calling, drive_for, served, stood_at_s, until
from helm_bench import Bench
from served_robot import ServedRobot
from troubled_links import TroubledLink

from hardware.errors import RobotError
from hardware.pioneer.driver import Pioneer

REPEATS = 5


@contextmanager
def driven(kind: str = "tcp") -> Iterator[tuple[ServedRobot, TroubledLink, Pioneer]]:
    """A robot at .3 m/s."""
    with served(kind) as (robot, link), Pioneer(link.name) as driver:
        driver.arm()
        drive_for(driver, 1.2, 0.3, 0.0)
        yield robot, link, driver


def stale_command() -> float:
    with driven() as (robot, _, driver):
        asked_s = drive_for(driver, 0.2, 0.3, 0.0)
        return stood_at_s(robot) - asked_s


def emergency_stop() -> float:
    with driven() as (robot, _, driver):
        pressed_s = time.monotonic()
        driver.e_stop()
        return stood_at_s(robot) - pressed_s


def bumper() -> float:
    with driven() as (robot, _, _driver):
        touched_s = time.monotonic()
        robot.body.bumpers = (2, 0)  # type: ignore[misc]
        return stood_at_s(robot) - touched_s


def silent_robot() -> float:
    with driven() as (robot, link, driver):
        link.mute, silent_s = True, time.monotonic()
        with suppress(RobotError):
            drive_for(driver, 3.0, 0.3, 0.0)
        stood_s = stood_at_s(robot)
        link.mute = False
        return stood_s - silent_s


def ended(kind: str, ending: signal.Signals, *, driver: bool = False) -> float:
    """A program that drives is stopped or killed, or the driver's process."""
    with served(kind) as (robot, link), calling(link.name) as caller:
        until(lambda: robot.ticks[-1][1] > 0.2)
        ended_s = time.monotonic()
        os.kill(caller.driver_pid if driver else caller.process.pid, ending)
        return stood_at_s(robot) - ended_s


def key_let_go() -> float:
    with ExitStack() as things:
        bench = Bench(things)
        bench.arm()
        with bench.hand.holding("w"):
            bench.until(lambda: bench.speed_mps() > 0.24)
        return bench.rest() - bench.hand.let_go_s


def camera_cut() -> float:
    with ExitStack() as things:
        bench = Bench(things)
        bench.arm()
        with bench.hand.holding("w"):
            bench.until(lambda: bench.speed_mps() > 0.24)
            bench.pictures.cut.set()
            bench.until(lambda: bench.speed_mps() < 1e-9)
            return bench.rest() - bench.pictures.last_s


EVENTS: dict[str, Callable[[], float]] = {
    "the key is let go": key_let_go,
    "no new command": stale_command,
    "the program freezes": lambda: ended("tcp", signal.SIGSTOP),
    "the program is killed": lambda: ended("tcp", signal.SIGKILL),
    "the driver's process is killed": lambda: ended("pty", signal.SIGKILL, driver=True),
    "no report from the robot": silent_robot,
    "emergency stop": emergency_stop,
    "a bumper": bumper,
    "the last picture": camera_cut,
}


def main() -> None:
    sys.stdout.write(f"seconds until the wheels stand, {REPEATS} times: least, median, most\n")
    for name, event in EVENTS.items():
        took_s = [event() for _ in range(REPEATS)]
        sys.stdout.write(f"{name:32} {min(took_s):5.2f} {median(took_s):5.2f} {max(took_s):5.2f}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
