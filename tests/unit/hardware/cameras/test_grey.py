"""The luminance of what cameras send, and of what they should not."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from picture_servers import bomb, numbered

from hardware.cameras.grey import decoder, from_bgr, from_jpeg
from hardware.errors import CameraError
from stereogrid.jpeg_header import jpeg_size_px
from stereogrid.mjpeg import jpeg
from stereogrid.recording.images import image_size

SIZE_PX = (64, 48)
GREY = np.random.default_rng(3).integers(0, 256, (48, 64), np.uint8)


def coded(image: np.ndarray, *options: int) -> bytes:
    return bytes(cv2.imencode(".jpg", image, list(options))[1])


@pytest.mark.parametrize(
    ("fourcc", "data"),
    [
        ("YUYV", np.dstack([GREY, 255 - GREY]).tobytes()),
        ("UYVY", np.dstack([255 - GREY, GREY]).tobytes()),
        ("GREY", GREY.tobytes()),
        ("NV12", GREY.tobytes() + bytes(64 * 24)),
        ("YU12", GREY.tobytes() + bytes(64 * 24)),
    ],
)
def test_the_luminance_is_the_cameras_own_to_the_bit(fourcc: str, data: bytes) -> None:
    decode = decoder(fourcc, SIZE_PX)
    assert decode is not None
    np.testing.assert_array_equal(decode(data), GREY)
    with pytest.raises(CameraError, match="64x48 has only"):
        decode(data[: GREY.size - 1])


def test_a_format_whose_luminance_we_do_not_know_is_left_to_opencv() -> None:
    assert decoder("BGR3", SIZE_PX) is None
    colours = np.repeat(GREY[..., None], 3, axis=2)
    np.testing.assert_array_equal(from_bgr(SIZE_PX, colours.tobytes()), GREY)


def test_a_jpeg_is_grey_of_its_own_size_in_colour_or_not_and_with_anything_behind_its_end() -> None:
    smooth = cv2.GaussianBlur(GREY, (0, 0), 3)
    for image in (smooth, cv2.merge([smooth] * 3)):
        for tail in (b"", b"\0" * 100, b"\r\n"):
            data = coded(image) + tail
            assert jpeg_size_px(data) == SIZE_PX
            picture = from_jpeg(data)
            assert picture.shape == (48, 64) and np.abs(picture.astype(int) - smooth).max() <= 6


def test_cameras_and_recordings_read_the_size_of_a_jpeg_with_fill_bytes() -> None:
    data = coded(GREY)
    # Any number of them may stand before a marker (ITU T.81, B.1.1.2).
    filled = data[:2] + b"\xff\xff\xff" + data[2:]
    assert jpeg_size_px(filled) == SIZE_PX and image_size(filled, "x") == SIZE_PX[::-1]
    np.testing.assert_array_equal(from_jpeg(filled), from_jpeg(data))


def test_a_progressive_jpeg_is_read_too() -> None:
    assert from_jpeg(coded(GREY, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)).shape == (48, 64)


def test_no_length_of_a_jpeg_but_the_whole_is_a_picture() -> None:
    data = jpeg(numbered(7))
    start = data.index(b"\xff\xda") + 2
    for length in range(0, len(data) - 2, 7):
        with pytest.raises(CameraError, match="cut short" if length > start else "no JPEG|no size|cut short"):
            from_jpeg(data[:length])


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (bomb(), "65500x65500"),
        (b"", "no JPEG"),
        (b"<html>not found</html>", "no JPEG"),
        (bytes(cv2.imencode(".png", GREY)[1]), "no JPEG"),
        (b"\xff\xd8" + b"\xff" * 1000, "no size"),
        (b"\xff\xd8\xff\xe0\x00\x00" * 100, "no size"),
    ],
)
def test_what_is_no_jpeg_or_a_bomb_is_refused_with_the_reason(data: bytes, said: str) -> None:
    with pytest.raises(CameraError, match=said):
        from_jpeg(data)


@settings(max_examples=200)
@given(st.integers(0, 10**6), st.binary(min_size=1, max_size=8))
def test_a_damaged_jpeg_is_a_picture_or_an_error_of_ours(place: int, junk: bytes) -> None:
    data = bytearray(jpeg(numbered(90)))
    at = place % len(data)
    data[at : at + len(junk)] = junk
    try:
        picture = from_jpeg(bytes(data))
    except CameraError:
        return
    assert picture.ndim == 2 and picture.dtype == np.uint8
