"""One move: every pixel of a region keeps its match, takes the one proposed, or loses both, as a minimum cut says.

Kolmogorov and Zabih (ICCV 2001), Section 4. A pixel has two nodes: `keep`, on the source's side while its match is
kept, and `take`, on the sink's side when the proposed one is taken. Infinite arcs from keep to take forbid
two matches of one pixel, left or right. With one label proposed everywhere this is the expansion move.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from ...geometry import Array
from ..maxflow import Graph, maximum_flow, source_side
from .cost import Energy

FIXED, LOSING, MOVING = 0, 1, 2
"""Of `kind`: keeps its label; may only lose it to a moving pixel that wants its right one; has a proposal."""
INFINITE = 1 << 28
UNMATCHED = -1


class Labels(NamedTuple):
    """A labelling and what the moves want to know of it.

    label (H, W) int16: UNMATCHED or a disparity; cost (H, W) int16: of that match; owner (H, W) int32: of a right pixel
    its left one's column, or UNMATCHED; changed (H, W) int32: the number of the last move that changed the label.
    """

    label: Array
    cost: Array
    owner: Array
    changed: Array


class Move(NamedTuple):
    """A move's pieces: proposal and kind (h, W) begin at row `first` of the image, and graph is of their size."""

    energy: Energy
    labels: Labels
    proposal: Array
    kind: Array
    graph: Graph
    first: int


@njit(cache=True, nogil=True)
def labels_of(energy: Energy, label: Array) -> Labels:
    """Labels of a labelling (H, W) int16 that has no right pixel twice; label itself is what moves will change."""
    owner = np.full(label.shape, UNMATCHED, np.int32)
    cost = np.zeros(label.shape, np.int16)
    for y in range(label.shape[0]):
        for x in range(label.shape[1]):
            if label[y, x] >= 0:
                owner[y, x - label[y, x]] = x
                cost[y, x] = energy.cost[label[y, x], y, x]
    return Labels(label, cost, owner, np.zeros(label.shape, np.int32))


@njit(cache=True, nogil=True)
def make_move(energy: Energy, labels: Labels, offer: tuple[Array, int], tools: tuple[Graph, int, bool]) -> Any:
    """Change labels to the best that the move allows, if that is better; returns how far the energy fell, and the work.

    offer: proposal (h, W) int16, a disparity or UNMATCHED (none), no right pixel twice; and the image's row that is its
    first. Either one label everywhere, or no pixel's own. In the second case a match that is kept and a neighbour's
    that is taken count as different even where they are the same: the energy may fall by more than is returned.
    tools: a graph of the proposal's size; the number of the move; whether of equally good labellings to have the one
    with the most proposals taken.
    """
    (proposal, first), (graph, number, eager) = offer, tools
    move = Move(energy, labels, proposal, _kinds(labels, proposal, first), graph, first)
    _clear(graph)
    before = _add_keeps(move) + _add_takes(move)
    _forbid_doubles(move)
    flow = _push_direct(move)
    rest, taken, steps = maximum_flow(graph)
    gain = before - flow - rest
    if gain > 0:
        _apply(move, ~source_side(graph) if eager else taken, number)
    return gain, steps


@njit(cache=True, nogil=True)
def _kinds(labels: Labels, proposal: Array, first: int) -> Array:
    height, width = proposal.shape
    kind = np.zeros((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            if proposal[y, x] >= 0:
                kind[y, x] = MOVING
                loser = labels.owner[first + y, x - proposal[y, x]]
                if loser >= 0 and kind[y, loser] == FIXED:
                    kind[y, loser] = LOSING
    return kind


@njit(cache=True, nogil=True)
def _clear(graph: Graph) -> None:
    graph.terminal[:] = 0
    graph.capacity[:] = 0
    for node in range(graph.across.size):
        graph.across[node] = node


@njit(cache=True, nogil=True)
def _add_keeps(move: Move) -> np.int64:
    """The nodes on the source's side while a pixel keeps its match; returns what keeping all of them cuts."""
    # Taken apart here, once: a kernel that gets tuples of arrays counts references at every call.
    terminal, capacity, label, kinds = move.graph.terminal, move.graph.capacity, move.labels.label, move.kind
    lambda1, lambda2 = move.energy.lambda1, move.energy.lambda2
    (height, width), bottom, cut = move.proposal.shape, label.shape[0], np.int64(0)
    for y in range(height):
        row = move.first + y
        for x in range(width):
            d = label[row, x]
            if kinds[y, x] == FIXED or d < 0 or d == move.proposal[y, x]:
                continue
            node = 2 * ((y + 1) * (width + 2) + x + 1)
            weight = -np.int64(move.labels.cost[row, x])
            flat = move.energy.left_flat[row, x] & move.energy.right_flat[row, x - d]
            for arc in range(4):
                ny, nx = y + (arc == 2) - (arc == 3), x + (arc == 0) - (arc == 1)
                if nx < d or nx >= width or move.first + ny < 0 or move.first + ny >= bottom:
                    continue
                penalty = lambda1 if (flat >> arc) & 1 else lambda2
                if label[move.first + ny, nx] != d:
                    weight -= penalty
                elif not 0 <= ny < height or kinds[ny, nx] == FIXED:
                    weight += penalty
                else:
                    capacity[node, arc] = penalty
            terminal[node] = weight
            cut += max(np.int64(0), -weight)
    return cut


@njit(cache=True, nogil=True)
def _add_takes(move: Move) -> np.int64:
    """The nodes on the sink's side when a pixel takes its proposed match; returns what the present labels cut."""
    terminal, capacity, label, kinds = move.graph.terminal, move.graph.capacity, move.labels.label, move.kind
    lambda1, lambda2, proposal = move.energy.lambda1, move.energy.lambda2, move.proposal
    (height, width), bottom, cut = move.proposal.shape, label.shape[0], np.int64(0)
    for y in range(height):
        row = move.first + y
        for x in range(width):
            if kinds[y, x] != MOVING:
                continue
            d = proposal[y, x]
            node = 2 * ((y + 1) * (width + 2) + x + 1) + 1
            weight, own = np.int64(move.energy.cost[d, row, x]), label[row, x] == d
            flat = move.energy.left_flat[row, x] & move.energy.right_flat[row, x - d]
            for arc in range(4):
                ny, nx = y + (arc == 2) - (arc == 3), x + (arc == 0) - (arc == 1)
                if nx < d or nx >= width or move.first + ny < 0 or move.first + ny >= bottom:
                    continue
                penalty = lambda1 if (flat >> arc) & 1 else lambda2
                inside, taken = 0 <= ny < height, label[move.first + ny, nx] == d
                if inside and kinds[ny, nx] == MOVING and proposal[ny, nx] == d:
                    capacity[node, arc] = penalty
                    cut += penalty if own and not taken else 0
                elif taken and (not inside or kinds[ny, nx] == FIXED):
                    weight -= penalty
                else:
                    weight += penalty
            terminal[node] = weight
            cut += max(np.int64(0), weight if own else -weight)
    return cut


@njit(cache=True, nogil=True)
def _forbid_doubles(move: Move) -> None:
    """Infinite arcs to each take node from the matches that it would exclude: its own pixel's, its right pixel's."""
    height, width = move.proposal.shape
    for y in range(height):
        label, owner = move.labels.label[move.first + y], move.labels.owner[move.first + y]
        for x in range(width):
            if move.kind[y, x] != MOVING:
                continue
            d, take = move.proposal[y, x], 2 * ((y + 1) * (width + 2) + x + 1) + 1
            if label[x] >= 0 and label[x] != d:
                move.graph.capacity[take ^ 1, 4] = INFINITE
            loser = owner[x - d]
            if loser >= 0 and loser != x:
                keep = 2 * ((y + 1) * (width + 2) + loser + 1)
                move.graph.across[take], move.graph.across[keep] = keep, take
                move.graph.capacity[keep, 5] = INFINITE


@njit(cache=True, nogil=True)
def _push_direct(move: Move) -> np.int64:
    """Push along source, keep, take, sink: the shortest paths, found without a search. Returns the flow."""
    height, width = move.proposal.shape
    terminal, capacity, across = move.graph.terminal, move.graph.capacity, move.graph.across
    flow = np.int64(0)
    for y in range(height):
        for x in range(width):
            if move.kind[y, x] != MOVING:
                continue
            take = 2 * ((y + 1) * (width + 2) + x + 1) + 1
            for arc in range(4, 6):
                keep = take ^ 1 if arc == 4 else across[take]
                if terminal[take] < 0 and terminal[keep] > 0 and capacity[keep, arc] > 0:
                    room = min(terminal[keep], -terminal[take])
                    terminal[keep] -= room
                    terminal[take] += room
                    capacity[keep, arc] -= room
                    capacity[take, arc] += room
                    flow += room
    return flow


@njit(cache=True, nogil=True)
def _apply(move: Move, taken: Array, number: int) -> None:
    height, width = move.proposal.shape
    for y in range(height):
        label, owner = move.labels.label[move.first + y], move.labels.owner[move.first + y]
        for x in range(width):
            keep = 2 * ((y + 1) * (width + 2) + x + 1)
            kind, present = move.kind[y, x], label[x]
            if kind != FIXED and present >= 0:
                own = kind == MOVING and present == move.proposal[y, x]
                if (own and not taken[keep + 1]) or (not own and taken[keep]):
                    owner[x - present] = UNMATCHED
                    label[x] = UNMATCHED
                    move.labels.changed[move.first + y, x] = number
        for x in range(width):
            take = 2 * ((y + 1) * (width + 2) + x + 1) + 1
            if move.kind[y, x] == MOVING and taken[take] and label[x] != move.proposal[y, x]:
                label[x] = move.proposal[y, x]
                owner[x - label[x]] = x
                move.labels.cost[move.first + y, x] = move.energy.cost[label[x], move.first + y, x]
                move.labels.changed[move.first + y, x] = number
