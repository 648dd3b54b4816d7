"""The driver in a process of its own, so that whatever stops or delays its caller does not delay a stop."""

import os
import select
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from types import TracebackType
from typing import Any

from stereogrid.observation import Odometry

from ..clock import now_s
from ..errors import RobotError
from ..mailbox import Mailbox
from . import messages
from .limits import DEFAULT_LIMITS, Limits
from .messages import Message
from .reports import Reports
from .robot import RobotReport, RobotStatus
from .safety import check_velocity

ROOT = Path(__file__).parents[2]
CONNECT_S = 60.0
"""A slow start, and all attempts of a handshake on a serial line."""
REPLY_S = 2.0
SILENT_S = 1.0
END_S = 8.0
DIED = "the driver's process died"


def connect(
    address: str, *, limits: Limits = DEFAULT_LIMITS, log: Callable[[str], None] = lambda _: None
) -> "PioneerProcess":
    """Connect to the robot at tcp:HOST:PORT, HOST:PORT, /dev/ttyUSB0 or serial:/dev/...; its motors are off.

    limits: what may be asked of it. log: takes lines for the user, in a thread of the connection.
    Raises InvalidInputError for another address, RobotError when no robot answers, with what to look for.
    """
    return PioneerProcess(address, limits=limits, log=log)


class PioneerProcess:
    """A RobotDriver whose work is done by `python -m hardware.pioneer`; also a context manager.

    The process has a session of its own: neither Ctrl-C nor a closed terminal reaches it, and it stops the robot in
    order when this one ends, however it ends.
    """

    def __init__(
        self, address: str, *, limits: Limits = DEFAULT_LIMITS, log: Callable[[str], None] = lambda _: None
    ) -> None:
        self._notes: Mailbox[str] = Mailbox(100)
        threading.Thread(target=self._speak, args=(log,), name="pioneer log", daemon=True).start()
        self._reports = Reports()
        self._lock = threading.Lock()
        self._replied = threading.Condition(self._lock)
        self._replies: dict[int, Message] = {}
        self._number = self._changed_by = 0
        self._status, self._heard_s = RobotStatus(False, False, "", {}), now_s()
        self._closed = self._ended = False
        self._channel, theirs = messages.pair()
        with theirs:
            self._process = _start(theirs.fileno())
        self._thread = threading.Thread(target=self._listen, name="pioneer process", daemon=True)
        self._thread.start()
        try:
            self._ask("connect", CONNECT_S, address=address, limits=asdict(limits))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "PioneerProcess":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def pid(self) -> int:
        """The driver's process."""
        return self._process.pid

    def arm(self, timeout_s: float = 2.0) -> None:
        """See RobotDriver."""
        self._ask("arm", timeout_s + REPLY_S, timeout_s=timeout_s)

    def disarm(self) -> None:
        """See RobotDriver."""
        self._change("disarm", armed=False)

    def drive(self, speed_mps: float, turn_radps: float) -> None:
        """See RobotDriver."""
        check_velocity(speed_mps, turn_radps)
        status = self.status()
        if status.latched:
            raise RobotError(f"the robot does not drive: {status.latched}; reset and arm it once that is mended")
        if not status.armed:
            raise RobotError("the robot does not drive: it is not armed")
        if not status.connected:
            raise RobotError("the robot does not drive: no reports come from it")
        self._tell("drive", speed_mps=float(speed_mps), turn_radps=float(turn_radps), asked_s=now_s())

    def stop(self) -> None:
        """See RobotDriver."""
        self._tell("stop")

    def e_stop(self, reason: str = "asked for") -> None:
        """See RobotDriver."""
        latched = self.status().latched or f"e-stop ({reason})"
        self._change("e_stop", {"reason": reason}, armed=False, latched=latched)

    def reset(self) -> None:
        """See RobotDriver."""
        self._ask("reset", REPLY_S)

    def latest(self) -> RobotReport | None:
        """See RobotDriver."""
        return self._reports.latest()

    def status(self) -> RobotStatus:
        """See RobotDriver."""
        with self._lock:
            connected = self._status.connected and not self._is_silent()
            return replace(self._status, connected=connected)

    def odometry_at(self, stamp_s: float) -> Odometry | None:
        """See RobotDriver."""
        return self._reports.odometry_at(stamp_s)

    def subscribe(self, most: int = 64) -> Mailbox[RobotReport]:
        """See RobotDriver."""
        return self._reports.subscribe(most)

    def close(self) -> None:
        """See RobotDriver."""
        with self._lock:
            closed, self._closed = self._closed, True
        if closed:
            return
        with suppress(RobotError):
            self._tell("close")
        # For one that is still connecting, and reads nothing.
        self._process.terminate()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join()
        self._channel.close()

    def _listen(self) -> None:
        try:
            while (message := messages.receive(self._channel)) is not None:
                self._take(message)
        finally:
            with self._replied:
                latched = self._status.latched if self._closed else DIED
                self._status = replace(self._status, connected=False, armed=False, latched=latched)
                self._ended = True
                self._replied.notify_all()
            self._reports.close()
            self._notes.close()

    def _speak(self, log: Callable[[str], None]) -> None:
        """In a thread of its own: who is told may take its time, or fail."""
        while (note := self._notes.get(3600.0)) is not None:
            log(note)

    def _take(self, message: Message) -> None:
        if "report" in message:
            self._reports.put(messages.report_of(message["report"]))
        if "log" in message:
            self._notes.put(message["log"])
        with self._replied:
            self._heard_s = now_s()
            if "status" in message and message["seen"] >= self._changed_by:
                self._status = messages.status_of(message["status"])
            if "reply" in message:
                self._replies[message["reply"]] = message
                self._replied.notify_all()

    def _is_silent(self) -> bool:
        """Whether the driver says nothing. When it was this process that froze, what it said waits to be read."""
        return now_s() - self._heard_s > SILENT_S and not select.select([self._channel], [], [], 0)[0]

    def _change(self, name: str, arguments: Message | None = None, **status: Any) -> None:
        """Tell; what the driver will say of itself in a moment is true at once for who asks here."""
        number = self._tell(name, **(arguments or {}))
        with self._lock:
            self._changed_by = number
            self._status = replace(self._status, **status)

    def _ask(self, name: str, wait_s: float, **arguments: object) -> None:
        """Tell and wait for the reply; raises the error that it brings."""
        number = self._tell(name, asks=True, **arguments)
        with self._replied:
            self._replied.wait_for(lambda: number in self._replies or self._ended, wait_s)
            reply = self._replies.pop(number, None)
            died = self._ended
        if reply is None:
            raise RobotError(DIED if died else "the driver's process does not answer")
        if reply["error"] is not None:
            raise messages.error_of(reply["error"])

    def _tell(self, name: str, *, asks: bool = False, **arguments: object) -> int:
        """Send a message; its number. Raises RobotError when the driver's process is gone or frozen."""
        with self._lock:
            self._number += 1
            message = {"number": self._number, "do": name, "with": arguments, "asks": asks}
            try:
                self._channel.send(messages.encoded(message), messages.NO_WAIT)
            except BlockingIOError as error:
                raise RobotError("the driver's process does not read what it is told") from error
            except OSError as error:
                raise RobotError(DIED) from error
            return self._number


def _start(handle: int) -> "subprocess.Popen[bytes]":
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    return subprocess.Popen(
        [sys.executable, "-m", "hardware.pioneer"],
        stdin=handle,
        stdout=subprocess.DEVNULL,
        # Not the caller's, where a file of a fitting name would be taken for one of ours.
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,
    )
