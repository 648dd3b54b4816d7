"""Encoded images to grey arrays and back."""

import struct

import cv2
import numpy as np

from ..errors import RecordingError
from ..jpeg_header import is_jpeg, jpeg_size_px
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


def image_size(encoded: bytes, name: str) -> tuple[int, int]:
    """(height, width) as the first bytes of a PNG or JPEG say, without decoding it.

    Raises RecordingError, naming `name`, when the bytes are neither.
    """
    if not is_jpeg(encoded):
        return png_size(encoded, name)
    size_px = jpeg_size_px(encoded)
    if size_px is None:
        raise RecordingError(f"{name}: a JPEG image without a size")
    return size_px[1], size_px[0]


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
    return grey(image)


def grey(image: Image) -> Image:
    """The grey picture (H, W) of one (H, W), (H, W, 3) BGR or (H, W, 4) BGRA, uint8."""
    if image.ndim == 2:
        return image
    code = cv2.COLOR_BGRA2GRAY if image.shape[2] == 4 else cv2.COLOR_BGR2GRAY
    converted: Image = cv2.cvtColor(image, code)
    return converted
