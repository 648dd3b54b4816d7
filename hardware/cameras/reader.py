"""Reads one camera in a thread of its own, so that no buffer of it goes stale; opens it again when it is lost."""

import threading
from collections.abc import Callable

from ..clock import now_s
from ..errors import CameraError
from .stream import Camera, Frame

LOST_AFTER_S = 0.5
"""A camera that gives nothing new for this long is lost: it hangs, or was cut off."""
REOPEN_AFTER_S = 2.0
_POLL_S = 0.1
_BACK_OFF_S = (0.1, 0.2, 0.5, 1.0)
"""Between one attempt to open it again and the next; the last one for ever."""


class Reader:
    """deliver gets every picture; on_lost is called when the camera is lost. Both in the thread, neither may wait."""

    def __init__(self, camera: Camera, deliver: Callable[[Frame], None], on_lost: Callable[[], None]) -> None:
        self.camera = camera
        self._deliver, self._on_lost = deliver, on_lost
        self._stop = threading.Event()
        self._came = threading.Event()
        self._last_s = now_s()
        self._trouble = ""
        self._attempts = 0
        self._away = False
        self._thread = threading.Thread(target=self._run, name=camera.name, daemon=True)

    def start(self) -> None:
        """Open the camera and read it, in the thread."""
        self._last_s = now_s()
        self._thread.start()

    def wait(self, timeout_s: float) -> None:
        """Until the first picture. Raises CameraError: the camera cannot be opened, or gives none."""
        deadline_s = now_s() + timeout_s
        while not self._came.wait(0.02):
            if self._attempts or now_s() > deadline_s:
                raise CameraError(self._trouble or f"{self.camera.name} gives no pictures: waited {timeout_s:.0f} s")

    def problem(self) -> str:
        """Why no pictures come now; "" when they do."""
        if self._trouble:
            return self._trouble
        silent_s = now_s() - self._last_s
        return f"{self.camera.name} gives nothing new since {silent_s:.1f} s" if silent_s > LOST_AFTER_S else ""

    def stop(self) -> None:
        """Ask the thread to end."""
        self._stop.set()

    def join(self, timeout_s: float) -> None:
        """Wait until it has ended; one that OpenCV holds up ends with the program."""
        if self._thread.ident is not None:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self.camera.open()
                self._read()
            except CameraError as error:
                self._fail(str(error))
            except Exception as error:  # a thread that died would leave nobody to open the camera again
                self._fail(f"{self.camera.name}: {type(error).__name__}: {error}")
            finally:
                self.camera.close()
            self._stop.wait(_BACK_OFF_S[min(self._attempts, len(_BACK_OFF_S)) - 1])

    def _read(self) -> None:
        """Every picture, until the camera is lost for good. Raises CameraError then."""
        opened_s = now_s()
        while not self._stop.is_set():
            frame = self.camera.next(_POLL_S)
            if frame is not None:
                self._last_s, self._trouble, self._attempts, self._away = now_s(), "", 0, False
                self._came.set()
                self._deliver(frame)
                continue
            silent_s = now_s() - max(self._last_s, opened_s)
            if silent_s > REOPEN_AFTER_S:
                raise CameraError(f"{self.camera.name} gives nothing new since {silent_s:.1f} s: opening it again")
            if silent_s > LOST_AFTER_S:
                self._lose()

    def _fail(self, trouble: str) -> None:
        self._trouble = trouble
        self._attempts += 1
        self._lose()

    def _lose(self) -> None:
        """Count the loss, once until it is back."""
        if not self._away and self._came.is_set():
            self._away = True
            self._on_lost()
