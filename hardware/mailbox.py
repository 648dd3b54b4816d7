"""Hands things from the thread that makes them to the one that uses them; who is slow loses the oldest, counted."""

import threading
from collections import deque
from typing import Generic, TypeVar

from stereogrid.errors import InvalidInputError

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds the newest `most` things. `put` never waits.

    dropped: things so far that nobody took, because newer ones came. Once closed it gives what it still holds, then
    None at once.
    """

    def __init__(self, most: int) -> None:
        if most < 1:
            raise InvalidInputError(f"a mailbox must hold at least 1 thing, not {most}")
        self._changed = threading.Condition()
        self._held: deque[T] = deque()
        self._most = most
        self._closed = False
        self.dropped = 0

    def __len__(self) -> int:
        return len(self._held)

    @property
    def closed(self) -> bool:
        """Whether nothing more will come."""
        return self._closed

    def put(self, thing: T) -> None:
        """Add the newest; one that comes after `close` is ignored."""
        with self._changed:
            if self._closed:
                return
            if len(self._held) == self._most:
                self._held.popleft()
                self.dropped += 1
            self._held.append(thing)
            self._changed.notify()

    def get(self, timeout_s: float) -> T | None:
        """The oldest; None when there is none within timeout_s."""
        with self._changed:
            self._changed.wait_for(lambda: self._held or self._closed, timeout_s)
            return self._held.popleft() if self._held else None

    def newest(self, timeout_s: float) -> T | None:
        """The newest, in place of all that are held; the others count as dropped."""
        with self._changed:
            self._changed.wait_for(lambda: self._held or self._closed, timeout_s)
            if not self._held:
                return None
            self.dropped += len(self._held) - 1
            thing = self._held.pop()
            self._held.clear()
            return thing

    def close(self) -> None:
        """Nothing more will come: who waits is woken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
