"""Multipart streams, as servers write them and as nobody should."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.cameras.multipart import MOST_HEAD, MOST_PICTURE, MultipartParser
from hardware.errors import CameraError

BODIES = [b"\xff\xd8 one \xff\xd9", b"\xff\xd8 two \r\n--fra \xff\xd9", b"", b"\r\n\xff\xd8\r\n\r\n\xff\xd9"]


def stream(bodies: list[bytes], *, length: bool, dashes: bytes = b"--", end: bytes = b"\r\n") -> bytes:
    parts = []
    for k, body in enumerate(bodies):
        head = [dashes + b"frame", b"Content-type: image/jpeg", b"X-Timestamp: %d.5" % k]
        if length:
            head.append(b"CONTENT-LENGTH: %d" % len(body))
        parts.append(end.join([*head, b"", b""]) + body + end)
    return b"".join(parts) + dashes + b"frame" + end


def feed(parser: MultipartParser, data: bytes, cuts: list[int]) -> list[bytes]:
    places = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    return [part.data for a, b in pairwise(places) for part in parser.feed(data[a:b])]


@settings(max_examples=200)
@given(
    st.lists(st.integers(0, 10**6), max_size=40),
    st.booleans(),
    st.sampled_from(["frame", "--frame", ""]),
    st.sampled_from([b"--", b"----"]),
    st.sampled_from([b"\r\n", b"\n"]),
)
def test_the_parts_are_the_same_however_the_bytes_are_split_and_the_boundary_is_written(
    cuts: list[int], length: bool, boundary: str, dashes: bytes, end: bytes
) -> None:
    data = stream(BODIES, length=length, dashes=dashes, end=end)
    assert feed(MultipartParser(boundary), data, cuts) == BODIES


def test_headers_are_found_by_their_names_in_small_letters() -> None:
    (first, *_) = MultipartParser("frame").feed(stream(BODIES, length=True))
    assert first.headers == {"content-type": "image/jpeg", "x-timestamp": "0.5", "content-length": str(len(BODIES[0]))}


def test_a_length_is_believed_even_where_the_picture_holds_the_boundary() -> None:
    body = b"before\r\n--frame\r\nafter"
    (found,) = MultipartParser("frame").feed(stream([body], length=True))
    assert found.data == body


def test_what_precedes_the_first_boundary_is_skipped() -> None:
    data = b"preamble of some server\r\n" + stream(BODIES, length=True)
    assert feed(MultipartParser("frame"), data, []) == BODIES


@pytest.mark.parametrize(
    "data",
    [
        b"--frame\r\nContent-Length: 99999999999999999999\r\n\r\n",
        b"--frame\r\nContent-Length: %d\r\n\r\n" % (MOST_PICTURE + 1),
        b"--frame\r\nContent-Length: -5\r\n\r\n",
        b"--frame\r\nContent-Length: five\r\n\r\n",
        b"--frame\r\n" + b"X-Filler: 1\r\n" * MOST_HEAD,
        b"no boundary at all " * MOST_HEAD,
        b"--frame\r\n\r\n" + bytes(MOST_PICTURE + 10),
    ],
)
def test_what_would_grow_without_end_or_makes_no_sense_is_refused(data: bytes) -> None:
    parser = MultipartParser("frame")
    with pytest.raises(CameraError):
        for start in range(0, len(data), 65536):
            parser.feed(data[start : start + 65536])


@pytest.mark.parametrize("data", [b"<html>\r\n<body>", b"\xff\xd8\xff\xe0 a picture\n", b"-" * 300, b"x" * 300])
def test_a_stream_that_announces_no_boundary_must_start_with_one(data: bytes) -> None:
    with pytest.raises(CameraError, match="no multipart stream"):
        MultipartParser("").feed(data)


@settings(max_examples=200)
@given(st.lists(st.binary(max_size=60) | st.sampled_from([b"--frame", b"\r\n", b"\r\n\r\n", b"Content-Length: 3"])))
def test_garbage_gives_parts_or_an_error_of_ours(pieces: list[bytes]) -> None:
    parser = MultipartParser("frame")
    try:
        for piece in pieces:
            parser.feed(piece)
    except CameraError:
        pass
