"""The pictures of a multipart stream, however its bytes are split; bounded whatever comes."""

import re
from dataclasses import dataclass

from ..errors import CameraError

MOST_HEAD = 16_384
MOST_PICTURE = 4 << 20
"""Bytes of one part's headers, and of one picture."""
_MOST_BOUNDARY = 256
_EMPTY_LINE = re.compile(rb"\r?\n\r?\n")


@dataclass(frozen=True)
class Part:
    """headers: names in small letters. data: the picture's bytes."""

    headers: dict[str, str]
    data: bytes


class MultipartParser:
    """Takes the bytes of multipart/x-mixed-replace as they come, gives the parts that are complete.

    boundary: as the header of the whole stream says; "" where it says none: then the first line's. Where a part tells
    its length it is believed, else the part ends at the next boundary. Raises CameraError for what is no such stream.
    """

    def __init__(self, boundary: str) -> None:
        self._buffer = bytearray()
        self._headers: dict[str, str] | None = None
        self._searched = 0
        self._boundary: re.Pattern[bytes] | None = None
        self._name(boundary.encode("latin-1", "replace"))

    def feed(self, data: bytes) -> list[Part]:
        """More bytes of the stream."""
        self._buffer += data
        parts: list[Part] = []
        while self._step(parts):
            pass
        return parts

    def _name(self, boundary: bytes) -> None:
        # Some cameras announce the boundary with the dashes that only its lines should have.
        name = boundary.strip(b"-")
        if name:
            self._boundary = re.compile(rb"(?:^|\r?\n)-{2,}" + re.escape(name))

    def _step(self, parts: list[Part]) -> bool:
        """Take one head or one picture off the buffer; false where it is not complete."""
        if self._headers is None:
            return self._take_head()
        length = _length(self._headers)
        body = self._take(length) if length is not None else self._take_until_boundary()
        if body is None:
            return False
        parts.append(Part(self._headers, body))
        self._headers = None
        return True

    def _take_head(self) -> bool:
        """The boundary's line and the headers below it, up to an empty line."""
        start = self._skip_to_boundary()
        if start is None:
            return False
        end = _EMPTY_LINE.search(self._buffer, start, start + MOST_HEAD)
        if end is None:
            if len(self._buffer) - start >= MOST_HEAD:
                raise CameraError(f"the headers of a picture are longer than {MOST_HEAD} bytes")
            return False
        self._headers = _headers(bytes(self._buffer[start : end.start()]))
        del self._buffer[: end.end()]
        self._searched = 0
        return True

    def _skip_to_boundary(self) -> int | None:
        """Where the line below the next boundary's name begins, or its rest; None: not here yet."""
        if self._boundary is None:
            self._name(self._first_line())
            if self._boundary is None:
                return None
        found = self._boundary.search(self._buffer)
        if found is None and len(self._buffer) > MOST_HEAD:
            raise CameraError(f"no boundary within {len(self._buffer)} bytes")
        return None if found is None else found.end()

    def _first_line(self) -> bytes:
        """The boundary of a stream that announced none; b"" while its line is not complete."""
        line, end, _ = bytes(self._buffer[:_MOST_BOUNDARY]).lstrip(b"\r\n").partition(b"\n")
        if not end and len(self._buffer) < _MOST_BOUNDARY:
            return b""
        if not end or not line.startswith(b"--") or not line.strip(b"-\r"):
            raise CameraError(f"it is no multipart stream: it starts with {line[:32]!r}")
        return line.rstrip(b"\r")

    def _take(self, length: int) -> bytes | None:
        if length > MOST_PICTURE:
            raise CameraError(f"a picture claims {length} bytes, more than {MOST_PICTURE}")
        if len(self._buffer) < length:
            return None
        body = bytes(self._buffer[:length])
        del self._buffer[:length]
        return body

    def _take_until_boundary(self) -> bytes | None:
        assert self._boundary is not None
        found = self._boundary.search(self._buffer, max(0, self._searched - _MOST_BOUNDARY))
        self._searched = len(self._buffer)
        if found is None:
            if len(self._buffer) > MOST_PICTURE:
                raise CameraError(f"a picture is longer than {MOST_PICTURE} bytes")
            return None
        body = bytes(self._buffer[: found.start()])
        del self._buffer[: found.start()]
        return body


def _headers(lines: bytes) -> dict[str, str]:
    """The headers by their names in small letters."""
    pairs = (line.partition(":") for line in lines.decode("latin-1").splitlines())
    return {name.strip().lower(): value.strip() for name, colon, value in pairs if colon}


def _length(headers: dict[str, str]) -> int | None:
    text = headers.get("content-length")
    if text is None:
        return None
    if not (text.isascii() and text.isdigit()):
        raise CameraError(f"a picture's Content-Length is {text[:32]!r}")
    return int(text) if len(text) < 16 else MOST_PICTURE + 1
