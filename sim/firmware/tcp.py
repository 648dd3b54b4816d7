"""A TCP port on this machine's loopback, for one client at a time."""

import errno
import socket
import time

from stereogrid.errors import InvalidInputError

from .links import CHUNK, News, Outbox

HOST = "127.0.0.1"
RECEIVE_BUFFER, SEND_BUFFER = 1 << 16, 1 << 14
"""The system's buffers [bytes]: small, so that what a client left behind is soon read and reports are never old."""
PATIENCE_S = 1.0
"""How long a second client waits for the first to go: one that reconnects finds its old self not yet gone."""


def listen(port: int) -> socket.socket:
    """A listening socket on the loopback; port 0: any. Raises InvalidInputError, naming the port, when it is taken."""
    if not 0 <= port <= 0xFFFF:
        raise InvalidInputError(f"a port must be 0 to 65535, not {port}")
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((HOST, port))
        listener.listen()
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            raise InvalidInputError(f"port {port} is in use: choose another one, or end what listens there") from error
        raise InvalidInputError(f"cannot listen on port {port} ({error.strerror})") from error
    return listener


class TcpLink:
    """Listens on a port; port 0: any that is free. Whoever comes while a client is connected is let go soon."""

    def __init__(self, port: int) -> None:
        self._listener = listen(port)
        # Inherited by the connections, which must have it before they are made.
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self._listener.setblocking(False)
        self.port: int = self._listener.getsockname()[1]
        self._client: socket.socket | None = None
        self._second: socket.socket | None = None
        self._second_until_s = 0.0
        self._outbox = Outbox()

    @property
    def name(self) -> str:
        """host:port."""
        return f"{HOST}:{self.port}"

    @property
    def dropped(self) -> int:
        """Times that something was not sent, for the present client did not read."""
        return self._outbox.dropped

    def poll(self) -> News:
        """See Link."""
        came = self._client is None and self._welcome()
        data = self._read()
        left = data == b""
        if left:
            self._hang_up()
        notes = () if self._client is None else self._refuse()
        return News(came, data or b"", left, notes)

    def send(self, data: bytes) -> None:
        """See Link."""
        if self._client is None:
            return
        self._outbox.put(data)
        try:
            self._outbox.flush(self._client.send)
        except OSError:
            # The next poll finds the connection at its end.
            self._outbox.clear()

    def close(self) -> None:
        """See Link."""
        self._hang_up()
        if self._second is not None:
            self._second.close()
        self._listener.close()

    def _accept(self) -> socket.socket | None:
        try:
            newcomer, _ = self._listener.accept()
        except (BlockingIOError, ConnectionError):
            return None
        newcomer.setblocking(False)
        newcomer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return newcomer

    def _welcome(self) -> bool:
        self._client, self._second = self._second or self._accept(), None
        return self._client is not None

    def _read(self) -> bytes | None:
        """What the client sent; empty when it left; None when there is nothing, or nobody."""
        if self._client is None:
            return None
        try:
            return self._client.recv(CHUNK)
        except BlockingIOError:
            return None
        except OSError:
            return b""

    def _refuse(self) -> tuple[str, ...]:
        """Let a second client wait for a while, and go after that."""
        if self._second is None:
            self._second, self._second_until_s = self._accept(), time.monotonic() + PATIENCE_S
        elif time.monotonic() > self._second_until_s:
            self._second.close()
            self._second = None
            return ("refused a second client: the robot is taken",)
        return ()

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
        self._outbox.clear()
