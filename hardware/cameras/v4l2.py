"""A camera of the kernel's (V4L2) through OpenCV: its mode is read back, and it is found again after a replug."""

import math
import os
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..clock import now_s
from ..errors import CameraError
from .controls import Controls, set_controls
from .discovery import VideoDevice, find_again, open_trouble
from .grey import Decode, decoder, from_bgr
from .kernel import offered_modes
from .stream import CaptureClock, Frame, Repeats

_ABOUT = ("node", "label", "usb_id", "plug", "size_px", "fourcc", "fps", "fps_asked", "controls_again")
FIRST_PICTURE_S = 5
"""A webcam takes up to some seconds to its first picture; OpenCV would wait twice as long."""
_PREFERRED = ("YUYV", "MJPG")
"""YUYV brings the luminance as the sensor gave it; JPEG's blocks cost a matcher accuracy."""


class V4l2Camera:
    """See stream.Camera. device: the camera; size_px (width, height) and fps are asked for, fourcc too unless "".

    Another size, or another fourcc than one asked for, is refused with what the camera offers; another rate is taken,
    and `about` says so. controls: what is set whenever it is opened.
    """

    def __init__(
        self, device: VideoDevice, side: str, *, size_px: tuple[int, int], fps: float, fourcc: str = ""
    ) -> None:
        self.device = device
        self.name = f"the {side} camera {device.node}"
        # All its keys from the start: others read it while it changes.
        self.about: dict[str, Any] = {**dict.fromkeys(_ABOUT), "stamps": ""}
        self.period_s: float | None = 1.0 / fps
        self.controls: Controls = {}
        self._side, self._size_px, self._fps, self._fourcc = side, size_px, fps, fourcc
        self._capture: cv2.VideoCapture | None = None
        self._clock, self._repeats = CaptureClock(), Repeats()
        self._decode: Decode = partial(from_bgr, size_px)

    def open(self) -> None:
        """Find it in its plug, whatever its node is called now, and ask for the mode."""
        self.close()
        device = find_again(self.device)
        if device is None:
            raise CameraError(self._gone())
        self.device, self.name = device, f"the {self._side} camera {device.node}"
        self._refuse_what_cannot_be_opened()
        # How long OpenCV waits for a buffer; read by it once, when it first has to wait.
        os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", str(FIRST_PICTURE_S))
        # What it warns of when a camera goes, we say ourselves, on a line of our own.
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
        capture = cv2.VideoCapture(device.node, cv2.CAP_V4L2)
        if not capture.isOpened():
            raise CameraError(f"{self.name} is busy: {holders(device.node)}")
        try:
            self._negotiate(capture)
        except CameraError:
            capture.release()
            raise
        self._capture, self._clock, self._repeats = capture, CaptureClock(), Repeats()
        if self.controls:
            self.about["controls_again"] = set_controls(device.node, self.controls)

    def next(self, timeout_s: float) -> Frame | None:
        """The next picture, with the kernel's stamp where that is on our clock."""
        capture = self._capture
        if capture is None:
            raise CameraError(f"{self.name} is closed")
        try:
            ready, _ = cv2.VideoCapture.waitAny([capture], int(timeout_s * 1e9))
            if not ready:
                return None
            if not capture.grab():
                raise CameraError(self._gone())
            arrival_s = now_s()
            read, raw = capture.retrieve()
        except cv2.error as error:
            raise CameraError(self._why_none()) from error
        stamp_s = self._clock.stamp_s(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3, arrival_s)
        self.about["stamps"] = self._clock.kind
        data = np.asarray(raw).tobytes() if read else b""
        if stamp_s is None or self._repeats.again(data):
            return None
        return Frame(stamp_s, data, self._decode)

    def close(self) -> None:
        """Release the node."""
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.release()

    def _refuse_what_cannot_be_opened(self) -> None:
        if self.device.trouble:
            raise CameraError(f"the {self._side} camera: {self.device.trouble}")
        try:
            os.close(os.open(self.device.node, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC))
        except OSError as error:
            raise CameraError(f"the {self._side} camera: {open_trouble(self.device.node, error)}") from error

    def _negotiate(self, capture: cv2.VideoCapture) -> None:
        """Ask for the mode and read back what came of it."""
        for fourcc in (self._fourcc,) if self._fourcc else _PREFERRED:
            if capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*fourcc)) and _fourcc(capture) == fourcc:
                break
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._size_px[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._size_px[1])
        capture.set(cv2.CAP_PROP_FPS, self._fps)
        size_px = (int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        fourcc, fps = _fourcc(capture), float(capture.get(cv2.CAP_PROP_FPS))
        if size_px != self._size_px:
            raise CameraError(f"{self.name} gives {_by(size_px)}, not {_by(self._size_px)}. {self._offers(fourcc)}")
        if self._fourcc not in ("", fourcc):
            raise CameraError(f"{self.name} gives {fourcc}, not {self._fourcc}. {self._offers()}")
        self._read_as(capture, fourcc)
        if math.isfinite(fps) and fps > 0:
            self.period_s = 1.0 / fps
        self.about.update(
            node=self.device.node,
            label=self.device.label,
            usb_id=self.device.usb_id,
            plug=str(self.device.plug),
            size_px=list(size_px),
            fourcc=fourcc,
            fps=fps if math.isfinite(fps) else None,
            fps_asked=self._fps,
        )

    def _read_as(self, capture: cv2.VideoCapture, fourcc: str) -> None:
        """Take the camera's own bytes where we know their luminance; else OpenCV's colours."""
        decode = decoder(fourcc, self._size_px)
        self._decode = decode or partial(from_bgr, self._size_px)
        capture.set(cv2.CAP_PROP_CONVERT_RGB, float(decode is None))

    def _offers(self, fourcc: str = "") -> str:
        """The sizes that it has in that pixel format, or all its formats: a webcam has dozens of modes."""
        try:
            modes = offered_modes(self.device.node)
        except OSError:
            return "It does not say what it offers"
        sizes = sorted({(mode.width_px, mode.height_px) for mode in modes if mode.fourcc == fourcc})
        if fourcc:
            return f"In {fourcc} it offers {', '.join(map(_by, sizes))}" if sizes else f"It lists no sizes in {fourcc}"
        formats = sorted({mode.fourcc for mode in modes})
        return f"It offers {', '.join(formats)}" if formats else "It lists no formats"

    def _why_none(self) -> str:
        if not Path(self.device.node).exists():
            return self._gone()
        return (
            f"{self.name} gives no pictures: it was unplugged, or two cameras need more than their USB bus has: a "
            "smaller size, a lower rate or MJPG may help, or a port of another controller"
        )

    def _gone(self) -> str:
        return f"{self.name} is gone: plug it in again, into the same port"


def holders(node: str) -> str:
    """Who has a node open, as far as this user may see; else how to find out."""
    found = sorted(filter(None, (_holder(link, node) for link in Path("/proc").glob("[0-9]*/fd/*"))))
    if found:
        return f"{', '.join(found)} has it open: end that first"
    return f"another program has it open: sudo fuser -v {node} names it"


def _holder(link: Path, node: str) -> str:
    """The process of an open file, where that is the node's; "" else."""
    process = link.parents[1]
    try:
        return (
            f"{(process / 'comm').read_text().strip()} (process {process.name})" if str(link.readlink()) == node else ""
        )
    except OSError:
        return ""


def _fourcc(capture: cv2.VideoCapture) -> str:
    return int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode("latin-1").rstrip()


def _by(size_px: tuple[int, int]) -> str:
    return f"{size_px[0]}x{size_px[1]}"
