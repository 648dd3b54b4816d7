"""What a V4L2 node says of itself, by ioctl: what it is and the modes it offers. Linux's videodev2.h."""

import ctypes
import fcntl
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

CAPTURE = 0x1
CAPTURE_MPLANE = 0x1000
_HAS_DEVICE_CAPS = 0x80000000
_VIDEO_CAPTURE_TYPE = 1
_CAPABILITY = struct.Struct("16s32s32sIII12x")
_FORMAT = struct.Struct("III32sII12x")
_FRAME_SIZE = struct.Struct("III6I8x")
_FRAME_INTERVAL = struct.Struct("IIIII6I8x")
_DISCRETE = 1
_MOST_LISTED = 64
"""A driver that never ends its list must not hold up who asks."""


def _ioc(direction: int, number: int, size: int) -> int:
    """The number of an ioctl of V4L2: direction 2 reads, 3 also writes."""
    return direction << 30 | size << 16 | ord("V") << 8 | number


_QUERYCAP = _ioc(2, 0, _CAPABILITY.size)
_ENUM_FORMATS = _ioc(3, 2, _FORMAT.size)
_ENUM_SIZES = _ioc(3, 74, _FRAME_SIZE.size)
_ENUM_INTERVALS = _ioc(3, 75, _FRAME_INTERVAL.size)


@dataclass(frozen=True)
class Capabilities:
    """driver, card, bus: as the kernel names them; device_caps: what this very node can do, not its whole device."""

    driver: str
    card: str
    bus: str
    device_caps: int

    @property
    def captures(self) -> bool:
        """Whether pictures can be read from the node; false for a metadata node."""
        return bool(self.device_caps & (CAPTURE | CAPTURE_MPLANE))


@dataclass(frozen=True)
class Mode:
    """One size that a camera offers in one pixel format. fps: the rates, highest first; () where it does not say."""

    fourcc: str
    width_px: int
    height_px: int
    fps: tuple[float, ...]

    def __str__(self) -> str:
        rates = "/".join(f"{rate:g}" for rate in self.fps)
        return f"{self.fourcc} {self.width_px}x{self.height_px}" + (f" at {rates}" if rates else "")


def query_capabilities(node: str | Path) -> Capabilities:
    """What the node is. Raises OSError: it is not there, may not be opened, or is no V4L2 node."""
    with _opened(node) as file:
        data = fcntl.ioctl(file, _QUERYCAP, bytes(_CAPABILITY.size))
    driver, card, bus, _, capabilities, device_caps = _CAPABILITY.unpack(data)
    caps = device_caps if capabilities & _HAS_DEVICE_CAPS else capabilities
    return Capabilities(_text(driver), _text(card), _text(bus), caps)


def offered_modes(node: str | Path) -> list[Mode]:
    """The modes that the node lists; of a range of sizes the smallest and the largest. Raises OSError as above."""
    with _opened(node) as file:
        return [
            Mode(_fourcc(pixels), *size, _rates(file, pixels, size))
            for pixels in _formats(file)
            for size in _sizes(file, pixels)
        ]


@contextmanager
def _opened(node: str | Path) -> Iterator[int]:
    file = os.open(node, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        yield file
    finally:
        os.close(file)


def _listed(file: int, request: int, ask: struct.Struct, *fields: int) -> Iterator[tuple[int, ...]]:
    """The answers to an enumerating ioctl, from index 0 until the driver says that there are no more."""
    for index in range(_MOST_LISTED):
        question = ctypes.create_string_buffer(ask.size)
        struct.pack_into(f"{1 + len(fields)}I", question, 0, index, *fields)
        try:
            fcntl.ioctl(file, request, question)
        except OSError:
            return
        yield ask.unpack(question.raw)


def _formats(file: int) -> Iterator[int]:
    for answer in _listed(file, _ENUM_FORMATS, _FORMAT, _VIDEO_CAPTURE_TYPE):
        yield answer[4]


def _sizes(file: int, pixels: int) -> Iterator[tuple[int, int]]:
    for _, _, kind, *numbers in _listed(file, _ENUM_SIZES, _FRAME_SIZE, pixels):
        if kind == _DISCRETE:
            yield numbers[0], numbers[1]
        else:
            least_width, most_width, _, least_height, most_height, _ = numbers
            yield least_width, least_height
            yield most_width, most_height
            return


def _rates(file: int, pixels: int, size: tuple[int, int]) -> tuple[float, ...]:
    rates: set[float] = set()
    for *_, kind, a, b, c, d, _, _ in _listed(file, _ENUM_INTERVALS, _FRAME_INTERVAL, pixels, *size):
        # A discrete interval is a / b seconds; a range lasts from a / b to c / d.
        rates.update(
            round(below / above, 3) for above, below in ((a, b), (c, d))[: 1 if kind == _DISCRETE else 2] if above
        )
        if kind != _DISCRETE:
            break
    return tuple(sorted(rates, reverse=True))


def _fourcc(pixels: int) -> str:
    return pixels.to_bytes(4, "little").decode("latin-1").rstrip()


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("utf-8", "replace")
