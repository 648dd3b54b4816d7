"""A pseudo-terminal in place of a serial line: as on a real one, the robot does not notice who holds the other end."""

import contextlib
import os
import select
import termios
import tty

from .links import CHUNK, News, Outbox


class TerminalLink:
    """A pseudo-terminal; `name` is the path that a client opens. It is raw from the start, its speed is only a name.

    A client that comes or goes is noted for the log, but it is never News that it left: the robot stays open, as
    one at a serial line does. What it said while nobody held the other end is lost, as on a wire.
    """

    def __init__(self) -> None:
        self._robot, client = os.openpty()
        self.name = os.ttyname(client)
        tty.setraw(client)
        settings = termios.tcgetattr(client)
        settings[4] = settings[5] = termios.B9600
        termios.tcsetattr(client, termios.TCSANOW, settings)
        os.close(client)
        os.set_blocking(self._robot, False)
        self._poll = select.poll()
        self._poll.register(self._robot, select.POLLIN)
        self._held = False
        self._outbox = Outbox()

    @property
    def dropped(self) -> int:
        """Times that something was not sent, for nobody read it."""
        return self._outbox.dropped

    def poll(self) -> News:
        """See Link."""
        events = dict(self._poll.poll(0)).get(self._robot, 0)
        held = not events & select.POLLHUP
        notes = () if held == self._held else ("a client opened the line" if held else "the client closed the line",)
        if self._held and not held:
            self._forget()
        self._held = held
        data = b""
        if events & select.POLLIN:
            with contextlib.suppress(OSError):
                data = os.read(self._robot, CHUNK)
        return News(data=data, notes=notes)

    def send(self, data: bytes) -> None:
        """See Link."""
        if not self._held:
            return
        self._outbox.put(data)
        try:
            self._outbox.flush(lambda waiting: os.write(self._robot, waiting))
        except OSError:
            self._outbox.clear()

    def close(self) -> None:
        """See Link."""
        if self._robot >= 0:
            os.close(self._robot)
            self._robot = -1

    def _forget(self) -> None:
        """What the client did not read is not for the next one."""
        self._outbox.clear()
        with contextlib.suppress(OSError):
            client = os.open(self.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            try:
                termios.tcflush(client, termios.TCIFLUSH)
            finally:
                os.close(client)
