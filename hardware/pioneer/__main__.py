"""`python -m hardware.pioneer`: the driver's own process, started by hardware.pioneer.process with a socket as stdin.

It ends, with the robot stopped in order, when its caller closes the socket or dies, and at a SIGTERM. Ctrl-C in a
terminal is for the caller alone.
"""

import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict

from stereogrid.errors import StereogridError

from .driver import Pioneer
from .limits import Limits
from .messages import NO_WAIT, Message, encoded, error_fields, receive, report_fields

CHECK_S = 0.1
FORWARD_S = 0.05
STATUS_S = 0.2


class Host:
    """Runs a driver for the caller at the other end of a channel."""

    def __init__(self, channel: socket.socket) -> None:
        self._channel = channel
        self._caller = os.getppid()
        self._ended = threading.Event()
        self._seen = 0
        for ignored in (signal.SIGINT, signal.SIGHUP):
            signal.signal(ignored, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, lambda *_: self._ended.set())
        channel.settimeout(CHECK_S)

    def run(self) -> None:
        """Connect, obey, and close when the caller ends."""
        first = self._next()
        if first is None:
            return
        address, limits = first["with"]["address"], Limits(**first["with"]["limits"])
        try:
            driver = Pioneer(address, limits=limits, log=self._log, going=self._going)
        except StereogridError as error:
            self._tell({"reply": first["number"], "error": error_fields(error)})
            return
        with driver:
            self._tell({"reply": first["number"], "error": None, **self._status(driver)})
            threading.Thread(target=self._forward, args=(driver,), daemon=True).start()
            while (message := self._next()) is not None and message["do"] != "close":
                self._obey(driver, message)

    def _going(self) -> bool:
        """Whether the caller lives. Its end of the channel may outlive it in a child that it forked."""
        return not self._ended.is_set() and os.getppid() == self._caller

    def _next(self) -> Message | None:
        while self._going():
            with suppress(TimeoutError):
                return receive(self._channel)
        return None

    def _obey(self, driver: Pioneer, message: Message) -> None:
        if message["do"] == "arm":
            # It takes its time, and an e-stop must not wait behind it.
            threading.Thread(target=self._answer, args=(driver, message), daemon=True).start()
        else:
            self._answer(driver, message)
        self._seen = message["number"]

    def _answer(self, driver: Pioneer, message: Message) -> None:
        calls: dict[str, Callable[..., None]] = {
            "arm": driver.arm,
            "disarm": driver.disarm,
            "drive": driver.drive,
            "stop": driver.stop,
            "e_stop": driver.e_stop,
            "reset": driver.reset,
        }
        error = None
        try:
            calls[message["do"]](**message["with"])
        except StereogridError as caught:
            error = error_fields(caught)
        if message["asks"]:
            self._tell({"reply": message["number"], "error": error, **self._status(driver)})

    def _forward(self, driver: Pioneer) -> None:
        """Reports; and the state with each of them, as soon as it changes, and now and then."""
        reports = driver.subscribe()
        told: tuple[object, ...] = ()
        told_s = 0.0
        while self._going():
            report = reports.get(FORWARD_S)
            if report is not None:
                self._tell({"report": report_fields(report)})
            message = self._status(driver)
            state = tuple(message["status"][name] for name in ("connected", "armed", "latched"))
            if report is not None or state != told or time.monotonic() > told_s + STATUS_S:
                self._tell(message)
                told, told_s = state, time.monotonic()
            if report is None:
                # A box that is closed gives nothing, but at once.
                self._ended.wait(FORWARD_S / 5)

    def _status(self, driver: Pioneer) -> Message:
        # Which message it knows of is read first: it may know of a later one too.
        seen = self._seen
        return {"seen": seen, "status": asdict(driver.status())}

    def _log(self, line: str) -> None:
        self._tell({"log": line})

    def _tell(self, message: Message) -> None:
        """Send, or drop it when the caller does not read: nothing here may wait for it."""
        with suppress(OSError):
            self._channel.send(encoded(message), NO_WAIT)


def main() -> None:
    """The process."""
    with socket.socket(fileno=os.dup(sys.stdin.fileno())) as channel:
        Host(channel).run()


if __name__ == "__main__":
    main()
