"""A helm with real keys, real pictures, the real driver and the simulated firmware."""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack

from live_rig import Hand, Pictures
from served_robot import ServedRobot

from hardware.cameras import open_cameras
from hardware.live.helm import Helm, Speeds
from hardware.live.keyboard import Keyboard
from hardware.live.notes import Notes
from hardware.pioneer.driver import Pioneer
from sim.firmware.tcp import TcpLink


class Bench:
    """A helm with all that it rules."""

    def __init__(self, things: ExitStack) -> None:
        self.robot = things.enter_context(ServedRobot(TcpLink(0)))
        self.pictures = things.enter_context(Pictures())
        self.hand = things.enter_context(Hand())
        self.cameras = things.enter_context(open_cameras(self.pictures.url))
        self.driver = things.enter_context(Pioneer(self.robot.link.name))
        self.keys = things.enter_context(Keyboard(self.hand.terminal))
        self.notes, self.ready, self.ending = Notes(), True, False
        self.said: list[str] = []
        self.helm = Helm(
            self.driver,
            self.cameras,
            self.keys,
            self.notes,
            speeds=Speeds(0.25, math.radians(20)),
            ready=lambda: self.ready,
            ending=lambda: self.ending,
        )
        self.helm.start()
        things.callback(self.helm.end)
        self.until(self.helm.fresh)

    def until(self, true: Callable[[], object], within_s: float = 15.0) -> None:
        """Wait until something is true, which it must become."""
        end_s = time.monotonic() + within_s
        while not true():
            assert time.monotonic() < end_s, (self.heard(), self.driver.status(), self.helm.fault)
            time.sleep(0.005)

    def heard(self) -> list[str]:
        """What the user has been told so far."""
        self.said += self.notes.take()
        return self.said

    def arm(self) -> None:
        self.hand.type("m")
        self.until(lambda: any("motors ON" in line for line in self.heard()))

    def speed_mps(self) -> float:
        return self.robot.ticks[-1][1] if self.robot.ticks else 0.0

    def rest(self) -> float:
        """Wait until the wheels rest; when they came to rest."""
        self.until(lambda: all(speed < 1e-9 for _, speed in self.robot.ticks[-10:]))
        return max((s for s, speed in self.robot.ticks if speed > 0), default=0.0)

    def moved(self) -> bool:
        return any(speed > 0 for _, speed in self.robot.ticks)
