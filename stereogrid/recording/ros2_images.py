"""The grey picture in a ROS image message, whatever its encoding."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError, unknown_name
from ..observation import Image
from .images import decode_grey, grey, image_size

_CHANNELS = {"mono8": 1, "8UC1": 1, "bgr8": 3, "8UC3": 3, "rgb8": 3, "bgra8": 4, "8UC4": 4, "rgba8": 4}
_OTHERS = {
    # OpenCV names the pattern by its second row and column, ROS by its first.
    "bayer_rggb": cv2.COLOR_BayerBG2GRAY,
    "bayer_bggr": cv2.COLOR_BayerRG2GRAY,
    "bayer_gbrg": cv2.COLOR_BayerGR2GRAY,
    "bayer_grbg": cv2.COLOR_BayerGB2GRAY,
    "yuv422": cv2.COLOR_YUV2GRAY_UYVY,
    "uyvy": cv2.COLOR_YUV2GRAY_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2GRAY_YUY2,
    "yuyv": cv2.COLOR_YUV2GRAY_YUY2,
}
"""How OpenCV makes a grey picture of what is neither grey nor one colour after the other."""
_BAYER = [name for name in _OTHERS if name.startswith("bayer")]
_PIXEL_BYTES = {
    **_CHANNELS,
    "mono16": 2,
    **{f"{name}8": 1 for name in _BAYER},
    **{f"{name}16": 2 for name in _BAYER},
    **{name: 2 for name in _OTHERS if name not in _BAYER},
}
"""By encoding of an uncompressed picture."""


def read_image(message: Any, name: str, shape: tuple[int, int]) -> Image:
    """The grey picture (H, W) uint8 of a decoded CompressedImage (PNG, JPEG) or Image.

    Of 16 bits the upper 8 count, as cv_bridge has it.
    Raises InvalidInputError or RecordingError, naming `name`, when it is not of this shape or cannot be read.
    """
    if not hasattr(message, "encoding"):
        _check_shape(name, image_size(message.data, name), shape)
        return decode_grey(message.data, name)
    _check_shape(name, (message.height, message.width), shape)
    return _grey_of(_pixels(message, name), message.encoding)


def _pixels(message: Any, name: str) -> NDArray[np.uint8]:
    """(H, W, channels): 8 bits each."""
    encoding, height, width = message.encoding, message.height, message.width
    n_bytes = _PIXEL_BYTES.get(encoding)
    if n_bytes is None:
        raise unknown_name(f"encoding of {name}", encoding, _PIXEL_BYTES)
    rows = np.frombuffer(message.data, np.uint8)
    if message.step < n_bytes * width or rows.size < message.step * height:
        raise InvalidInputError(f"{name}: {rows.size} bytes are too few for {width}x{height} px")
    rows = rows[: message.step * height].reshape(height, message.step)
    pixels = rows[:, : n_bytes * width].reshape(height, width, n_bytes)
    return pixels[:, :, [0 if message.is_bigendian else 1]] if encoding.endswith("16") else pixels


def _grey_of(pixels: NDArray[np.uint8], encoding: str) -> Image:
    code = _OTHERS.get(encoding if encoding in _OTHERS else encoding.removesuffix("16").removesuffix("8"))
    if encoding.startswith("rgb"):
        pixels = pixels[:, :, [2, 1, 0, *range(3, pixels.shape[2])]]
    image = np.ascontiguousarray(pixels.squeeze(axis=2) if pixels.shape[2] == 1 else pixels)
    if code is None:
        return grey(image)
    converted: Image = cv2.cvtColor(image, code)
    return converted


def _check_shape(name: str, shape: tuple[int, int], expected: tuple[int, int]) -> None:
    if shape != expected:
        raise InvalidInputError(f"{name} is {shape}, the recording's camera {expected}")
