"""Which map is to be seen: a saved one, or one as it was at some observation."""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..grid import OccupancyGrid
from .cell_blocks import CellBlocks
from .controls import Choices
from .replay import Replay
from .scene import MOST_CELLS
from .snapshot import Snapshot

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Moment:
    """A map at a moment. key: another one for another map; cells: all of it; drawn: the same, coarser where it is too
    large to be drawn; range_m: how far its making trusted depths [m]; number: the observation, None: all of them."""

    key: Hashable
    cells: CellBlocks
    drawn: CellBlocks
    range_m: float
    number: int | None = None


class Moments:
    """The maps of a page: files by their names, and those of a replay. The last one asked for is kept."""

    def __init__(self, maps: "dict[str, Path]", replay: Replay | None) -> None:
        self._maps, self._replay = maps, replay
        self._last: Moment | None = None
        self.sha256: dict[str, str] = {}

    def at(self, choices: Choices) -> Moment | None:
        """What the choices ask for; None where nothing is mapped yet."""
        replay = self._replay if self._replay is not None and self._replay.makes_map else None
        # A saved map does not say when its cells changed: for ages the replay's own end stands for it.
        at_end = replay is None or (choices.number + 1 >= replay.history.total and choices.colour != "age")
        if replay is None or (self._maps and at_end):
            return self._saved(choices.map_name)
        numbers = [number for number in replay.history.numbers() if number <= choices.number]
        if not numbers:
            return self._saved(choices.map_name) if self._maps else None
        return self._past(replay, numbers[-1])

    def _saved(self, name: str) -> Moment:
        key = "saved", name
        if self._last is None or self._last.key != key:
            grid = OccupancyGrid.load(self._maps[name])
            self.sha256[name] = grid.sha256()
            self._keep(key, Snapshot.of(grid).cells(), grid.model.max_range_m)
        assert self._last is not None
        return self._last

    def _past(self, replay: Replay, number: int) -> Moment | None:
        key = "past", number
        if self._last is None or self._last.key != key:
            cells = replay.history.cells(number)
            if cells is None:
                return None
            self._keep(key, cells, replay.grid.model.max_range_m, number)
        return self._last

    def _keep(self, key: Hashable, cells: CellBlocks, range_m: float, number: int | None = None) -> None:
        self._last = Moment(key, cells, cells.fitting(MOST_CELLS), range_m, number)
