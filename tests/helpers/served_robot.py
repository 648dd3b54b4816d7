"""A loop in a thread of its own, with a kinematic body unless another is given, for a `with`."""

import threading
from collections.abc import Callable
from types import TracebackType

from kinematic_body import TICK_S, KinematicBody

from sim.firmware.firmware import Firmware
from sim.firmware.links import Link
from sim.firmware.loop import Loop
from sim.firmware.pacer import Pacer
from sim.firmware.senses import Body


class ServedRobot:
    """speed_up: simulated seconds a second. Leaving the `with` raises what went wrong in the thread."""

    def __init__(
        self,
        link: Link,
        body: Body | None = None,
        *,
        subclass: str = "p3at",
        speed_up: float = 1.0,
        renew: Callable[[], Body] | None = None,
    ) -> None:
        self.link = link
        self.body = body or KinematicBody()
        self.firmware = Firmware(subclass)
        self.lines: list[str] = []
        self.loop = Loop(self.body, self.firmware, link, Pacer(TICK_S / speed_up), self.lines.append, renew=renew)
        self._stop = threading.Event()
        self._error: BaseException | None = None
        self.thread = threading.Thread(target=self._run, daemon=True)

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

    def _run(self) -> None:
        try:
            self.loop.run(lambda: not self._stop.is_set())
        except BaseException as error:
            self._error = error
