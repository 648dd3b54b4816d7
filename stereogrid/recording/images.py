"""Encoded images to grey arrays and back."""

import struct
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..geometry import Array
from ..jpeg_header import is_jpeg, jpeg_size_px
from ..observation import Image

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND"
_TAIL = 64
"""Bytes at the end of a PNG among which its last chunk is, even where a writer filled up a block."""
MOST_PIXELS = 2**26
"""Of a picture whose size nothing but its own header tells."""


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
    image = _decoded(encoded, name)
    if image.dtype != np.uint8:
        raise RecordingError(f"{name}: the image is {image.dtype.itemsize * 8}-bit, expected 8-bit")
    return grey(image)


def _decoded(encoded: bytes, name: str) -> Array:
    if encoded.startswith(_PNG_SIGNATURE) and _PNG_END not in encoded[-_TAIL:]:
        # OpenCV 4 decodes the beginning and leaves the rest black; version 5 complains on stderr.
        raise RecordingError(f"{name}: not a readable image: the PNG is cut short")
    try:
        image = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        raise RecordingError(f"{name}: not a readable image")
    decoded: Array = image
    return decoded


def read_grey(path: Path, shape: tuple[int, int], like: Path | None = None) -> Image:
    """The grey picture (H, W) uint8 in a PNG or JPEG file, whose size must be `shape`: its header is believed first.

    like: the picture that has this size, where no calibration tells it.

    Raises RecordingError, naming path, when it cannot be read or is of another size.
    """
    return decode_grey(check_size(path, shape, like), str(path))


def read_depth(path: Path, shape: tuple[int, int]) -> NDArray[np.uint16]:
    """The numbers (H, W) uint16 in a PNG file of depths, whose size must be `shape`: its header is believed first.

    Raises RecordingError, naming path, when it cannot be read, is of another size or not one channel of 16 bits.
    """
    encoded = check_size(path, shape)
    if not encoded.startswith(_PNG_SIGNATURE):
        raise RecordingError(f"{path}: not a PNG image, as depths must be")
    image = _decoded(encoded, str(path))
    if image.dtype != np.uint16 or image.ndim != 2:
        channels = 1 if image.ndim == 2 else image.shape[2]
        seen = f"{channels} channel{'s' * (channels > 1)} of {image.dtype.itemsize * 8} bits"
        raise RecordingError(f"{path}: not a depth image of one channel of 16 bits, but {seen}")
    return image


def picture_size(path: Path) -> tuple[int, int]:
    """(height, width) of the PNG or JPEG picture in a file, by its header.

    Raises RecordingError, naming path, when it cannot be read or claims to be larger than any camera's.
    """
    height, width = image_size(read_bytes(path), str(path))
    if not 0 < height * width <= MOST_PIXELS:
        raise RecordingError(f"{path}: claims to be {width} x {height} px; at most {MOST_PIXELS} px are read")
    return height, width


def check_size(path: Path, shape: tuple[int, int], like: Path | None = None) -> bytes:
    """The contents of a PNG or JPEG file that says to be (height, width). Raises RecordingError as read_grey does."""
    encoded = read_bytes(path)
    height_px, width_px = image_size(encoded, str(path))
    if (height_px, width_px) != shape:
        who = "the calibration is for" if like is None else f"{like} is"
        raise RecordingError(f"{path}: the image is {width_px} x {height_px} px, {who} {shape[1]} x {shape[0]} px")
    return encoded


def read_bytes(path: Path) -> bytes:
    """The contents of a file. Raises RecordingError, naming path, when it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error


def grey(image: Image) -> Image:
    """The grey picture (H, W) of one (H, W), (H, W, 3) BGR or (H, W, 4) BGRA, uint8."""
    if image.ndim == 2:
        return image
    code = cv2.COLOR_BGRA2GRAY if image.shape[2] == 4 else cv2.COLOR_BGR2GRAY
    converted: Image = cv2.cvtColor(image, code)
    return converted
