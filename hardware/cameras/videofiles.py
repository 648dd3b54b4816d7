"""Two video files as if they were two cameras: picture k of one belongs to picture k of the other."""

import math
import threading
from pathlib import Path

import cv2
import numpy as np

from stereogrid.observation import Image

from ..clock import now_s
from ..errors import CameraError
from ..mailbox import Mailbox
from .outlet import Outlet
from .pairs import RawPair

_POLL_S = 0.002


class VideoPairs(Outlet):
    """See pairs.StereoPairs. Starts with the first who subscribes; closes the mailboxes at the end of the shorter file.

    fps: where the files do not say it. at_pace: at the files' own rate; else each pair is read once everyone has taken
    the last one, and its stamps run on at the files' rate all the same.
    """

    def __init__(self, left: Path, right: Path, *, fps: float, at_pace: bool = True) -> None:
        super().__init__(f"{left} and {right}", {})
        self._captures = (_opened(left), _opened(right))
        self._fps = _rate(self._captures[0]) or fps
        self._at_pace = at_pace
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._trouble = ""
        sizes = [_size_px(capture) for capture in self._captures]
        for side, path, capture in zip(("left", "right"), (left, right), self._captures, strict=True):
            self.about[side] = {"file": str(path), "fps": _rate(capture), "pictures": _length(capture)}
        if sizes[0] != sizes[1]:
            raise CameraError(
                f"{left} has {_by(sizes[0])} pixels, {right} {_by(sizes[1])}: both must have the same size"
            )
        self.size_px = sizes[0]

    def subscribe(self, most: int = 4) -> Mailbox[RawPair]:
        """As any; the first one starts the reading."""
        mailbox = super().subscribe(most)
        with self._lock:
            start = self._thread is None and not self._stop.is_set()
            if start:
                self._thread = threading.Thread(target=self._run, name="video files", daemon=True)
        if start and self._thread is not None:
            self._thread.start()
        return mailbox

    def problem(self) -> str:
        """Why no pairs come now: the files are at their end."""
        return self._trouble

    def close(self) -> None:
        """End the reading. Again: nothing."""
        self._stop.set()
        with self._lock:
            thread = self._thread
        if thread is not None and thread.ident is not None:
            thread.join()
        for capture in self._captures:
            capture.release()
        self._end()

    def _run(self) -> None:
        start_s = now_s()
        k = 0
        while not self._stop.is_set() and (pictures := self._next()) is not None:
            stamp_s = start_s + k / self._fps
            self._wait(stamp_s)
            self._give(RawPair(*pictures, stamp_s, stamp_s))
            k += 1
        self._trouble = f"{self.name} are at their end" if k else f"{self.name} have no pictures that can be read"
        self._end()

    def _next(self) -> tuple[Image, Image] | None:
        found = [capture.read() for capture in self._captures]
        if not all(read for read, _ in found):
            return None
        left, right = (np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8) for _, picture in found)
        return left, right

    def _wait(self, stamp_s: float) -> None:
        """Until a pair is due."""
        if self._at_pace:
            self._stop.wait(max(0.0, stamp_s - now_s()))
            return
        while any(len(mailbox) and not mailbox.closed for mailbox in self._subscribed()):
            if self._stop.wait(_POLL_S):
                return

    def _subscribed(self) -> list[Mailbox[RawPair]]:
        with self._lock:
            return list(self._mailboxes)


def _opened(path: Path) -> cv2.VideoCapture:
    if not path.is_file():
        raise CameraError(f"there is no video file {path}")
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        raise CameraError(f"{path} is no video file that OpenCV can read")
    return capture


def _rate(capture: cv2.VideoCapture) -> float:
    """Pictures a second; 0 where the file does not say it."""
    fps = float(capture.get(cv2.CAP_PROP_FPS))
    return fps if math.isfinite(fps) and 0 < fps <= 1000 else 0.0


def _length(capture: cv2.VideoCapture) -> int:
    return max(0, int(capture.get(cv2.CAP_PROP_FRAME_COUNT)))


def _size_px(capture: cv2.VideoCapture) -> tuple[int, int]:
    return int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))


def _by(size_px: tuple[int, int]) -> str:
    return f"{size_px[0]}x{size_px[1]}"
