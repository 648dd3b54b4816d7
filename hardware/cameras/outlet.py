"""Where pairs come out: who has subscribed, and what has been given so far."""

import threading
from types import TracebackType
from typing import Any

from ..mailbox import Mailbox
from .pairs import PairCounts, RawPair


class Outlet:
    """What all kinds of two cameras share of pairs.StereoPairs. A context manager."""

    def __init__(self, name: str, about: dict[str, Any]) -> None:
        self.name = name
        self.about = about
        self.counts = PairCounts()
        self.size_px = (0, 0)
        self._lock = threading.Lock()
        self._mailboxes: list[Mailbox[RawPair]] = []
        self._closed = False
        self._last_stamp_s: float | None = None

    def __enter__(self) -> "Outlet":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let the cameras go. Again: nothing."""
        raise NotImplementedError

    def problem(self) -> str:
        """Why no pairs come now; "" when they do."""
        raise NotImplementedError

    def subscribe(self, most: int = 4) -> Mailbox[RawPair]:
        """A mailbox of the pairs from now on; closed at once where nothing will come any more."""
        mailbox: Mailbox[RawPair] = Mailbox(most)
        with self._lock:
            self._mailboxes.append(mailbox)
            if self._closed:
                mailbox.close()
        return mailbox

    def last_stamp_s(self) -> float | None:
        """When the newest pair was taken."""
        return self._last_stamp_s

    def _give(self, pair: RawPair) -> None:
        with self._lock:
            self._mailboxes = [each for each in self._mailboxes if not each.closed]
            for mailbox in self._mailboxes:
                mailbox.put(pair)
            self._last_stamp_s = pair.stamp_s
            self.counts.pairs += 1

    def _end(self) -> None:
        """Nothing more will come."""
        with self._lock:
            self._closed = True
            for mailbox in self._mailboxes:
                mailbox.close()
