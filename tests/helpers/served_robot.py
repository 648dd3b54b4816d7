"""A loop in a thread of its own, with a kinematic body unless another is given, for a `with`."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from kinematic_body import TICK_S, KinematicBody

import arcos
from arcos import Command, PacketParser
from sim.firmware.firmware import Firmware
from sim.firmware.links import Link
from sim.firmware.loop import Loop
from sim.firmware.pacer import Pacer
from sim.firmware.senses import Body


@dataclass(frozen=True)
class Heard:
    """A packet that reached the firmware: when, by time.monotonic(), and whether the robot was open then."""

    stamp_s: float
    command: Command
    was_open: bool


class ListeningFirmware(Firmware):
    """Notes whatever it is told."""

    def __init__(self, subclass: str = "p3at") -> None:
        super().__init__(subclass)
        self.heard: list[Heard] = []
        self._own_parser = PacketParser()

    def receive(self, data: bytes, now_s: float) -> bytes:
        for body in self._own_parser.feed(data):
            self.heard.append(Heard(time.monotonic(), Command.decode(body), self.is_open))
        return super().receive(data, now_s)


class ServedRobot:
    """speed_up: simulated seconds a second. Leaving the `with` raises what went wrong in the thread.

    ticks: (time.monotonic(), wheel speeds' mean size [m/s]) after each of its steps.
    """

    def __init__(
        self,
        link: Link,
        body: Body | None = None,
        *,
        subclass: str = "p3at",
        firmware: "ListeningFirmware | None" = None,
        speed_up: float = 1.0,
        renew: Callable[[], Body] | None = None,
    ) -> None:
        self.link = link
        self.body = body or KinematicBody()
        self.firmware = firmware or ListeningFirmware(subclass)
        self.lines: list[str] = []
        self.ticks: list[tuple[float, float]] = []
        self.loop = Loop(
            self.body, self.firmware, link, Pacer(TICK_S / speed_up), self.lines.append, self._watch, renew=renew
        )
        self._stop = threading.Event()
        self._error: BaseException | None = None
        self.thread = threading.Thread(target=self._run, daemon=True)

    @property
    def heard(self) -> list[Heard]:
        """All packets so far."""
        return list(self.firmware.heard)

    def commands(self, *codes: arcos.Code) -> list[tuple[int, int | bytes | None]]:
        """(code, argument) of all packets, or of those codes."""
        said = [(each.command.code, each.command.argument) for each in self.heard]
        return [(code, argument) for code, argument in said if not codes or code in codes]

    def __enter__(self) -> "ServedRobot":
        self.loop.pacer.restart()
        self.thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self.thread.join(20)
        self.link.close()
        if self._error is not None:
            raise self._error

    def _watch(self, body: Body) -> None:
        self.ticks.append((time.monotonic(), float(abs(body.wheel_speeds_mps).mean())))

    def _run(self) -> None:
        try:
            self.loop.run(lambda: not self._stop.is_set())
        except BaseException as error:
            self._error = error
