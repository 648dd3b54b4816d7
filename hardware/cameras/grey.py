"""Grey pictures of what cameras send: their luminance itself where the format has it, else converted."""

from collections.abc import Callable
from functools import partial

import cv2
import numpy as np

from stereogrid.jpeg_header import is_jpeg, jpeg_size_px
from stereogrid.observation import Image

from ..errors import CameraError

MOST_PX = 4096 * 3072
"""A picture that claims more is not decoded: a JPEG of some kilobytes may say that it is 65535 pixels wide."""
MOST_SCANS = 64

Decode = Callable[[bytes], Image]


def from_jpeg(data: bytes) -> Image:
    """The JPEG's luminance (H, W). Raises CameraError where it is damaged, cut short or too large."""
    if not is_jpeg(data):
        raise CameraError(f"a picture is no JPEG: it starts with {data[:4]!r}")
    size_px = jpeg_size_px(data)
    if size_px is None:
        raise CameraError("a JPEG has no size in its header")
    width, height = size_px
    if not 0 < width * height <= MOST_PX:
        raise CameraError(f"a JPEG claims {width}x{height} pixels: not decoded")
    # Neither marker can be part of the coded picture, and cameras pad the end with anything.
    if data.rfind(b"\xff\xd9") <= data.rfind(b"\xff\xda") or data.count(b"\xff\xda") > MOST_SCANS:
        raise CameraError(f"a JPEG of {len(data)} bytes is cut short")
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        picture = None
    if picture is None:
        raise CameraError(f"a JPEG of {len(data)} bytes cannot be decoded")
    return np.asarray(picture, np.uint8)


def decoder(fourcc: str, size_px: tuple[int, int]) -> Decode | None:
    """What makes grey of a raw buffer in a V4L2 pixel format; None for a format that OpenCV must convert."""
    if fourcc in ("MJPG", "JPEG"):
        return from_jpeg
    if fourcc in _LUMINANCE:
        return partial(_luminance, size_px, *_LUMINANCE[fourcc])
    return None


def from_bgr(size_px: tuple[int, int], data: bytes) -> Image:
    """Grey (H, W) of OpenCV's colours (H, W, 3)."""
    width, height = size_px
    _expect(data, 3 * width * height, size_px)
    return np.asarray(
        cv2.cvtColor(np.frombuffer(data, np.uint8).reshape(height, width, 3), cv2.COLOR_BGR2GRAY), np.uint8
    )


# Bytes a pixel before the colours that follow below, and which of them is the luminance.
_LUMINANCE = {
    "YUYV": (2, 0),
    "UYVY": (2, 1),
    "GREY": (1, 0),
    "NV12": (1, 0),
    "NV21": (1, 0),
    "YU12": (1, 0),
    "YV12": (1, 0),
}


def _luminance(size_px: tuple[int, int], step: int, offset: int, data: bytes) -> Image:
    width, height = size_px
    needed = step * width * height
    _expect(data, needed, size_px)
    return np.ascontiguousarray(np.frombuffer(data, np.uint8, needed).reshape(height, width, step)[..., offset])


def _expect(data: bytes, needed: int, size_px: tuple[int, int]) -> None:
    if len(data) < needed:
        raise CameraError(f"a picture of {size_px[0]}x{size_px[1]} has only {len(data)} bytes of {needed}")
