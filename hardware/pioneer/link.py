"""Links to a robot: a TCP connection, or a serial line, which may be a pseudo-terminal."""

import contextlib
import errno
import os
import select
import socket
import struct
import termios
import time
from pathlib import Path
from typing import Protocol

from stereogrid.errors import InvalidInputError, MissingExtraError

from ..errors import RobotError

PORT = 8101
BAUD = 9600
CONNECT_S = 5.0
WRITE_S = 0.2
"""A link that takes nothing for so long is gone: the driver must not wait for it."""
CHUNK = 4096
LINGER_S = 0.2
GONE = (OSError, termios.error)
"""What a device that was pulled out raises; the second is no OSError."""
FORMS = "tcp:HOST:PORT, HOST:PORT, /dev/ttyUSB0 or serial:/dev/..."


class LinkError(RobotError):
    """The link to the robot is cut."""


class Link(Protocol):
    """Bytes to and from the robot. is_serial: its speed can be set."""

    name: str
    is_serial: bool

    @property
    def byte_s(self) -> float:
        """The time that one byte takes on the wire."""

    def receive(self, timeout_s: float) -> bytes:
        """What came; empty when nothing does within timeout_s. Raises LinkError when the link is cut."""

    def send(self, data: bytes) -> None:
        """All of it, almost at once. Raises LinkError when it does not go."""

    def set_baud(self, baud: int) -> None:
        """Once all is sent, go on at this speed."""

    def close(self, *, discard: bool = False) -> None:
        """Hang up; discard: what has not gone out yet never shall."""


def open_link(address: str) -> Link:
    """The link to an address of FORMS. Raises InvalidInputError for another one, RobotError where nobody is there."""
    kind, _, rest = address.partition(":")
    if kind == "serial" and rest:
        return SerialLink(rest)
    if address.startswith("/"):
        return SerialLink(address)
    host, colon, port = (rest if kind == "tcp" else address).rpartition(":")
    if kind == "tcp" and rest and not colon:
        host, port = rest, str(PORT)
    host = host.strip("[]")
    if not host or not port.isdecimal() or not 0 < int(port) <= 0xFFFF:
        raise InvalidInputError(f"the robot's address {address!r} is none of {FORMS}")
    return TcpLink(host, int(port))


class TcpLink:
    """A TCP connection, to a simulator or to a bridge on the robot."""

    is_serial = False
    byte_s = 0.0

    def __init__(self, host: str, port: int) -> None:
        self.name = f"{host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), timeout=CONNECT_S)
        except ConnectionRefusedError as error:
            raise RobotError(f"nobody listens at {self.name}: is the robot, or its simulator, running?") from error
        except (socket.gaierror, UnicodeError) as error:
            raise RobotError(f"no computer named {host!r} is known") from error
        except OSError as error:
            reason = "no answer" if isinstance(error, TimeoutError) else error.strerror
            raise RobotError(
                f"cannot connect to {self.name} ({reason}): is the robot on, and in this network?"
            ) from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)

    def receive(self, timeout_s: float) -> bytes:
        """See Link."""
        try:
            if not select.select([self._socket], [], [], timeout_s)[0]:
                return b""
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkError(f"the connection to {self.name} broke ({error.strerror})") from error
        if not data:
            raise LinkError(f"{self.name} hung up")
        return data

    def send(self, data: bytes) -> None:
        """See Link."""
        _send_all(self.name, self._socket.fileno(), data)

    def set_baud(self, baud: int) -> None:
        """A TCP connection has none."""

    def close(self, *, discard: bool = False) -> None:
        """See Link."""
        if discard:
            # Sent by the system long after, old commands would move a robot that its driver has given up.
            with contextlib.suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        else:
            self._hang_up()
        self._socket.close()

    def _hang_up(self) -> None:
        """Let what was said arrive: closed with reports unread, the system would take it back with a reset."""
        end_s = time.monotonic() + LINGER_S
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
            while (left_s := end_s - time.monotonic()) > 0:
                if select.select([self._socket], [], [], left_s)[0] and not self._socket.recv(CHUNK):
                    return


class SerialLink:
    """A serial line, 8N1 at 9600 baud at first, locked against other programs that lock."""

    is_serial = True

    def __init__(self, path: str) -> None:
        try:
            import serial
        except ImportError as error:
            raise MissingExtraError('a serial line needs pyserial: pip install "stereogrid[hardware]"') from error
        self.name = path
        # The speed of a pseudo-terminal is a name only.
        self._is_terminal = str(Path(path).resolve()).startswith("/dev/pts/")
        try:
            self._port = serial.Serial(path, BAUD, timeout=0, exclusive=True)
        except (*GONE, ValueError) as error:  # SerialException is an OSError
            raise _serial_error(path, error) from error
        self._baud = BAUD
        self._handle: int = self._port.fileno()

    @property
    def byte_s(self) -> float:
        """Ten bits a byte."""
        return 0.0 if self._is_terminal else 10 / self._baud

    def receive(self, timeout_s: float) -> bytes:
        """See Link."""
        try:
            if not select.select([self._handle], [], [], timeout_s)[0]:
                return b""
            data = os.read(self._handle, CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkError(f"the line {self.name} is cut ({error.strerror}): unplugged?") from error
        if not data:
            # A line that has something to read, which is nothing, is a line without its other end.
            raise LinkError(f"the line {self.name} is cut: unplugged?")
        return data

    def send(self, data: bytes) -> None:
        """See Link."""
        _send_all(self.name, self._handle, data)

    def set_baud(self, baud: int) -> None:
        """See Link."""
        if baud == self._baud:
            return
        try:
            self._drain()
            self._port.baudrate = baud
        except (*GONE, ValueError) as error:
            raise LinkError(f"the line {self.name} cannot go at {baud} baud ({error})") from error
        self._baud = baud

    def close(self, *, discard: bool = False) -> None:
        """See Link."""
        if not self._port.is_open:
            return
        with contextlib.suppress(*GONE):
            if discard:
                self._port.reset_output_buffer()
            else:
                self._drain()
        # A device that is gone may say so once more.
        with contextlib.suppress(*GONE):
            self._port.close()

    def _drain(self) -> None:
        """Wait until all has gone out, but never as long as tcdrain may."""
        end_s = time.monotonic() + WRITE_S
        while self._port.out_waiting and time.monotonic() < end_s:
            time.sleep(0.001)


def _send_all(name: str, handle: int, data: bytes) -> None:
    end_s = time.monotonic() + WRITE_S
    try:
        while data:
            if not select.select([], [handle], [], max(end_s - time.monotonic(), 0))[1]:
                raise LinkError(f"{name} takes no more bytes")
            with contextlib.suppress(BlockingIOError):
                data = data[os.write(handle, data) :]
    except OSError as error:
        raise LinkError(f"{name} takes no more bytes ({error.strerror})") from error


def _serial_error(path: str, error: Exception) -> RobotError:
    """What is wrong with a line that does not open, and how to put it right."""
    # pyserial tells a line that cannot be set up by its text alone, but in the midst of the system's own error.
    context = error.__context__
    code = getattr(error, "errno", None) or (context.args[0] if context is not None and context.args else None)
    if code in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return RobotError(f"no serial line {path}: is the adapter plugged in? It is mostly /dev/ttyUSB0 or /dev/ttyS0")
    if code in (errno.EACCES, errno.EPERM):
        return RobotError(
            f"no permission for {path}: join the group dialout (sudo usermod -aG dialout $USER), then log in again"
        )
    if code in (errno.EAGAIN, errno.EBUSY):
        return RobotError(f"{path} is in use: another program drives the robot")
    if code in (errno.ENOTTY, errno.EINVAL, errno.EISDIR):
        return RobotError(f"{path} is no serial line")
    return RobotError(f"cannot open the serial line {path} ({error})")
