"""What a JPEG file says of itself, read without decoding it: it may claim any size."""

_START = b"\xff\xd8"
_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_BARE_MARKERS = frozenset(range(0xD0, 0xDA)) | {0x01}


def is_jpeg(data: bytes) -> bool:
    """Whether it begins as a JPEG does."""
    return data[:2] == _START


def jpeg_size_px(data: bytes) -> tuple[int, int] | None:
    """(width, height) in the header of a JPEG; None where it has none.

    Any number of fill bytes may stand before a marker: ITU T.81, B.1.1.2.
    """
    at = len(_START)
    while is_jpeg(data) and at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:
            at += 1
        elif marker in _BARE_MARKERS:
            at += 2
        elif marker in _FRAME_MARKERS:
            return int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
