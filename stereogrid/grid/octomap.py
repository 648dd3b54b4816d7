"""Reading OctoMap's files: .bt, which leaf is occupied and which free, and .ot, the log-odds of every node.

A header of lines (first line, `id OcTree`, `size N` nodes, `res R` m, `data`), then the tree in pre-order, 16 levels:
.bt, 2 bytes an inner node: child i has bits 2 i and 2 i + 1, 0 unknown, 1 free, 2 occupied, 3 inner;
.ot, 5 bytes a node: float32 log-odds, a bit for each child. Child = x + 2 y + 4 z; key = cell + 32768.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from numba import njit

from ..errors import MapTooLargeError, RecordingError, StereogridError
from ..geometry import Array
from . import morton
from .cells import OCTOMAP_CLAMP

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .occupancy import OccupancyGrid

SUFFIXES = (".bt", ".ot")
BINARY, FULL = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
DEPTH = 16
FIRST_KEY = 2 ** (DEPTH - 1)
"""The key of cell 0."""
FREE, OCCUPIED, INNER = 1, 2, 3
FULL_NODE = np.dtype([("log_odds", "<f4"), ("children", "u1")])
LONGEST_LINE, MOST_LINES = 1000, 1000
PIECE_CELLS = 1 << 20
WORD_BYTES = 4
BLOCK_LEVEL = 3
"""A leaf so many levels above the cells fills one of our blocks of 8^3."""
LARGEST_LOG_ODDS = 1000


@dataclass(frozen=True)
class Leaves:
    """N leaves in Morton order: codes (N,) int64 of their first cell, levels (N,) above a cell, log_odds (N,)."""

    codes: Array
    levels: Array
    log_odds: Array

    def n_blocks(self) -> float:
        """How many of our blocks hold them."""
        large = self.levels >= BLOCK_LEVEL
        within = self.codes[~large] >> 3 * BLOCK_LEVEL
        some = int(len(within) > 0) + int(np.count_nonzero(np.diff(within)))
        return some + float(np.sum(8.0 ** (self.levels[large] - BLOCK_LEVEL)))

    def cells(self) -> "Iterator[tuple[Array, Array]]":
        """Their cells (C, 3) int64, and the leaf (C,) that each comes from, a piece after the other."""
        counts = 8 ** self.levels.astype(np.int64)
        ends = np.cumsum(counts)
        for start in range(0, int(counts.sum()), PIECE_CELLS):
            place = np.arange(start, min(start + PIECE_CELLS, int(ends[-1])))
            leaf = np.searchsorted(ends, place, side="right")
            codes = self.codes[leaf] + place - (ends[leaf] - counts[leaf])
            yield morton.decode(codes) - FIRST_KEY, leaf


def load_octomap(path: Path, *, memory_limit_gb: float = 4.0) -> "OccupancyGrid":
    """The map of a .bt or .ot file; which of the two, its first line says. Prior 0.5, one update a cell.

    A .bt file's leaves get the limits of OctoMap's log-odds, -2 and 3.511, as when OctoMap reads it. The clamp is
    OctoMap's, wider where the file's log-odds are. Raises RecordingError when the file is missing or damaged or holds
    another kind of tree, MapTooLargeError when file or map would need more than memory_limit_gb.
    """
    try:
        with path.open("rb") as file:
            return _load(file, memory_limit_gb)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    except MapTooLargeError as error:
        raise MapTooLargeError(f"{path}: {error}") from None
    except (StereogridError, ValueError, KeyError) as error:
        raise RecordingError(f"{path}: not a sound OctoMap file: {error}") from None


def _load(file: IO[bytes], memory_limit_gb: float) -> "OccupancyGrid":
    from .occupancy import OccupancyGrid

    binary, size, cell_m = _header(file)
    start = file.tell()
    _check_limit(file.seek(0, 2) - start, memory_limit_gb)
    file.seek(start)
    data = file.read()
    leaves = (_binary_leaves if binary else _full_leaves)(data, size, memory_limit_gb)
    values = leaves.log_odds
    if not (np.abs(values) <= LARGEST_LOG_ODDS).all():
        raise ValueError(f"log-odds must be finite and within +-{LARGEST_LOG_ODDS}")
    low, high = OCTOMAP_CLAMP
    clamp = (min(low, float(values.min(initial=low))), max(high, float(values.max(initial=high))))
    grid = OccupancyGrid(cell_m, clamp=clamp, memory_limit_gb=memory_limit_gb)
    _check_limit(grid.blocks.bytes_of(1) * leaves.n_blocks(), memory_limit_gb)
    words = grid.blocks.rule.pack(values, np.ones(len(values), dtype=np.int64))
    for cells, leaf in leaves.cells():
        grid.blocks.put(cells, words[leaf])
    return grid


def _check_limit(n_bytes: float, memory_limit_gb: float) -> None:
    if n_bytes > memory_limit_gb * 1e9:
        raise MapTooLargeError(f"it needs {n_bytes / 1e9:,.3g} GB or more, the limit is {memory_limit_gb:g} GB")


def _header(file: IO[bytes]) -> tuple[bool, int, float]:
    """Whether it is a .bt file, its number of nodes, the side of its cells [m]."""
    first = file.readline(LONGEST_LINE)
    if not first.startswith((BINARY, FULL)):
        raise ValueError(f"expected it to start with {BINARY.decode()!r} or {FULL.decode()!r}")
    fields = {}
    for _ in range(MOST_LINES):
        key, _, value = file.readline(LONGEST_LINE).strip().partition(b" ")
        if key == b"data":
            break
        fields[key] = value
    else:
        raise ValueError("its header has no line 'data'")
    for key in (b"id", b"size", b"res"):
        if key not in fields:
            raise ValueError(f"its header has no line {key.decode()!r}")
    # 1 is what OctoMap's first files call it.
    if fields[b"id"] not in (b"OcTree", b"1"):
        raise ValueError(f"it holds a tree of kind {fields[b'id'].decode(errors='replace')!r}; choose from: OcTree")
    return first.startswith(BINARY), int(fields[b"size"]), float(fields[b"res"])


def _full_leaves(data: bytes, size: int, memory_limit_gb: float) -> Leaves:
    _check_size(len(data) / FULL_NODE.itemsize, size)
    nodes = np.frombuffer(data, FULL_NODE)
    _check_limit(int(np.count_nonzero(nodes["children"] == 0)) * WORD_BYTES, memory_limit_gb)
    codes, depths = _walked(np.ascontiguousarray(nodes["children"]), DEPTH)
    leaf = nodes["children"] == 0
    return Leaves(codes[leaf], DEPTH - depths[leaf].astype(np.int64), nodes["log_odds"][leaf])


def _binary_leaves(data: bytes, size: int, memory_limit_gb: float) -> Leaves:
    if len(data) % 2:
        raise ValueError("it is cut short")
    nodes = np.frombuffer(data, "<u2")
    if (nodes == 0).any():
        raise ValueError("an inner node has no children")
    inner, n_leaves = np.zeros(len(nodes), np.uint8), 0
    for child in range(8):
        state = nodes >> 2 * child & 3
        inner |= (state == INNER).astype(np.uint8) << child
        n_leaves += int(np.count_nonzero((state == FREE) | (state == OCCUPIED)))
    _check_limit(n_leaves * WORD_BYTES, memory_limit_gb)
    codes, depths = _walked(inner, DEPTH - 1)
    _check_size(len(nodes) + n_leaves, size)
    return _children(nodes, codes, DEPTH - 1 - depths.astype(np.int64))


def _children(nodes: Array, codes: Array, levels: Array) -> Leaves:
    """The leaves right below inner nodes of a .bt file, nodes (N,) uint16; codes and levels (N,): of their children."""
    parts = []
    for child in range(8):
        state = nodes >> 2 * child & 3
        at = np.flatnonzero((state == FREE) | (state == OCCUPIED))
        parts.append((codes[at] + (child << 3 * levels[at]), levels[at], state[at] == OCCUPIED))
    first, level, occupied = (np.concatenate(each) for each in zip(*parts, strict=True))
    order = np.argsort(first)
    values = np.where(occupied[order], OCTOMAP_CLAMP[1], OCTOMAP_CLAMP[0]).astype(np.float32)
    return Leaves(first[order], level[order], values)


def _check_size(n_nodes: float, size: int) -> None:
    if n_nodes != size:
        raise ValueError(f"its header says {size} nodes, the file holds {n_nodes:.10g}")


def _walked(children: Array, deepest: int) -> tuple[Array, Array]:
    """Codes (N,) int64 of the first cell and depths (N,) uint8 of nodes in pre-order, from their child masks (N,)."""
    codes, depths = np.empty(len(children), np.int64), np.empty(len(children), np.uint8)
    n, open_nodes = _walk(children, deepest, codes, depths)
    if n < 0:
        raise ValueError(f"its tree is deeper than {DEPTH} levels")
    if n < len(children):
        raise ValueError(f"its tree ends after {n} nodes, but {len(children)} follow the header")
    if open_nodes:
        raise ValueError("it is cut short")
    return codes, depths


@njit(cache=True, nogil=True)
def _walk(children: Array, deepest: int, codes: Array, depths: Array) -> tuple[int, bool]:
    """Write codes and depths; how many nodes the tree has, -1 where one lies too deep, and whether some are missing."""
    missing, first = np.zeros(20, np.uint8), np.zeros(20, np.int64)
    depth = -1
    for n in range(len(children)):
        while depth >= 0 and missing[depth] == 0:
            depth -= 1
        if n > 0 and depth < 0:
            return n, False
        code = np.int64(0)
        if n > 0:
            child = 0
            while not missing[depth] >> child & 1:
                child += 1
            missing[depth] &= ~(1 << child)
            code = first[depth] + (np.int64(child) << np.int64(3 * (15 - depth)))
        depth += 1
        if depth > deepest:
            return -1, False
        codes[n], depths[n] = code, depth
        missing[depth], first[depth] = children[n], code
    return len(children), bool(missing[: depth + 1].any())
