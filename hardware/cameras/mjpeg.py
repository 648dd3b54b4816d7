"""A camera on a web server: MJPEG over HTTP."""

import math
from collections import deque
from typing import Any

from ..clock import now_s
from ..errors import CameraError
from .grey import from_jpeg
from .http import Address, Answer
from .multipart import MultipartParser, Part
from .stream import CaptureClock, Frame, Repeats

TIMESTAMP = "x-timestamp"
_TYPES = ("multipart/", "application/octet-stream")
"""The second: ffmpeg's server says nothing better."""


class MjpegCamera:
    """See stream.Camera. A picture's header X-Timestamp is when it was taken, where that is on a clock we know."""

    def __init__(self, address: Address, side: str) -> None:
        self.name = f"the {side} camera {address.url}"
        self.about: dict[str, Any] = {"url": address.url, "stamps": ""}
        self.period_s: float | None = None
        self._address, self._side = address, side
        self._answer: Answer | None = None
        self._parser = MultipartParser("")
        self._clock, self._repeats = CaptureClock(), Repeats()
        self._came: deque[Part] = deque()

    def open(self) -> None:
        """Ask for the stream."""
        self.close()
        try:
            answer = Answer(self._address)
        except CameraError as error:
            raise CameraError(f"the {self._side} camera: {error}") from error
        kind = answer.headers.get_content_type() if "Content-Type" in answer.headers else ""
        if kind and not kind.startswith(_TYPES):
            answer.close()
            raise CameraError(f"{self.name} gives {kind}, no MJPEG stream (multipart/x-mixed-replace)")
        self._answer = answer
        self._parser = MultipartParser(str(answer.headers.get_param("boundary") or ""))
        self._clock, self._repeats = CaptureClock(answer.from_this_machine), Repeats()

    def next(self, timeout_s: float) -> Frame | None:
        """The next picture that came."""
        if self._answer is None:
            raise CameraError(f"{self.name} is closed")
        deadline_s = now_s() + timeout_s
        while not self._came:
            left_s = deadline_s - now_s()
            if left_s <= 0:
                return None
            try:
                self._came.extend(self._parser.feed(self._answer.read(left_s)))
            except CameraError as error:
                raise CameraError(f"the {self._side} camera: {error}") from error
        return self._frame(self._came.popleft())

    def close(self) -> None:
        """End the connection."""
        answer, self._answer = self._answer, None
        if answer is not None:
            answer.close()
        self._parser = MultipartParser("")
        self._came.clear()

    def _frame(self, part: Part) -> Frame | None:
        claimed_s = _timestamp_s(part)
        again = claimed_s is None and self._repeats.again(part.data)
        stamp_s = self._clock.stamp_s(claimed_s, now_s())
        self.about["stamps"] = self._clock.kind
        return None if again or stamp_s is None else Frame(stamp_s, part.data, from_jpeg)


def _timestamp_s(part: Part) -> float | None:
    try:
        claimed_s = float(part.headers.get(TIMESTAMP, "nan"))
    except ValueError:
        return None
    return claimed_s if math.isfinite(claimed_s) else None
