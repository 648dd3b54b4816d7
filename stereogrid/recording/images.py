"""Encoded images to grey arrays and back."""

import struct

import cv2
import numpy as np

from ..errors import RecordingError
from ..observation import Image

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def encode_png(image: Image) -> bytes:
    """The PNG file of an image (H, W) uint8."""
    # OpenCV's own defaults (SUB filter, run lengths) are twice as fast as any level chosen by hand.
    _, encoded = cv2.imencode(".png", image)
    return encoded.tobytes()


def png_size(encoded: bytes, name: str) -> tuple[int, int]:
    """(height, width) as a PNG's first bytes say, without decoding it.

    Raises RecordingError, naming `name`, when the bytes are no PNG.
    """
    if not encoded.startswith(_PNG_SIGNATURE) or len(encoded) < 24:
        raise RecordingError(f"{name}: not a PNG image")
    width, height = struct.unpack(">II", encoded[16:24])
    return height, width


def decode_grey(encoded: bytes, name: str) -> Image:
    """The grey image (H, W) uint8 of an encoded one; colours are converted, alpha is dropped.

    Raises RecordingError, naming `name`, when it is unreadable or not of 8 bits.
    """
    try:
        image = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        raise RecordingError(f"{name}: not a readable image")
    if image.dtype != np.uint8:
        raise RecordingError(f"{name}: the image is {image.dtype.itemsize * 8}-bit, expected 8-bit")
    if image.ndim == 3:
        code = cv2.COLOR_BGRA2GRAY if image.shape[2] == 4 else cv2.COLOR_BGR2GRAY
        image = cv2.cvtColor(image, code)
    grey: Image = image
    return grey
