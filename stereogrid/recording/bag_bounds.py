"""Limits to what compressed parts of a bag may unpack to: a hostile one may claim or become anything."""

import bz2
import shutil
from pathlib import Path
from typing import Any

import lz4.frame
import zstandard

from ..errors import InvalidInputError, RecordingError
from .mcap_file import MAX_CHUNK_BYTES, unpack_bounded

MAX_GROWTH = 200
"""No file of pictures unpacks to so many times its size."""
_PIECE_BYTES = 2**20


def bound_chunks(reader: Any) -> None:
    """Make an open reader of a ROS 1 bag refuse chunks that unpack to more than MAX_CHUNK_BYTES."""
    from rosbags.rosbag1.reader import Compression, decompressors

    makers = {
        decompressors[Compression.BZ2.value]: bz2.BZ2Decompressor,
        decompressors[Compression.LZ4.value]: lz4.frame.LZ4FrameDecompressor,
    }
    for position, chunk in reader.chunks.items():
        maker = makers.get(chunk.decompressor)
        if maker is not None:
            reader.chunks[position] = chunk._replace(decompressor=_Bounded(maker))


class _Bounded:
    """Unpacks with a decompressor of one's own, made by `maker`, no more than MAX_CHUNK_BYTES."""

    def __init__(self, maker: Any) -> None:
        self._maker = maker

    def __call__(self, packed: bytes) -> bytes:
        return unpack_bounded(self._maker(), packed, MAX_CHUNK_BYTES)


def unpack_message(packed: bytes) -> bytes:
    """Of one message that is compressed by zstd. Raises InvalidInputError when it is none, or too large."""
    try:
        with zstandard.ZstdDecompressor().stream_reader(packed) as stream:
            unpacked: bytes = stream.read(MAX_CHUNK_BYTES + 1)
    except zstandard.ZstdError as error:
        raise InvalidInputError(f"a message cannot be unpacked: {error}") from error
    if len(unpacked) > MAX_CHUNK_BYTES:
        raise InvalidInputError(f"a message unpacks to more than {MAX_CHUNK_BYTES} bytes")
    return unpacked


def unpack_file(packed: Path, to: Path) -> None:
    """Of a file that is compressed by zstd. Raises RecordingError when it is none, or there is no room for it."""
    limit = min(MAX_GROWTH * packed.stat().st_size + _PIECE_BYTES, shutil.disk_usage(to.parent).free)
    written = 0
    try:
        with (
            packed.open("rb") as source,
            to.open("wb") as target,
            zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True) as stream,
        ):
            while piece := stream.read(_PIECE_BYTES):
                written += len(piece)
                if written > limit:
                    raise RecordingError(f"{packed}: unpacks to more than {limit} bytes")
                target.write(piece)
    except (OSError, zstandard.ZstdError) as error:
        raise RecordingError(f"{packed}: cannot be unpacked: {error}") from error
