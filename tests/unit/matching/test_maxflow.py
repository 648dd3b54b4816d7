"""The maximum flow against scipy's, brute force over all cuts, and PyMaxflow where it is installed."""

import itertools

import cv2
import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_flow as scipy_maximum_flow

from stereogrid.matching.graphcut.expansion import edge_weights, move_graph
from stereogrid.matching.kz2 import moves
from stereogrid.matching.kz2.cost import energy_of_pair
from stereogrid.matching.kz2.start import good_start
from stereogrid.matching.maxflow import Graph, empty_graph, maximum_flow, source_side


def nodes_of(height, width, layers):
    """The nodes of the pixels, without the padding."""
    pixel = (np.arange(height)[:, None] + 1) * (width + 2) + np.arange(width) + 1
    return (layers * pixel[..., None] + np.arange(layers)).ravel()


def random_graph(rng, height, width, layers, largest=9):
    graph = empty_graph(height, width, layers)
    nodes = nodes_of(height, width, layers)
    graph.terminal[nodes] = rng.integers(-largest, largest + 1, nodes.size)
    for arc in range(4):
        there = np.isin(nodes + graph.offset[arc], nodes)
        graph.capacity[nodes[there], arc] = rng.integers(0, largest, there.sum()) * rng.integers(0, 2, there.sum())
    if layers == 2:
        graph.capacity[nodes, 4] = rng.integers(0, largest, nodes.size)
        shuffled = rng.permutation(nodes)
        for a, b in zip(shuffled[::2], shuffled[1::2], strict=True):
            if a != b ^ 1 and rng.random() < 0.7:
                graph.across[a], graph.across[b] = b, a
                graph.capacity[[a, b], 5] = rng.integers(0, largest, 2)
    return graph


def sparse_capacities(graph):
    """(N + 2, N + 2) csr: between all nodes, the source (N) and the sink (N + 1)."""
    count = graph.terminal.size
    node = np.arange(count)
    heads = [*(node + graph.offset[:, None]), node ^ 1, graph.across]
    arcs = [(np.full(count, count), node, np.maximum(graph.terminal, 0))]
    arcs.append((node, np.full(count, count + 1), np.maximum(-graph.terminal, 0)))
    arcs += [(node, heads[arc], graph.capacity[:, arc]) for arc in range(graph.capacity.shape[1])]
    tail, head, capacity = (np.concatenate(each) for each in zip(*arcs, strict=True))
    used = capacity > 0
    return csr_matrix((capacity[used].astype(np.int32), (tail[used], head[used])), shape=(count + 2, count + 2))


def capacities(graph):
    """The same as an array."""
    return sparse_capacities(graph).toarray()


def cut_value(matrix, sink_side):
    """What goes from the source's side to the sink's."""
    sink_side = np.append(sink_side, [False, True])
    return int(matrix[np.ix_(~sink_side, sink_side)].sum())


def copied(graph):
    return Graph(*(array.copy() for array in graph))


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("seed", range(60))
def test_flow_and_both_cuts_equal_the_flow_that_scipy_finds(layers, seed):
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, *rng.integers(1, 9, 2), layers)
    matrix = capacities(graph)
    expected = scipy_maximum_flow(csr_matrix(matrix), len(matrix) - 2, len(matrix) - 1).flow_value
    flow, sink_side, _ = maximum_flow(graph)
    assert flow == expected
    assert cut_value(matrix, sink_side) == expected
    assert cut_value(matrix, ~source_side(graph)) == expected


@pytest.mark.parametrize("seed", range(20))
def test_the_cut_is_the_cheapest_of_all_cuts_and_of_the_cheapest_the_smallest(seed):
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, 2, 5, 1, largest=3)
    matrix, nodes = capacities(graph), nodes_of(2, 5, 1)
    _, smallest, _ = maximum_flow(graph)
    largest = ~source_side(graph)
    cuts = []
    for sides in itertools.product([False, True], repeat=nodes.size):
        cut = np.zeros(graph.terminal.size, bool)
        cut[nodes] = sides
        cuts.append((cut_value(matrix, cut), cut[nodes]))
    least = min(value for value, _ in cuts)
    best = [cut for value, cut in cuts if value == least]
    np.testing.assert_array_equal(smallest[nodes], np.logical_and.reduce(best))
    np.testing.assert_array_equal(largest[nodes], np.logical_or.reduce(best))


@pytest.mark.parametrize("layers", [1, 2])
def test_what_is_left_is_a_flow_residuals_are_no_less_than_zero_and_nothing_is_lost(layers):
    graph = random_graph(np.random.default_rng(7), 12, 15, layers, largest=50)
    before = copied(graph)
    flow, _, _ = maximum_flow(graph)
    assert (graph.capacity >= 0).all()
    assert (np.abs(graph.terminal) <= np.abs(before.terminal)).all()
    assert (graph.terminal * before.terminal >= 0).all()
    assert np.maximum(before.terminal, 0).sum() - np.maximum(graph.terminal, 0).sum() == flow
    sent = (before.capacity - graph.capacity).sum(axis=1)  # out of a node, less what came in
    np.testing.assert_array_equal(sent, before.terminal - graph.terminal)


def test_without_sources_or_without_sinks_nothing_flows():
    for sign in (-1, 1):
        graph = random_graph(np.random.default_rng(3), 6, 7, 1)
        graph.terminal[:] = sign * np.abs(graph.terminal)
        flow, sink_side, _ = maximum_flow(graph)
        assert flow == 0
        assert sink_side.any() == (sign < 0)


def test_a_snake_as_long_as_the_grid_is_followed_to_its_end():
    """One path through every pixel, row by row there and back: the tree must grow as deep as there are pixels."""
    height, width = 30, 40
    graph = empty_graph(height, width, 1)
    nodes = nodes_of(height, width, 1).reshape(height, width)
    snake = np.concatenate([row if y % 2 == 0 else row[::-1] for y, row in enumerate(nodes)])
    for a, b in itertools.pairwise(snake):
        graph.capacity[a, list(graph.offset).index(b - a)] = 5
    graph.terminal[snake[0]], graph.terminal[snake[-1]] = 9, -7
    assert maximum_flow(graph)[0] == 5


def flow_of_pymaxflow(graph):
    maxflow = pytest.importorskip("maxflow", reason="needs PyMaxflow (GPL, the extra `oracle`)")
    count, arcs = graph.terminal.size, sparse_capacities(graph).tocoo()
    reference = maxflow.Graph[int](count, arcs.nnz)
    reference.add_nodes(count)
    for tail, head, capacity in zip(arcs.row.tolist(), arcs.col.tolist(), arcs.data.tolist(), strict=True):
        if tail == count:
            reference.add_tedge(head, capacity, 0)
        elif head == count + 1:
            reference.add_tedge(tail, 0, capacity)
        else:
            reference.add_edge(tail, head, capacity, 0)
    return reference.maxflow()


@pytest.mark.parametrize("seed", range(3))
def test_a_grid_of_the_size_of_an_image_agrees_with_pymaxflow(seed):
    graph = random_graph(np.random.default_rng(seed), 120, 160, 1, largest=1000)
    expected = flow_of_pymaxflow(graph)
    assert maximum_flow(graph)[0] == expected


def rendered_pair(seed, shape=(90, 130)):
    """(left, right) (H, W) uint8: a textured square of disparity 9 before a wall of disparity 3, with noise."""
    rng = np.random.default_rng(seed)
    wall, near = (cv2.GaussianBlur(rng.normal(0, 120, (shape[0], shape[1] + 20)), (0, 0), 1.2) for _ in range(2))
    left, right = wall[:, : shape[1]].copy(), wall[:, 3 : shape[1] + 3].copy()
    left[20:70, 50:90], right[20:70, 41:81] = near[20:70, 50:90], near[20:70, 41:81]
    return tuple(np.clip(np.rint(128 + i + rng.normal(0, 4, shape)), 0, 255).astype(np.uint8) for i in (left, right))


def graph_of_gc(label, count=12):
    """An expansion of the graph-cut matcher's energy on plain differences, away from the cheapest labels."""
    left, right = rendered_pair(label)
    costs = np.full((*left.shape, count), 150, np.uint16)
    for d in range(count):
        difference = np.abs(left[:, d:].astype(np.int16) - right[:, : left.shape[1] - d])
        costs[:, d:, d] = cv2.blur(np.minimum(difference, 60), (3, 3))
    labels = costs.argmin(axis=2).astype(np.int32)
    box, free = np.array([0, left.shape[0], 0, left.shape[1]]), labels != label
    return move_graph(costs, edge_weights(left[..., None], 12, (10, 4)), (6, label), labels, (box, free))


def graph_of_kz2(label, count=12):
    """An expansion of kz2's energy from a good start, or a move to a labelling shifted by a row (label -1)."""
    energy, _ = energy_of_pair(*rendered_pair(label + 1), count)
    start = good_start(energy)
    labels = moves.labels_of(energy, start)
    proposal = np.full(start.shape, label, np.int16)
    proposal[:, :label] = moves.UNMATCHED
    if label < 0:
        shifted = np.roll(start, 1, axis=0)
        proposal = np.where(shifted == start, np.int16(moves.UNMATCHED), shifted)
    graph = empty_graph(*start.shape, 2)
    move = moves.Move(energy, labels, proposal, moves._kinds(labels, proposal, 0), graph, 0)
    moves._clear(graph)
    moves._add_keeps(move)
    moves._add_takes(move)
    moves._forbid_doubles(move)
    return graph, move


def flow_of_scipy(graph):
    matrix = sparse_capacities(graph)
    return scipy_maximum_flow(matrix, matrix.shape[0] - 2, matrix.shape[0] - 1).flow_value


REAL_GRAPHS = {
    **{f"gc, label {d}": lambda d=d: graph_of_gc(d) for d in (2, 3, 9)},
    **{f"kz2, label {d}": lambda d=d: graph_of_kz2(d)[0] for d in (2, 3, 9)},
    "kz2, another labelling": lambda: graph_of_kz2(-1)[0],
}


@pytest.mark.parametrize("name", REAL_GRAPHS)
def test_flow_and_both_cuts_of_a_matchers_move_equal_the_flow_that_scipy_finds(name):
    graph = REAL_GRAPHS[name]()
    matrix, expected = sparse_capacities(graph), flow_of_scipy(graph)
    flow, sink_side, _ = maximum_flow(graph)
    assert flow == expected > 0
    for side in (sink_side, ~source_side(graph)):
        assert 0 < side.sum() < side.size
        assert cut_value(matrix, side) == expected


@pytest.mark.parametrize("name", REAL_GRAPHS)
def test_the_flow_of_a_matchers_move_agrees_with_pymaxflow(name):
    graph = REAL_GRAPHS[name]()
    expected = flow_of_pymaxflow(graph)
    assert maximum_flow(graph)[0] == expected


@pytest.mark.parametrize("label", [-1, 2, 3, 9])
def test_what_kz2_pushes_along_direct_paths_first_is_part_of_the_maximum_flow(label):
    graph, move = graph_of_kz2(label)
    expected = flow_of_scipy(graph)
    direct = moves._push_direct(move)
    assert direct > 0
    assert direct + maximum_flow(graph)[0] == expected
