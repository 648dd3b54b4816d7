"""What a link to a client is: polled in every tick and never waited for."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

CHUNK = 4096
"""Bytes of one poll at most; the worst that there are take the parser some 3 ms."""
BACKLOG = 4096
"""Bytes that may wait for a client that does not read; after that whole reports are dropped."""


@dataclass(frozen=True)
class News:
    """What happened since the last poll, in this order: a client came, sent data, left. notes: lines for the log."""

    came: bool = False
    data: bytes = b""
    left: bool = False
    notes: tuple[str, ...] = ()


class Link(Protocol):
    """A way to one client at a time."""

    @property
    def name(self) -> str:
        """What a client connects to."""

    @property
    def dropped(self) -> int:
        """Times that something was not sent, for the present client did not read."""

    def poll(self) -> News:
        """What happened; returns at once."""

    def send(self, data: bytes) -> None:
        """Send whole packets, or drop them; returns at once."""

    def close(self) -> None:
        """Let the client go and open no more."""


class Outbox:
    """Bytes on their way out: kept when the client is slow, dropped by whole packets when it does not read."""

    def __init__(self) -> None:
        self.dropped = 0
        self._waiting = b""

    def put(self, data: bytes) -> None:
        """Add whole packets."""
        if len(self._waiting) + len(data) > BACKLOG:
            self.dropped += 1
        else:
            self._waiting += data

    def flush(self, write: Callable[[bytes], int]) -> None:
        """Send what the client takes now. Passes on OSError, save that it takes nothing now."""
        if not self._waiting:
            return
        try:
            self._waiting = self._waiting[write(self._waiting) :]
        except BlockingIOError:
            return

    def clear(self) -> None:
        """The client is gone."""
        self._waiting = b""
        self.dropped = 0
