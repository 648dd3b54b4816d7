"""One camera as the rest of the folder sees it: pictures that come, each with its moment; and whose clock that is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from stereogrid.observation import Image

from ..clock import to_epoch_s


@dataclass(frozen=True)
class Frame:
    """One picture as it came: decoded only when it has a partner.

    stamp_s: when it was taken, on hardware.clock. data: its bytes. decode: makes (H, W) uint8 of them, or raises
    CameraError.
    """

    stamp_s: float
    data: bytes
    decode: Callable[[bytes], Image]

    def picture(self) -> Image:
        """The picture (H, W). Raises CameraError where its bytes are damaged."""
        return self.decode(self.data)


class Camera(Protocol):
    """A camera that can be opened again and again. All calls come from one thread.

    name: for messages, "the left camera /dev/video0". about: what it says of itself, as JSON values. period_s: from
    picture to picture, None where that is not known.
    """

    name: str
    about: dict[str, Any]
    period_s: float | None

    def open(self) -> None:
        """Raises CameraError, with the remedy."""

    def next(self, timeout_s: float) -> Frame | None:
        """The next picture; None where none came in time or only the last one again. Raises CameraError: it is gone."""

    def close(self) -> None:
        """Let it go. Again: nothing."""


class CaptureClock:
    """Brings the stamps that a camera claims onto hardware.clock.

    same_machine: whether what stamps them runs on ours. Its stamps are believed where they lie within BEHIND_S before
    now, on the monotonic clock or as seconds since 1970. Another machine's monotonic clock says nothing, and its time
    of day is believed while it differs from ours by little, since a clock that nobody set is worse than the arrival.
    kind: "monotonic", "epoch" or "arrival": which it is; "" before the first picture.
    """

    AHEAD_S = 0.1
    BEHIND_S = 2.0
    ELSEWHERE_BEHIND_S = 0.25
    ELSEWHERE_KEPT_S = 1.0

    def __init__(self, same_machine: bool = True) -> None:
        self.kind = ""
        self._same_machine = same_machine
        self._claimed_s: float | None = None

    def stamp_s(self, claimed_s: float | None, arrival_s: float) -> float | None:
        """When a picture was taken, that came at arrival_s; None where its stamp is the last one's again, or older."""
        if claimed_s is None:
            self.kind = "arrival"
            return arrival_s
        last_s, self._claimed_s = self._claimed_s, claimed_s
        if last_s is not None and last_s - self.BEHIND_S < claimed_s <= last_s:
            self._claimed_s = last_s
            return None
        return self._nearest(claimed_s, arrival_s)

    def _nearest(self, claimed_s: float, arrival_s: float) -> float:
        for kind, zero_s in (("monotonic", 0.0), ("epoch", to_epoch_s(0.0))):
            stamp_s = claimed_s - zero_s
            if -self.AHEAD_S <= arrival_s - stamp_s <= self._believed_s(kind):
                self.kind = kind
                return min(stamp_s, arrival_s)
        self.kind = "arrival"
        return arrival_s

    def _believed_s(self, kind: str) -> float:
        """How old a stamp of that clock may be; minus infinity: none is believed."""
        if self._same_machine:
            return self.BEHIND_S
        if kind == "monotonic":
            return float("-inf")
        return self.ELSEWHERE_KEPT_S if self.kind == kind else self.ELSEWHERE_BEHIND_S


class Repeats:
    """Knows a camera that hangs by its pictures, where its stamps do not tell.

    A sensor's noise makes every picture another. Where that was so for a while, the same bytes again are no news; a
    simulation without noise, or a covered lens, has shown no such thing.
    """

    LIVELY = 30

    def __init__(self) -> None:
        self._last = b""
        self._different = 0

    def again(self, data: bytes) -> bool:
        """Whether a picture is only the last one again."""
        if data != self._last:
            self._last = data
            self._different += 1
            return False
        if self._different >= self.LIVELY:
            return True
        self._different = 0
        return False
