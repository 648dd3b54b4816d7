"""OctoMap's files, as its own tools write and read them; grid/octomap.py tells what is in them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InvalidInputError
from ..files import written_beside
from ..geometry import Array
from ..grid import OccupancyGrid, morton
from ..grid.octomap import BINARY, DEPTH, FIRST_KEY, FREE, FULL, FULL_NODE, INNER, OCCUPIED

HEADER = """{first}
# (feel free to add / change comments, but leave the first line as it is!)
#
id OcTree
size {size}
res {cell_m}
data
"""


def write_ot(grid: OccupancyGrid, path: Path) -> None:
    """Write the log-odds of every known cell as float32 (.ot); an inner node holds the largest below it."""
    nodes = _octree(grid, binary=False)
    content = np.empty(len(nodes.below), FULL_NODE)
    content["log_odds"], content["children"] = nodes.log_odds, 0
    for child in range(8):
        content["children"] |= (nodes.below >> 2 * child & 3 > 0).astype(np.uint8) << child
    _write(path, FULL, nodes, grid.cell_m, content.tobytes())


def write_bt(grid: OccupancyGrid, path: Path) -> None:
    """Write which known cells are occupied and which free (.bt).

    Occupied is, as OctoMap has it, a log-odds of 0 or more: the cell at p = .5 that this library does not count as
    occupied is written as occupied.
    """
    nodes = _octree(grid, binary=True)
    inner = nodes.below[nodes.below > 0]
    _write(path, BINARY, nodes, grid.cell_m, inner.astype("<u2").tobytes())


@dataclass(frozen=True)
class _Nodes:
    """M nodes: first code (M,) int64, depth (M,), log-odds (M,), and what is below (M,) uint16, two bits a child."""

    codes: Array
    depths: Array
    log_odds: Array
    below: Array

    def __getitem__(self, which: Array) -> "_Nodes":
        return _Nodes(self.codes[which], self.depths[which], self.log_odds[which], self.below[which])


def _octree(grid: OccupancyGrid, *, binary: bool) -> _Nodes:
    """All nodes in pre-order; where all eight children are leaves of the same log-odds, they are left out."""
    cells, values = grid.blocks.known()
    keys = cells + FIRST_KEY
    outside = ((keys < 0) | (keys >= 1 << DEPTH)).any(axis=1)
    if outside.any():
        raise InvalidInputError(
            f"cell {cells[outside][0].tolist()} is out of OctoMap's reach, which ends at {FIRST_KEY} cells "
            f"({FIRST_KEY * grid.cell_m:g} m) from the origin"
        )
    codes = morton.encode(keys)
    order = np.argsort(codes)
    # In a .bt file an eight is equal when it is all occupied or all free.
    log_odds = (values >= 0).astype(np.float32) if binary else values
    level = _Nodes(codes[order], np.full(len(codes), DEPTH, np.uint8), log_odds[order], np.zeros(len(codes), np.uint16))
    levels = []
    for depth in range(DEPTH - 1, -1, -1) if len(cells) else ():
        children, level = _parents(level, depth)
        levels.append(children)
    levels.append(level)
    nodes = [np.concatenate([getattr(each, name) for each in levels]) for name in _Nodes.__annotations__]
    every = _Nodes(*nodes)
    # Pre-order is the order of the first cell, and of two nodes that begin with the same cell the larger one first.
    return every[np.argsort(every.codes * 32 + every.depths)]


def _parents(level: _Nodes, depth: int) -> tuple[_Nodes, _Nodes]:
    """What stays of a level in Morton order when equal eights are pruned, and the level above it, at depth."""
    bits = 3 * (DEPTH - depth)
    parent = level.codes >> bits
    first = np.flatnonzero(np.diff(parent, prepend=-1))
    count = np.diff(first, append=len(parent))
    child = (level.codes >> bits - 3) & 7
    state = np.where(level.below > 0, INNER, np.where(level.log_odds > 0, OCCUPIED, FREE))
    highest, lowest = np.maximum.reduceat(level.log_odds, first), np.minimum.reduceat(level.log_odds, first)
    pruned = (count == 8) & (highest == lowest) & (np.maximum.reduceat(level.below, first) == 0)
    below = np.where(pruned, 0, np.bitwise_or.reduceat(state << 2 * child, first)).astype(np.uint16)
    above = _Nodes(parent[first] << bits, np.full(len(first), depth, np.uint8), highest, below)
    return level[~np.repeat(pruned, count)], above


def _write(path: Path, first: bytes, nodes: _Nodes, cell_m: float, content: bytes) -> None:
    header = HEADER.format(first=first.decode(), size=len(nodes.below), cell_m=cell_m)
    with written_beside(path) as temporary:
        temporary.write_bytes(header.encode() + content)
