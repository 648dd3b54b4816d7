"""The native map file (.sgrid): a magic line, one line of JSON, compressed blocks, and a checksum of it all.

    SGRID 1\\n
    {"cell_m": ..., "model": {...}, "fusion": ..., "clamp": ..., "n_blocks": B}\\n
    zlib(indices int64 (B, 3) | log-odds float32 (B, 16, 16, 16) | update counts uint16 (B, 16, 16, 16))
    SHA-256 of all bytes before it (32 bytes)
All little-endian. Nothing in it is executed when it is read.
"""

import hashlib
import json
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import RecordingError, StereogridError
from ..files import written_beside
from ..sensor_model import SensorModel
from .blocks import BYTES_PER_CELL
from .kernels import BLOCK

if TYPE_CHECKING:
    from .occupancy import OccupancyGrid

MAGIC = b"SGRID 1\n"
INDEX_BYTES = 3 * 8
BLOCK_BYTES = INDEX_BYTES + BLOCK**3 * BYTES_PER_CELL
LONGEST_HEADER = 10_000
DIGEST_BYTES = 32


def save_grid(grid: "OccupancyGrid", path: Path) -> Path:
    """Write grid to path, beside and then renamed."""
    blocks = grid.blocks
    n = len(blocks)
    arrays = (blocks.indices(), blocks.log_odds[:n], blocks.n_updates[:n])
    payload = b"".join(a.astype(kind).tobytes() for a, kind in zip(arrays, ("<i8", "<f4", "<u2"), strict=True))
    header = {
        "cell_m": grid.cell_m,
        "model": asdict(grid.model),
        "fusion": grid.fusion,
        "clamp": grid.clamp,
        "n_blocks": n,
    }
    content = MAGIC + json.dumps(header).encode() + b"\n" + zlib.compress(payload, 1)
    with written_beside(path) as temporary:
        temporary.write_bytes(content + hashlib.sha256(content).digest())
    return path


def load_grid(path: Path) -> "OccupancyGrid":
    """Read a map file. Raises RecordingError when it is missing, damaged, of another version or not a map."""
    try:
        header, payload = _read(path)
        return _build(header, payload)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    except (StereogridError, ValueError, KeyError, TypeError, OverflowError, RecursionError, zlib.error) as error:
        raise RecordingError(f"{path}: not a sound map file: {error}") from None


def _read(path: Path) -> tuple[dict[str, Any], bytes]:
    with path.open("rb") as file:
        if file.readline(len(MAGIC)) != MAGIC:
            raise ValueError(f"expected it to start with {MAGIC.decode().strip()!r}")
        line, rest = file.readline(LONGEST_HEADER), file.read()
    compressed, digest = rest[:-DIGEST_BYTES], rest[-DIGEST_BYTES:]
    if hashlib.sha256(MAGIC + line + compressed).digest() != digest:
        raise ValueError("it is cut short or damaged: its checksum does not match")
    header: dict[str, Any] = json.loads(line)
    size = int(header["n_blocks"]) * BLOCK_BYTES
    # zlib cannot pack better than about 1000 to 1, so a size beyond that is a lie, not a map.
    if not 0 <= size <= 1100 * len(compressed):
        raise ValueError(f"{header['n_blocks']} blocks cannot be in {len(compressed)} bytes")
    unpacker = zlib.decompressobj()
    payload = unpacker.decompress(compressed, size + 1)
    if len(payload) != size or not unpacker.eof or unpacker.unused_data:
        raise ValueError("it is shorter or longer than it says")
    return header, payload


def _build(header: dict[str, Any], payload: bytes) -> "OccupancyGrid":
    from .occupancy import OccupancyGrid

    model = SensorModel(**header["model"])
    grid = OccupancyGrid(header["cell_m"], model=model, fusion=header["fusion"], clamp=header["clamp"])
    n, shape = int(header["n_blocks"]), (-1, BLOCK, BLOCK, BLOCK)
    ends = np.cumsum([n * INDEX_BYTES, n * BLOCK**3 * 4, n * BLOCK**3 * 2])
    rows = grid.blocks.rows(np.frombuffer(payload[: ends[0]], "<i8").reshape(-1, 3))
    if len(np.unique(rows)) != n:
        raise ValueError("a block occurs twice")
    log_odds = np.frombuffer(payload[ends[0] : ends[1]], "<f4").reshape(shape)
    if not np.isfinite(log_odds).all():
        raise ValueError("a log-odds is not finite")
    grid.blocks.log_odds[rows] = log_odds
    grid.blocks.n_updates[rows] = np.frombuffer(payload[ends[1] :], "<u2").reshape(shape)
    return grid
