"""The records of an MCAP file in their order, over damage: what cannot be read is passed over."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import IO, Any, cast

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Schema, Statistics
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from ..errors import InvalidInputError, RecordingError

MAX_CHUNK_BYTES = 2**28
"""No chunk of ours comes near; a damaged or hostile one may claim to unpack to anything."""
FIRST_FOREIGN = 0x80
"""Opcodes from here on are for records of other programs' own."""
MAX_DAMAGES = 100
"""A file that is damaged in more places is no file any more, and could be made so to keep a reader busy."""

_HEAD = struct.Struct("<BQ")
"""Of every record: its opcode and how many bytes follow."""
_CHUNK_HEAD = struct.Struct("<BQQQQII")
"""Of a chunk: with its times, unpacked size, checksum, and the length of its compression's name."""
_COMPRESSIONS = {0: b"", 3: b"lz4", 4: b"zstd"}
_FOOTER = struct.Struct("<BQQQI8s")
_WINDOW = 2**20


class ClippedFile:
    """A file that never reads past its end, so that a damaged length cannot ask for gigabytes of memory."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("rb")
            self.size = path.stat().st_size
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error

    def read(self, n_bytes: int) -> bytes:
        """At most n_bytes bytes, fewer at the end of the file."""
        if n_bytes < 0:
            raise ValueError("a record of negative length")
        return self._file.read(min(n_bytes, self.size - self._file.tell()))

    def tell(self) -> int:
        """Offset of the next byte."""
        return self._file.tell()

    def seek(self, offset: int) -> None:
        """Go on reading there."""
        self._file.seek(offset)

    def bytes_at(self, offset: int, n_bytes: int) -> bytes:
        """At most n_bytes bytes from an offset on."""
        self.seek(offset)
        return self.read(n_bytes)

    def records_at(self, offset: int) -> list[McapRecord]:
        """The record at an offset, or those in it when it is a chunk. Raises whatever the mcap library raises."""
        self.seek(offset)
        return _opened(next(_stream_reader(self).records))

    def __enter__(self) -> "ClippedFile":
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._file.close()


class Records:
    """The records of a file, each with its offset, or those of a chunk with that of the chunk; iterate once.

    Every chunk's checksum is checked, so what is given can be read again later. What cannot be read is passed over: to
    the next record where there is one, else to the next chunk. After the first damage come the schemas, channels and
    counts that the end of the file has, since those in their places may be lost.
    Raises RecordingError, when it is iterated, for a file that does not begin as MCAP files do.

    damages: what was wrong where, in words, so far; is_empty: so far not a single record was whole.
    """

    def __init__(self, file: ClippedFile, path: Path) -> None:
        self.damages: list[str] = []
        self.is_empty = True
        self._file, self._path = file, path

    def __iter__(self) -> Iterator[tuple[int, list[McapRecord]]]:
        if self._file.bytes_at(0, len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise RecordingError(f"{self._path}: not an MCAP file, or cut off in its first bytes")
        offset: int | None = len(MCAP0_MAGIC)
        while offset is not None:
            found, after = self._tried(offset)
            yield offset, found
            offset = after

    def _tried(self, offset: int) -> tuple[list[McapRecord], int | None]:
        """As _record_at; of what cannot be read nothing, and where to go on."""
        try:
            read = self._record_at(offset)
        except Exception as error:
            # The mcap library raises whatever its parsers stumble on: struct, Unicode, zstd, memory errors.
            self.damages.append(f"byte {offset}: {str(error) or type(error).__name__}")
            onward = self._onward(offset) if len(self.damages) < MAX_DAMAGES else None
            return self._repeated() if len(self.damages) == 1 else [], onward
        self.is_empty = False
        return read

    def _record_at(self, offset: int) -> tuple[list[McapRecord], int | None]:
        """The record there, or those of the chunk there, and where the next one begins: None after the last."""
        head = self._head_at(offset)
        if head is None:
            raise InvalidInputError("the file ends there")
        opcode, length = head
        after = offset + _HEAD.size + length
        if opcode >= FIRST_FOREIGN and after <= self._file.size:
            return [], after
        if not Opcode.HEADER <= opcode <= Opcode.DATA_END:
            raise InvalidInputError(f"no record is of the kind {opcode}")
        found = self._file.records_at(offset)
        if opcode != Opcode.FOOTER:
            return found, after
        if self._file.bytes_at(after, len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise InvalidInputError("it does not end as an MCAP file does")
        return found, None

    def _onward(self, offset: int) -> int | None:
        """Where the next record begins that may be whole, after a damaged one; None when there is none."""
        _, length = self._head_at(offset) or (0, self._file.size)
        after = offset + _HEAD.size + length
        opcode, length = self._head_at(after) or (0, self._file.size)
        is_record = Opcode.HEADER <= opcode <= Opcode.DATA_END and after + _HEAD.size + length <= self._file.size
        return after if is_record else self._next_chunk(offset + 1)

    def _head_at(self, offset: int) -> tuple[int, int] | None:
        head = self._file.bytes_at(offset, _HEAD.size) if offset < self._file.size else b""
        return None if len(head) < _HEAD.size else _HEAD.unpack(head)

    def _next_chunk(self, start: int) -> int | None:
        """The first offset from `start` on where a chunk begins whose lengths agree with each other."""
        for base in range(start, self._file.size, _WINDOW):
            window = self._file.bytes_at(base, _WINDOW + _CHUNK_HEAD.size + 12)
            at = window.find(Opcode.CHUNK)
            while 0 <= at < _WINDOW:
                if _begins_chunk(window[at : at + _CHUNK_HEAD.size + 12], self._file.size - base - at):
                    return base + at
                at = window.find(Opcode.CHUNK, at + 1)
        return None

    def _repeated(self) -> list[McapRecord]:
        """The schemas, channels and counts in the file's summary; none where that cannot be read."""
        end = self._file.size - _FOOTER.size
        try:
            opcode, length, start, _, crc, magic = _FOOTER.unpack(self._file.bytes_at(max(end, 0), _FOOTER.size))
            fits = (opcode, length, magic) == (Opcode.FOOTER, 20, MCAP0_MAGIC) and 0 < start <= end
            if not fits or end - start > MAX_CHUNK_BYTES:
                return []
            summary = self._file.bytes_at(start, self._file.size - start)
            # All up to the checksum itself.
            if crc and zlib.crc32(summary[:-12]) != crc:
                return []
            found = StreamReader(BytesIO(summary), skip_magic=True, record_size_limit=len(summary)).records
            return [record for record in found if isinstance(record, Schema | Channel | Statistics)]
        except Exception:
            # As above.
            return []


def _begins_chunk(head: bytes, n_left: int) -> bool:
    """Whether the first bytes of something are a chunk's, of which n_left bytes are left in the file."""
    if len(head) < _CHUNK_HEAD.size:
        return False
    _, length, _, _, unpacked, _, n_name = _CHUNK_HEAD.unpack_from(head)
    name = _COMPRESSIONS.get(n_name)
    if name is None or _HEAD.size + length > n_left or unpacked > MAX_CHUNK_BYTES:
        return False
    rest = head[_CHUNK_HEAD.size :]
    (n_bytes,) = struct.unpack_from("<Q", rest.ljust(12, b"\xff"), n_name)
    return rest.startswith(name) and bool(length == _CHUNK_HEAD.size - _HEAD.size + n_name + 8 + n_bytes)


def _stream_reader(file: ClippedFile) -> StreamReader:
    # It needs only `read`, whatever its annotation says.
    stream = cast("IO[bytes]", file)
    return StreamReader(stream, skip_magic=True, emit_chunks=True, record_size_limit=file.size)


def _opened(record: McapRecord) -> list[McapRecord]:
    """The record, or the records in a chunk, whose checksum is verified. Raises whatever the mcap library raises."""
    if not isinstance(record, Chunk):
        return [record]
    claims = [record.uncompressed_size]
    if record.compression == "zstd":
        # It makes room for what its own frame claims.
        claims.append(zstandard.frame_content_size(record.data))
    if max(claims) > MAX_CHUNK_BYTES:
        raise InvalidInputError(f"a chunk claims to unpack to {max(claims)} bytes")
    if record.compression == "lz4":
        # Its decompressor goes on whatever was claimed.
        data = unpack_bounded(lz4.frame.LZ4FrameDecompressor(), record.data, record.uncompressed_size)
        record = replace(record, compression="", data=data)
    return breakup_chunk(record, validate_crc=True)


def unpack_bounded(decompressor: Any, packed: bytes, most_bytes: int) -> bytes:
    """What a decompressor of bz2 or lz4 makes of bytes. Raises InvalidInputError when it is more, or cut off."""
    unpacked: bytes = decompressor.decompress(packed, max_length=most_bytes + 1)
    if len(unpacked) > most_bytes:
        raise InvalidInputError(f"a chunk unpacks to more than {most_bytes} bytes")
    if not decompressor.eof:
        raise InvalidInputError("a chunk is cut off")
    return unpacked


def is_mcap(path: Path) -> bool:
    """True for a file that is named *.mcap or begins as MCAP files do."""
    if not path.is_file():
        return False
    with ClippedFile(path) as file:
        return path.suffix.lower() == ".mcap" or file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
