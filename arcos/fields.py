"""The fields that packets are made of: little-endian integers, by struct's letters, and strings that end with 0."""

import struct

from .errors import ArcosError

RANGES = {"B": (0, 0xFF), "b": (-0x80, 0x7F), "H": (0, 0xFFFF), "h": (-0x8000, 0x7FFF)}
"""Lowest and highest value by letter."""
TEXT = "s"


def check_fits(name: str, value: int, letter: str) -> None:
    """Raise ArcosError, naming the field, when the value does not fit."""
    low, high = RANGES[letter]
    if not (isinstance(value, int) and low <= value <= high):
        raise ArcosError(f"{name} must be a whole number of {low} to {high}, not {value!r}")


def text_bytes(text: str) -> bytes:
    """A string as sent: Latin-1 and a 0 byte. Raises ArcosError for one that cannot be sent."""
    try:
        data = text.encode("latin-1")
    except UnicodeEncodeError as error:
        raise ArcosError(f"{text!r} has letters that the protocol cannot send") from error
    if b"\0" in data:
        raise ArcosError(f"{text!r} has a 0 byte inside")
    return data + b"\0"


class Reader:
    """Takes fields from a body, from first to last."""

    def __init__(self, body: bytes, at: int = 0) -> None:
        self._body = body
        self._at = at

    @property
    def rest(self) -> bytes:
        """What has not been taken."""
        return self._body[self._at :]

    def holds(self, letter: str) -> bool:
        """Whether such an integer is left."""
        return len(self._body) - self._at >= struct.calcsize(f"<{letter}")

    def integer(self, letter: str) -> int:
        """The next integer. Raises ArcosError at the body's end."""
        if not self.holds(letter):
            raise ArcosError(f"the body ends after {len(self._body)} bytes, within a field")
        (value,) = struct.unpack_from(f"<{letter}", self._body, self._at)
        self._at += struct.calcsize(f"<{letter}")
        return int(value)

    def text(self) -> str:
        """The next string. Raises ArcosError when it does not end."""
        end = self._body.find(b"\0", self._at)
        if end < 0:
            raise ArcosError(f"a string does not end within the body's {len(self._body)} bytes")
        text = self._body[self._at : end].decode("latin-1")
        self._at = end + 1
        return text
