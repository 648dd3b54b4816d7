"""Uncompressed pictures in the encodings that drivers send."""

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from stereogrid.errors import InvalidInputError
from stereogrid.recording.ros2_images import read_image

GREY = np.tile(np.linspace(20, 230, 16).astype(np.uint8), (12, 1))
COLOUR_BGR = (40, 120, 200)


def message(pixels: np.ndarray, encoding: str, *, big: bool = False) -> Any:
    height, width = pixels.shape[:2]
    return SimpleNamespace(
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=int(big),
        step=pixels.nbytes // height,
        data=pixels.tobytes(),
    )


@pytest.mark.parametrize("big", [False, True])
def test_of_sixteen_bits_the_upper_eight_count(big: bool) -> None:
    pixels = (GREY.astype(np.uint16) * 256 + 99).astype(">u2" if big else "<u2")
    np.testing.assert_array_equal(read_image(message(pixels, "mono16", big=big), "/left", GREY.shape), GREY)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_plain_colour_through_a_bayer_filter_is_as_grey_as_it_is(pattern: str, bits: int) -> None:
    """The pattern's letters are the filters of the first two rows' first two pixels."""
    value = dict(zip("bgr", COLOUR_BGR, strict=True))
    tile = np.array([value[letter] for letter in pattern], np.uint8).reshape(2, 2)
    pixels = np.tile(tile, (6, 8))
    if bits == 16:
        pixels = pixels.astype("<u2") * 256
    expected = cv2.cvtColor(np.full((1, 1, 3), COLOUR_BGR, np.uint8), cv2.COLOR_BGR2GRAY)[0, 0]
    read = read_image(message(pixels, f"bayer_{pattern}{bits}"), "/left", (12, 16))
    assert read.dtype == np.uint8 and np.abs(read[2:-2, 2:-2].astype(int) - int(expected)).max() <= 1


@pytest.mark.parametrize(("encoding", "place"), [("yuv422", 1), ("uyvy", 1), ("yuv422_yuy2", 0), ("yuyv", 0)])
def test_of_two_bytes_for_brightness_and_colour_the_brightness_is_taken(encoding: str, place: int) -> None:
    pixels = np.full((12, 16, 2), 128, np.uint8)
    pixels[:, :, place] = GREY
    np.testing.assert_array_equal(read_image(message(pixels, encoding), "/left", GREY.shape), GREY)


@pytest.mark.parametrize("encoding", ["mono16", "bayer_rggb8", "yuyv", "rgb8"])
def test_too_few_bytes_are_said(encoding: str) -> None:
    short = message(np.zeros((12, 16, 3), np.uint8), encoding)
    short.data = short.data[:100]
    with pytest.raises(InvalidInputError, match="/left: 100 bytes are too few for 16x12 px"):
        read_image(short, "/left", (12, 16))
