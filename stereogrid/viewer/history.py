"""How a map grew: what each step of its making changed, so that the map of any moment comes back at once."""

import threading
from dataclasses import dataclass, field

import numpy as np

from ..geometry import Array
from .cell_blocks import UNKNOWN, CellBlocks
from .snapshot import Snapshot

LIMIT_BYTES = 512 << 20
"""Beyond it every other step is joined to the next: the replay goes in larger steps."""
Pictures = tuple[bytes, ...]
"""Of one observation, as JPEG files: the left image and its disparity."""


@dataclass(frozen=True)
class _Step:
    """After observation `number`, counted from 0: blocks held; of those changed since the step before the rows (C,),
    values and times of last change (C, 512)."""

    number: int
    n_blocks: int
    rows: Array
    values: Array
    changed: Array
    pictures: Pictures = field(default=(), repr=False)

    @property
    def n_bytes(self) -> int:
        return self.rows.nbytes + self.values.nbytes + self.changed.nbytes + sum(map(len, self.pictures))

    def joined(self, later: "_Step") -> "_Step":
        """This and the next one as one."""
        own = ~np.isin(self.rows, later.rows)
        return _Step(
            later.number,
            later.n_blocks,
            np.concatenate([self.rows[own], later.rows]),
            np.concatenate([self.values[own], later.values]),
            np.concatenate([self.changed[own], later.changed]),
            later.pictures,
        )


class History:
    """The steps of a map of `total` observations, within limit_bytes. Threads may read while one adds.

    Each step keeps the blocks that it changed; the map of a moment is, block by block, the last that was kept until
    then. That costs one copy of the map's blocks, wherever one jumps.
    """

    def __init__(self, total: int, *, limit_bytes: int = LIMIT_BYTES) -> None:
        self.total = total
        self.unit = max(1, -(-total // 0xFFFF))
        """Observations that one count of CellBlocks.changed stands for."""
        self.every = 1
        """Observations from a step to the next."""
        self._limit_bytes, self._n_bytes = limit_bytes, 0
        self._steps: list[_Step] = []
        self._latest: Snapshot | None = None
        self._values = np.zeros((0, 512), np.int16)
        self._changed = np.zeros((0, 512), np.uint16)
        self._lock = threading.Lock()

    def wants(self, number: int) -> bool:
        """Whether a step is to be kept of observation `number`, counted from 0: the last one always."""
        return (number + 1) % self.every == 0 or number + 1 == self.total

    @property
    def n_bytes(self) -> int:
        """Memory of the steps."""
        return self._n_bytes

    def numbers(self) -> list[int]:
        """The observations of which a step is kept, in order."""
        with self._lock:
            return [step.number for step in self._steps]

    def add(self, number: int, snapshot: Snapshot | None, pictures: Pictures = ()) -> None:
        """Keep what changed up to and with observation `number`; None: of a pass that makes no map."""
        empty = np.zeros(0, np.int64), np.zeros((0, 512), np.int16), np.zeros((0, 512), np.uint16)
        changes, n_blocks = empty, 0
        if snapshot is not None:
            changes, n_blocks = self._changes(number, snapshot), len(snapshot.indices)
        step = _Step(number, n_blocks, *changes, pictures)
        with self._lock:
            self._latest = snapshot or self._latest
            self._steps.append(step)
            self._n_bytes += step.n_bytes
            while self._n_bytes > self._limit_bytes and len(self._steps) > 2:
                self._thin()

    def _changes(self, number: int, snapshot: Snapshot) -> tuple[Array, Array, Array]:
        values, n_old = snapshot.values(), len(self._values)
        before = np.full_like(values, UNKNOWN)
        before[:n_old] = self._values
        differ = values != before
        changed: Array = np.zeros(values.shape, np.uint16)
        changed[:n_old] = self._changed
        changed[differ] = number // self.unit
        self._values, self._changed = values, changed
        rows = np.flatnonzero(differ.any(axis=1) | (np.arange(len(values)) >= n_old))
        return rows, values[rows], changed[rows]

    def _thin(self) -> None:
        steps = self._steps
        self.every *= 2
        pairs = range(0, len(steps) - 1, 2)
        self._steps = [steps[first].joined(steps[first + 1]) for first in pairs] + (
            steps[-1:] if len(steps) % 2 else []
        )
        self._n_bytes = sum(step.n_bytes for step in self._steps)

    def cells(self, number: int) -> CellBlocks | None:
        """The map after observation `number`, or after the last step kept before; None before the first."""
        with self._lock:
            steps, latest = [step for step in self._steps if step.number <= number], self._latest
        if not steps or latest is None:
            return None
        n = steps[-1].n_blocks
        values, changed = np.full((n, 512), UNKNOWN), np.zeros((n, 512), np.uint16)
        missing = np.ones(n, dtype=bool)
        for step in reversed(steps):
            new = missing[step.rows]
            rows = step.rows[new]
            values[rows], changed[rows] = step.values[new], step.changed[new]
            missing[rows] = False
            if not missing.any():
                break
        return CellBlocks(latest.indices[:n], values, latest.rule, latest.cell_m, changed=changed)

    def pictures(self, number: int) -> tuple[int, Pictures] | None:
        """Pictures of the last step with any up to observation `number`, and its number."""
        with self._lock:
            steps = [step for step in self._steps if step.number <= number and step.pictures]
        return (steps[-1].number, steps[-1].pictures) if steps else None
