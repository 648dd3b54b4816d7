"""Maximum flow on an implicit grid, along the shortest paths of a search tree that is mended after each.

Boykov and Kolmogorov's augmenting paths on a kept search tree (PAMI 2004), in the form of Goldberg, Hed, Kaplan, Tarjan
and Werneck, "Maximum flows by incremental breadth-first search" (ESA 2011): nodes know their level, so that an orphan
finds a new parent without walking to the root. Only the sink's tree grows: in an expansion move nearly every node hangs
on the source (it would keep its label), and a second tree would cover the image and seldom save a step.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from ..geometry import Array

FREE, ROOT, ORPHAN = -1, 8, 9
"""Of `parent`, beside the number of the arc to the parent: in no tree, hanging on the sink, cut off."""
LATER, LOWEST, STEPS = 0, 1, 2
"""Of `state`: how many nodes are in later; the lowest level that has an orphan; nodes grown or adopted so far."""


class Graph(NamedTuple):
    """Residual capacities of N nodes on a grid, padded so that no arc leads out of the arrays.

    terminal (N,) int32: from the source where > 0, to the sink where < 0. capacity (N, A) int32, A = 4 or 6: of the
    arcs to node + offset[0..3], to node ^ 1, and to across[node] (int32; itself: no such arc; A = 4: not read).
    offset (4,) int64 is a, -a, b, -b. across must be its own inverse.
    """

    terminal: Array
    capacity: Array
    across: Array
    offset: Array


class Tree(NamedTuple):
    """Working memory: first_orphan (by level) and next_orphan are linked lists; later has the next level's nodes."""

    parent: Array
    level: Array
    next_orphan: Array
    first_orphan: Array
    later: Array
    waiting: Array
    state: Array


def empty_graph(height: int, width: int, layers: int) -> Graph:
    """A Graph without capacities for (height, width) pixels of one or two nodes each (layers), padded by one.

    Pixel (y, x) has the nodes layers * ((y + 1) * (width + 2) + x + 1) and, of two, the next one.
    """
    row = width + 2
    count = layers * (height + 2) * row
    offset = np.array([layers, -layers, layers * row, -layers * row], np.int64)
    arcs = 4 if layers == 1 else 6
    itself = np.arange(count, dtype=np.int32)
    return Graph(np.zeros(count, np.int32), np.zeros((count, arcs), np.int32), itself, offset)


@njit(cache=True, nogil=True)
def maximum_flow(graph: Graph) -> tuple[np.int64, Array, int]:
    """Push the maximum flow from source to sink; returns it, the sink's side (N,) bool of a minimum cut, and the steps.

    graph is left with the residual capacities. Of all minimum cuts this one has the smallest sink side. The steps are
    a measure of the work that does not depend on the machine.
    """
    tree, active, flow = _tree(graph), _roots(graph), np.int64(0)
    depth = 1
    for root in active:
        tree.parent[root] = ROOT
        tree.level[root] = 1
    while active.size > 0:
        tree.state[LATER] = 0
        for node in active:
            if tree.parent[node] != FREE and tree.level[node] == depth:
                flow += _grow(graph, tree, np.int64(node), depth)
        depth += 1
        active = _next_level(tree, depth)
    return flow, tree.parent != FREE, tree.state[STEPS]


@njit(cache=True, nogil=True)
def source_side(graph: Graph) -> Array:
    """After maximum_flow: (N,) bool, the nodes that the source still reaches; the rest is the largest sink side."""
    reached = graph.terminal > 0
    stack = np.empty(reached.size, np.int32)
    size = 0
    for source in range(reached.size):
        if reached[source]:
            stack[size] = source
            size += 1
    while size > 0:
        size -= 1
        node = np.int64(stack[size])
        for arc in range(graph.capacity.shape[1]):
            if graph.capacity[node, arc] > 0:
                other = _head(graph, node, arc)
                if not reached[other]:
                    reached[other] = True
                    stack[size] = other
                    size += 1
    return reached


@njit(cache=True, nogil=True)
def _tree(graph: Graph) -> Tree:
    count = graph.terminal.size
    return Tree(
        np.full(count, FREE, np.int8),
        np.zeros(count, np.int32),
        np.empty(count, np.int32),
        np.full(count + 3, -1, np.int32),
        np.empty(count, np.int32),
        np.zeros(count, np.bool_),
        np.zeros(3, np.int64),
    )


@njit(cache=True, nogil=True)
def _roots(graph: Graph) -> Array:
    return np.flatnonzero(graph.terminal < 0).astype(np.int32)


@njit(cache=True, nogil=True)
def _next_level(tree: Tree, depth: int) -> Array:
    active = np.empty(tree.state[LATER], np.int32)
    kept = 0
    for i in range(active.size):
        node = tree.later[i]
        tree.waiting[node] = False
        if tree.parent[node] != FREE and tree.level[node] == depth:
            active[kept] = node
            kept += 1
    return active[:kept]


@njit(cache=True, nogil=True)
def _head(graph: Graph, node: np.int64, arc: int) -> Any:
    if arc < 4:
        return node + graph.offset[arc]
    return node ^ 1 if arc == 4 else np.int64(graph.across[node])


@njit(cache=True, nogil=True)
def _reverse(arc: int) -> int:
    return arc ^ 1 if arc < 4 else arc


@njit(cache=True, nogil=True)
def _wait(tree: Tree, node: np.int64) -> None:
    """Have the node's neighbours looked at when its level's turn comes."""
    if not tree.waiting[node]:
        tree.waiting[node] = True
        tree.later[tree.state[LATER]] = node
        tree.state[LATER] += 1


@njit(cache=True, nogil=True)
def _grow(graph: Graph, tree: Tree, node: np.int64, depth: int) -> Any:
    """Take a node's free neighbours into the tree; push along each path that reaches the source. The flow pushed."""
    flow = np.int64(0)
    tree.state[STEPS] += 1
    for arc in range(graph.capacity.shape[1]):
        other, back = _head(graph, node, arc), _reverse(arc)
        if graph.capacity[other, back] <= 0 or tree.parent[other] != FREE:
            continue
        while graph.terminal[other] > 0 and graph.capacity[other, back] > 0:
            flow += _augment(graph, tree, other, back)
            _adopt(graph, tree, depth)
            if tree.parent[node] == FREE or tree.level[node] != depth:
                return flow
        if graph.capacity[other, back] > 0:
            tree.parent[other] = back
            tree.level[other] = depth + 1
            _wait(tree, other)
    return flow


@njit(cache=True, nogil=True)
def _augment(graph: Graph, tree: Tree, start: np.int64, arc: int) -> Any:
    """Push what fits from the source through start, its arc into the tree, and on to the sink."""
    room = min(graph.terminal[start], graph.capacity[start, arc])
    first = _head(graph, start, arc)
    node = first
    while tree.parent[node] != ROOT:
        room = min(room, graph.capacity[node, tree.parent[node]])
        node = _head(graph, node, tree.parent[node])
    room = min(room, -graph.terminal[node])

    tree.state[LOWEST] = tree.first_orphan.size
    graph.terminal[start] -= room
    graph.capacity[start, arc] -= room
    graph.capacity[first, _reverse(arc)] += room
    node = first
    while tree.parent[node] != ROOT:
        up = tree.parent[node]
        parent = _head(graph, node, up)
        graph.capacity[node, up] -= room
        graph.capacity[parent, _reverse(up)] += room
        if graph.capacity[node, up] == 0:
            _cut_off(tree, node)
        node = parent
    graph.terminal[node] += room
    if graph.terminal[node] == 0:
        _cut_off(tree, node)
    return room


@njit(cache=True, nogil=True)
def _cut_off(tree: Tree, node: np.int64) -> None:
    level = tree.level[node]
    tree.parent[node] = ORPHAN
    tree.next_orphan[node] = tree.first_orphan[level]
    tree.first_orphan[level] = node
    tree.state[LOWEST] = min(tree.state[LOWEST], level)


@njit(cache=True, nogil=True)
def _adopt(graph: Graph, tree: Tree, depth: int) -> None:
    """Give each orphan a parent one level lower, or a higher level, from the sink upwards; past depth + 1, free."""
    level = tree.state[LOWEST]
    while level <= depth + 1:
        node = np.int64(tree.first_orphan[level])
        if node < 0:
            level += 1
            continue
        tree.first_orphan[level] = tree.next_orphan[node]
        tree.state[STEPS] += 1
        best, lowest = FREE, depth + 1
        for arc in range(graph.capacity.shape[1]):
            if graph.capacity[node, arc] > 0:
                other = _head(graph, node, arc)
                if tree.parent[other] != FREE and tree.level[other] < lowest:
                    best, lowest = arc, tree.level[other]
                    if lowest == level - 1:
                        break
        if lowest == level - 1:
            tree.parent[node] = best
            if level == depth + 1:
                _wait(tree, node)
            continue
        for out in range(graph.capacity.shape[1]):
            other = _head(graph, node, out)
            if other != node and tree.parent[other] == _reverse(out):
                _cut_off(tree, other)
        tree.parent[node] = FREE
        if best != FREE:
            tree.level[node] = lowest + 1
            _cut_off(tree, node)
