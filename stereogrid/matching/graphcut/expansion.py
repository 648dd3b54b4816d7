"""Alpha-expansion: the labelling of least energy, one label offered to all pixels at a time.

Y. Boykov, O. Veksler and R. Zabih, "Fast Approximate Energy Minimization via Graph Cuts", IEEE PAMI 2001; a move as a
minimum cut after V. Kolmogorov and R. Zabih, "What Energy Functions Can Be Minimized via Graph Cuts?", PAMI 2004.

E = sum over pixels of cost[label] + sum over neighbours of weight * min(|label - label'|, cut).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...geometry import Array
from ...observation import Image
from ..maxflow import Graph, maximum_flow


@njit(cache=True, nogil=True, inline="always")
def step_cost(a: int, b: int, cut: int) -> np.int64:
    """min(|a - b|, cut), a metric: a move never meets an edge of negative capacity."""
    return min(abs(np.int64(a) - np.int64(b)), np.int64(cut))


@njit(cache=True, nogil=True)
def energy(costs: Array, weights: Array, cut: int, labels: Array) -> np.int64:
    """E of labels (H, W); costs (H, W, D) uint16; weights (2, H, W) int32 of the edges to the right and downwards."""
    height, width = labels.shape
    total = np.int64(0)
    for y in range(height):
        for x in range(width):
            total += np.int64(costs[y, x, labels[y, x]])
            if x + 1 < width:
                total += np.int64(weights[0, y, x]) * step_cost(labels[y, x], labels[y, x + 1], cut)
            if y + 1 < height:
                total += np.int64(weights[1, y, x]) * step_cost(labels[y, x], labels[y + 1, x], cut)
    return total


@njit(cache=True, nogil=True)
def mark_plausible(costs: Array, labels: Array, alpha: int, slack: int, movable: Array, out: Array) -> Array:
    """Mark in out (H, W) the movable pixels that alpha could suit; returns their box (top, bottom, left, right).

    It could where it costs at most slack more than the label of now, or where a neighbour has it.
    """
    height, width = labels.shape
    box = np.array([height, 0, width, 0])
    for y in range(height):
        for x in range(width):
            out[y, x] = False
            own = labels[y, x]
            if own == alpha or not movable[y, x]:
                continue
            near = np.int64(costs[y, x, alpha]) <= np.int64(costs[y, x, own]) + slack
            near |= (x > 0 and labels[y, x - 1] == alpha) or (x + 1 < width and labels[y, x + 1] == alpha)
            near |= (y > 0 and labels[y - 1, x] == alpha) or (y + 1 < height and labels[y + 1, x] == alpha)
            if near:
                out[y, x] = True
                box[0], box[1] = min(box[0], y), max(box[1], y + 1)
                box[2], box[3] = min(box[2], x), max(box[3], x + 1)
    return box


@njit(cache=True, nogil=True)
def add_edge(graph: Graph, edge: tuple[int, int, int], free: tuple[bool, bool], terms: tuple[int, int, int]) -> None:
    """Add the edge (p, q, arc from p to q): terms are its costs if only q, only p or neither takes the label.

    A node that is not free keeps its label, so that its edge only pulls at the other end.
    """
    (p, q, arc), (only_q, only_p, neither) = edge, terms
    if free[0] and free[1]:
        graph.terminal[p] += only_p - neither
        graph.terminal[q] -= only_p
        graph.capacity[p, arc] += only_q + only_p - neither
    elif free[0]:
        graph.terminal[p] += only_p - neither
    elif free[1]:
        graph.terminal[q] += only_q - neither


@njit(cache=True, nogil=True)
def move_graph(costs: Array, weights: Array, move: tuple[int, int], labels: Array, part: tuple[Array, Array]) -> Graph:
    """The graph whose minimum cut is the best move = (cut, alpha) of the free pixels of a box; part: box, free."""
    (cut, alpha), (box, free) = move, part
    height, width = labels.shape
    stride = box[3] - box[2] + 2
    count = (box[1] - box[0] + 2) * stride
    offset = np.array([1, -1, stride, -stride])
    graph = Graph(np.zeros(count, np.int32), np.zeros((count, 4), np.int32), np.zeros(0, np.int32), offset)
    # From a row above and a column before the box, so that the edges into it are met as well.
    for y in range(max(box[0] - 1, 0), box[1]):
        for x in range(max(box[2] - 1, 0), box[3]):
            p, own = (y - box[0] + 1) * stride + x - box[2] + 1, labels[y, x]
            if free[y, x]:
                graph.terminal[p] += np.int64(costs[y, x, alpha]) - np.int64(costs[y, x, own])
            for k in range(2):
                v, u = (y, x + 1) if k == 0 else (y + 1, x)
                if v == height or u == width or not (free[y, x] or free[v, u]):
                    continue
                w, other = np.int64(weights[k, y, x]), labels[v, u]
                here, there = step_cost(own, alpha, cut), step_cost(alpha, other, cut)
                terms = (w * here, w * there, w * step_cost(own, other, cut))
                add_edge(graph, (p, p + offset[2 * k], 2 * k), (free[y, x], free[v, u]), terms)
    return graph


@njit(cache=True, nogil=True)
def expand(costs: Array, weights: Array, rule: tuple[int, int], alpha: int, labels: Array, movable: Array) -> int:
    """Give alpha to those pixels that lower E most, changing labels (H, W) int32 in place; how many changed.

    rule: (cut, slack). Only movable (H, W) bool pixels that alpha could suit are asked; the others keep theirs.
    """
    cut, slack = rule
    free = np.empty(labels.shape, np.bool_)
    box = mark_plausible(costs, labels, alpha, slack, movable, free)
    if box[0] >= box[1]:
        return 0
    graph = move_graph(costs, weights, (cut, alpha), labels, (box, free))
    _, taken, _ = maximum_flow(graph)
    stride, changed = box[3] - box[2] + 2, 0
    for y in range(box[0], box[1]):
        for x in range(box[2], box[3]):
            if free[y, x] and taken[(y - box[0] + 1) * stride + x - box[2] + 1]:
                labels[y, x] = alpha
                changed += 1
    return changed


def edge_weights(image: Image, smoothness: int, edge: tuple[int, int]) -> NDArray[np.int32]:
    """(2, H, W) weights of the edges to the right and downwards: smoothness, or less across a step of intensity.

    edge: the step that counts as one, and how many times less the weight then is.
    """
    step, times = edge
    levels = image.astype(np.int16)
    change = np.zeros((2, *image.shape[:2]), np.int16)
    change[0, :, :-1] = np.abs(np.diff(levels, axis=1)).max(axis=2)
    change[1, :-1] = np.abs(np.diff(levels, axis=0)).max(axis=2)
    return np.where(change >= step, smoothness // times, smoothness).astype(np.int32)
