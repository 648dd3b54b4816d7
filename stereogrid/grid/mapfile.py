"""The native map file (.sgrid): a magic line, one line of JSON, compressed blocks, and a checksum of it all.

    SGRID 2\\n
    {"cell_m": ..., "model": {...}, "fusion": ..., "clamp": [low, high] or null, "n_blocks": B}\\n
    zlib(indices int64 (B, 3) | words (B, 512) int32, int64 without a clamp, as grid/cells.py packs them)
    SHA-256 of all bytes before it (32 bytes)
All little-endian; blocks in lexical order of their indices, none twice, none that knows nothing: the same cells are the
same bytes, whatever the order they came in. Nothing in it is executed when it is read, and it is read and written in
pieces: a map takes its own memory and a few MB.
"""

import hashlib
import json
import zlib
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ..errors import MapTooLargeError, RecordingError, StereogridError
from ..files import written_beside
from ..geometry import Array
from ..sensor_model import SensorModel
from .blocks import CELLS, BlockStore
from .cells import LogOddsCells

if TYPE_CHECKING:
    from .occupancy import OccupancyGrid

FORMAT = b"SGRID "
MAGIC = FORMAT + b"2\n"
KEYS = {"cell_m", "model", "fusion", "clamp", "n_blocks"}
INDEX_BYTES = 3 * 8
LONGEST_HEADER = 10_000
DIGEST_BYTES = 32
PIECE_BYTES = 1 << 20
PIECE_BLOCKS = 512
FARTHEST_BLOCK = 2**49
"""Indices beyond it would leave what a cell's index may be."""
BEST_COMPRESSION = 1100
"""zlib packs no better than about 1030 to 1: a size beyond that is a lie, not a map."""


def save_grid(grid: "OccupancyGrid", path: Path) -> Path:
    """Write grid to path, beside and then renamed. Raises InvalidInputError where that is not possible."""
    digest = hashlib.sha256()
    with written_beside(path) as temporary, temporary.open("wb") as file:
        for piece in _content(grid):
            digest.update(piece)
            file.write(piece)
        file.write(digest.digest())
    return path


def _content(grid: "OccupancyGrid") -> Iterator[bytes]:
    """The file up to its checksum."""
    store = grid.blocks
    order = store.in_order()
    known = np.asarray(store.words[: len(store)].any(axis=1))
    rows = order[known[order]]
    header = {
        "cell_m": grid.cell_m,
        "model": asdict(grid.model),
        "fusion": grid.fusion,
        "clamp": grid.clamp,
        "n_blocks": len(rows),
    }
    yield MAGIC + json.dumps(header).encode() + b"\n"
    packer = zlib.compressobj(1)
    yield packer.compress(store.indices()[rows].astype("<i8").tobytes())
    for start in range(0, len(rows), PIECE_BLOCKS):
        words = store.words[rows[start : start + PIECE_BLOCKS]]
        yield packer.compress(words.astype(words.dtype.newbyteorder("<")).tobytes())
    yield packer.flush()


def load_grid(path: Path, *, memory_limit_gb: float = 4.0) -> "OccupancyGrid":
    """Read a map file. Raises RecordingError when it is missing, damaged, of another version or not a map.

    A map that would need more than memory_limit_gb is a MapTooLargeError, before room is made for it.
    """
    try:
        with path.open("rb") as file:
            header, n_compressed = _checked(file)
            grid = _empty(header, memory_limit_gb)
            _fill(grid.blocks, header["n_blocks"], _Unpacker(file, n_compressed))
            return grid
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    except MapTooLargeError as error:
        raise MapTooLargeError(f"{path}: {error}") from None
    except (StereogridError, ValueError, KeyError, TypeError, OverflowError, RecursionError, zlib.error) as error:
        raise RecordingError(f"{path}: not a sound map file: {error}") from None


def _checked(file: IO[bytes]) -> tuple[dict[str, Any], int]:
    """The header of a file whose checksum is right, and the length of what is compressed, where the file now stands."""
    magic = file.readline(len(MAGIC))
    if magic != MAGIC:
        other = f", not {magic.decode(errors='replace').strip()!r}" if magic.startswith(FORMAT) else ""
        raise ValueError(f"expected it to start with {MAGIC.decode().strip()!r}{other}")
    line = file.readline(LONGEST_HEADER)
    start, end = file.tell(), file.seek(0, 2) - DIGEST_BYTES
    digest = hashlib.sha256(magic + line)
    file.seek(start)
    for at in range(start, end, PIECE_BYTES):
        digest.update(file.read(min(PIECE_BYTES, end - at)))
    if end < start or file.read() != digest.digest():
        raise ValueError("it is cut short or damaged: its checksum does not match")
    file.seek(start)
    return _sound_header(json.loads(line), end - start), end - start


def _sound_header(header: dict[str, Any], n_compressed: int) -> dict[str, Any]:
    """header, which must have the keys of one; what they say of the map is checked where the map is made."""
    if set(header) != KEYS:
        raise ValueError(f"its header must have the keys {', '.join(sorted(KEYS))}, not {', '.join(sorted(header))}")
    n, clamp = header["n_blocks"], header["clamp"]
    if type(n) is not int or not 0 <= n * (INDEX_BYTES + CELLS * 4) <= BEST_COMPRESSION * n_compressed:
        raise ValueError(f"{n} blocks cannot be in {n_compressed} bytes")
    pair = isinstance(clamp, list) and len(clamp) == 2 and all(type(limit) in (int, float) for limit in clamp)
    if clamp is not None and not pair:
        raise ValueError(f"clamp must be [low, high] or null, not {clamp}")
    return header


def _empty(header: dict[str, Any], memory_limit_gb: float) -> "OccupancyGrid":
    """The map that the header tells of, still without blocks."""
    from .occupancy import OccupancyGrid

    grid = OccupancyGrid(
        header["cell_m"],
        model=SensorModel(**header["model"]),
        fusion=header["fusion"],
        clamp=header["clamp"],
        memory_limit_gb=memory_limit_gb,
    )
    need_gb = grid.blocks.bytes_of(header["n_blocks"]) / 1e9
    if need_gb > memory_limit_gb:
        raise MapTooLargeError(f"the map needs {need_gb:.2f} GB, the limit is {memory_limit_gb:g} GB")
    return grid


class _Unpacker:
    """The decompressed bytes of the next n_bytes of a file, as many at once as one asks for."""

    def __init__(self, file: IO[bytes], n_bytes: int) -> None:
        self._file, self._left = file, n_bytes
        self._inflate = zlib.decompressobj()

    def array(self, dtype: str, *shape: int) -> Array:
        """The next array of this little-endian type and shape."""
        n = int(np.prod(shape)) * np.dtype(dtype).itemsize
        content = bytearray()
        while len(content) < n:
            piece = self._next(n - len(content))
            if piece is None:
                raise ValueError("it is shorter than it says")
            content += piece
        return np.frombuffer(content, dtype).reshape(shape)

    def _next(self, most: int) -> bytes | None:
        """Some more bytes, perhaps none yet; None at the end."""
        packed = self._inflate.unconsumed_tail
        if not packed:
            packed = self._file.read(min(PIECE_BYTES, self._left))
            self._left -= len(packed)
        piece = self._inflate.decompress(packed, most)
        return piece if piece or packed else None

    def finish(self) -> None:
        """Raise ValueError unless all has been read."""
        while not self._inflate.eof:
            piece = self._next(1)
            if piece or piece is None:
                raise ValueError("it is shorter or longer than it says")
        if self._left or self._inflate.unused_data:
            raise ValueError("something stands between its blocks and its checksum")


def _fill(store: BlockStore, n: int, unpacker: _Unpacker) -> None:
    indices = unpacker.array("<i8", n, 3)
    if n and not -FARTHEST_BLOCK <= indices.min() <= indices.max() <= FARTHEST_BLOCK:
        raise ValueError("a block lies beyond all places")
    x, y, z = np.diff(indices, axis=0).T
    if not ((x > 0) | ((x == 0) & ((y > 0) | ((y == 0) & (z > 0))))).all():
        raise ValueError("its blocks are out of order, or one occurs twice")
    rows = store.rows(indices)
    for start in range(0, n, PIECE_BLOCKS):
        piece = rows[start : start + PIECE_BLOCKS]
        words = unpacker.array(store.rule.dtype.newbyteorder("<").str, len(piece), CELLS)
        _check_sound(store.rule, words)
        store.words[piece] = words
    unpacker.finish()


def _check_sound(rule: LogOddsCells, words: Array) -> None:
    """Raise ValueError for words that no map of this rule can come to hold."""
    if words[rule.n_updates(words) == 0].any():
        raise ValueError("a cell that was never updated has a value")
    if not np.array_equal(rule.merged(words, np.zeros_like(words)), words):
        raise ValueError("a cell lies beyond the clamp")
