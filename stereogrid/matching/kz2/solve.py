"""The schedule of moves: near the present surfaces first, then everywhere, then where something has changed since.

Every move lowers the energy or changes nothing, so the labelling at hand is always the best so far, and the time may
run out at any moment. A second labelling, found in another order, is then offered to the first as one more move: each
region goes to the better of the two.
"""

import time
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..maxflow import Graph, empty_graph
from .cost import Energy
from .energy import total_energy
from .moves import UNMATCHED, labels_of, make_move

LabelImage = NDArray[np.int16]
Region = NDArray[np.uint8]

NEAR, EVERYWHERE, CHANGED = "near", "everywhere", "changed"
THOROUGH = (NEAR, EVERYWHERE, *([CHANGED] * 8))
QUICK = (NEAR, NEAR)
"""Plans: where each cycle, of one move a label, offers the label."""
NEAR_PX = 15
"""A surface may grow this far in a move of the first cycle."""
AGAIN_PX = 5
"""A move is made again this far around what has changed since it was made last."""
NUDGES = (0.0, -0.03, 0.03)
"""Of the height, in turn: how far from the middle of the work the image is split. The row between the two parts keeps
its labels while both are worked on, so that it must not be the same in each cycle."""
LEAST_SPLIT_ROWS = 34
"""An image of fewer rows is not split: the nudges would be less than a row."""


@dataclass
class Search:
    """A labelling on its way down.

    made: the number of the last move of each label. gains: by how much each move lowered the energy, in the order of
    cycles and rows; deadline_s: of the monotonic clock, after which no move is begun.
    """

    energy: Energy
    labels: Any
    deadline_s: float = np.inf
    made: dict[int, int] = field(default_factory=dict)
    gains: list[int] = field(default_factory=list)

    @classmethod
    def of(cls, energy: Energy, label: LabelImage, deadline_s: float = np.inf) -> "Search":
        """A search from a labelling (H, W) int16 without a right pixel twice; it ends at deadline_s (monotonic)."""
        return cls(energy, labels_of(energy, label.copy()), deadline_s)

    @property
    def out_of_time(self) -> bool:
        """No further move is begun."""
        return time.monotonic() > self.deadline_s


def minimise(
    energy: Energy,
    start: LabelImage,
    *,
    deadline_s: float = np.inf,
    progress: Callable[[float], None] = lambda _share: None,
) -> Search:
    """The finished search for the labelling of least energy, from a start (H, W) int16."""
    first, second = Search.of(energy, start, deadline_s), Search.of(energy, start, deadline_s)
    far_to_near = np.arange(len(energy.cost))
    with ThreadPoolExecutor(2) as pool:
        descend(first, THOROUGH, pool, far_to_near, progress=lambda share: progress(0.6 * share))
        descend(second, QUICK, pool, far_to_near[::-1], progress=lambda share: progress(0.6 + 0.3 * share))
        if not first.out_of_time:
            offer(first, second.labels.label)
            descend(first, (CHANGED,) * 8, pool, far_to_near)
    progress(1.0)
    return first


def descend(
    search: Search,
    plan: tuple[str, ...],
    pool: Executor,
    order: NDArray[np.int64],
    *,
    progress: Callable[[float], None] = lambda _share: None,
) -> None:
    """Cycles of moves by a plan, labels in order, until a cycle of the kind CHANGED finds nothing or the time is up."""
    count, height = search.energy.cost.shape[:2]
    number = max(search.made.values(), default=0) + 1
    start = search.labels.label.copy()
    middle = 0.5
    for cycle, where in enumerate(plan):
        share = min(max(middle + NUDGES[cycle % len(NUDGES)], 0.1), 0.9) if height >= LEAST_SPLIT_ROWS else 1
        split = int(height * share)
        halves = [pool.submit(_cycle, search, order, rows, (where, start, number)) for rows in _parts(split, height)]
        above, below = (half.result() for half in halves)
        gains = [gain for gain, _ in above + below if gain > 0]
        middle = _middle(split / height, *(sum(steps for _, steps in half) for half in (above, below)))
        search.gains.extend(gains)
        search.made.update({int(d): number + i for i, d in enumerate(order)})
        number += count + 1
        # The row between has not had its turn.
        search.labels.changed[split : split + 1] = number
        progress((cycle + 1) / len(plan))
        if search.out_of_time or (where == CHANGED and not gains):
            break


def _parts(split: int, height: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """The rows above and below the row that splits them; none below where that is the height."""
    return (0, split), (min(split + 1, height), height)


def _middle(split: float, above: int, below: int) -> float:
    """The share of the height that has half of the work above it, the work on both sides of a split being even."""
    if above + below == 0:
        return 0.5
    if above > below:
        return split * (above + below) / (2 * above)
    return 1 - (1 - split) * (above + below) / (2 * below)


def offer(search: Search, other: LabelImage) -> None:
    """Take over from another labelling (H, W) int16, without a right pixel twice, what lowers the energy."""
    proposal = np.where(other == search.labels.label, np.int16(UNMATCHED), other)
    number = max(search.made.values(), default=0) + 1
    before = total_energy(search.energy, search.labels.label)
    graph = empty_graph(other.shape[0], other.shape[1], 2)
    make_move(search.energy, search.labels, (proposal, 0), (graph, number, False))
    search.gains.append(int(before - total_energy(search.energy, search.labels.label)))


def _cycle(
    search: Search, order: NDArray[np.int64], rows: tuple[int, int], turn: tuple[str, LabelImage, int]
) -> list[tuple[int, int]]:
    """One move a label between two rows, if there are any: of each how far the energy fell, and the work."""
    if rows[0] == rows[1]:
        return []
    where, start, number = turn
    graph = empty_graph(rows[1] - rows[0], start.shape[1], 2)
    done = []
    for i, d in enumerate(order):
        if search.out_of_time:
            break
        region = _region(search, where, rows, (start, int(d)))
        # On a tie, take the label while surfaces are sought, and leave it when the search is to settle.
        done.append(_expand(search, region, (rows[0], int(d)), (graph, number + i, where != CHANGED)))
    return done


def _region(search: Search, where: str, rows: tuple[int, int], of: tuple[LabelImage, int]) -> Region:
    """(h, W) uint8: which pixels between two rows are offered label d."""
    (first, last), (start, d) = rows, of
    label = search.labels.label[first:last]
    if where == EVERYWHERE:
        return np.ones(label.shape, np.uint8)
    changed = _grown(search.labels.changed[first:last] > search.made.get(d, -1), AGAIN_PX)
    if where == CHANGED:
        return changed
    return changed & _grown((label == d) | (start[first:last] == d), NEAR_PX)


def _grown(mask: NDArray[np.bool_], reach_px: int) -> Region:
    size = 2 * reach_px + 1
    grown: Region = cv2.dilate(mask.view(np.uint8), np.ones((size, size), np.uint8))
    return grown


def _expand(search: Search, region: Region, what: tuple[int, int], tools: tuple[Graph, int, bool]) -> tuple[int, int]:
    """Offer label d to a region (h, W) whose first row is given; returns how far the energy fell, and the work."""
    (first, d), (graph, number, eager) = what, tools
    region[:, :d] = 0
    used = np.flatnonzero(region.any(axis=1))
    if used.size == 0:
        return 0, 0
    top, bottom = int(used[0]), int(used[-1]) + 1
    proposal = np.where(region[top:bottom], np.int16(d), np.int16(UNMATCHED))
    nodes = 2 * (bottom - top + 2) * (region.shape[1] + 2)
    part = Graph(graph.terminal[:nodes], graph.capacity[:nodes], graph.across[:nodes], graph.offset)
    gain, steps = make_move(search.energy, search.labels, (proposal, first + top), (part, number, eager))
    return int(gain), int(steps)
