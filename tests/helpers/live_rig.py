"""Cameras and hands for tests of live mapping: a wall at a known distance on a web server, keys typed on a terminal."""

import contextlib
import os
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from recorded_rig import CAMERA, RIG

from stereogrid.mjpeg import MjpegServer, jpeg

DISPARITY_PX = 6


def camera_json() -> dict[str, Any]:
    """What the server says of its rectified pictures."""
    numbers = {name: getattr(CAMERA, name) for name in ("focal_px", "cx_px", "cy_px", "baseline_m")}
    size = {"width_px": CAMERA.width_px, "height_px": CAMERA.height_px}
    return {**numbers, **size, "T_base_cam": np.asarray(RIG.T_base_cam).tolist()}


def wall() -> tuple[bytes, bytes]:
    """The pictures of a textured wall, DISPARITY_PX from one another, as JPEG files."""
    height, width = CAMERA.shape
    coarse = np.random.default_rng(5).integers(20, 236, (height // 4, width // 4 + 4), dtype=np.uint8)
    texture = np.kron(coarse, np.ones((4, 4), np.uint8))
    left = texture[:, :width]
    right = texture[:, DISPARITY_PX : DISPARITY_PX + width]
    return jpeg(np.ascontiguousarray(left)), jpeg(np.ascontiguousarray(right))


class Pictures:
    """Serves the wall at a rate until `cut`; a context manager. last_s: when the newest pair was taken."""

    def __init__(self, fps: float = 20.0) -> None:
        self._server = MjpegServer(0, camera_json())
        self.url = self._server.url
        self._fps, self.last_s = fps, 0.0
        self._stop, self.cut = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> "Pictures":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._server.close()

    def _run(self) -> None:
        pair = wall()
        while not self._stop.wait(1 / self._fps):
            if not self.cut.is_set():
                self.last_s = time.monotonic()
                self._server.publish(*pair, self.last_s)


class Hand:
    """Types on a terminal. hold: a key that is repeated as a terminal repeats it, from a thread, until it is let go."""

    def __init__(self) -> None:
        self._hand, self.terminal = os.openpty()
        self.let_go_s = 0.0

    def __enter__(self) -> "Hand":
        return self

    def __exit__(self, *_: object) -> None:
        for end in (self._hand, self.terminal):
            with contextlib.suppress(OSError):
                os.close(end)

    def hang_up(self) -> None:
        """Close the terminal's window."""
        os.close(self._hand)

    def type(self, keys: str) -> None:
        """Press these, one after the other."""
        os.write(self._hand, keys.encode())

    @contextlib.contextmanager
    def holding(self, key: str) -> Iterator[None]:
        """Within it the key is held."""
        let_go = threading.Event()

        def repeat() -> None:
            self.type(key)
            wait_s = 0.3
            while not let_go.wait(wait_s):
                self.type(key)
                wait_s = 0.04
            self.let_go_s = time.monotonic()

        thread = threading.Thread(target=repeat, daemon=True)
        thread.start()
        try:
            yield
        finally:
            let_go.set()
            thread.join()


if __name__ == "__main__":
    with Pictures() as pictures:
        sys.stdout.write(pictures.url + "\n")
        sys.stdout.flush()
        threading.Event().wait()
