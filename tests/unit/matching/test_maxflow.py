"""The maximum flow against scipy's, brute force over all cuts, and PyMaxflow where it is installed."""

import itertools

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_flow as scipy_maximum_flow

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


def capacities(graph):
    """(N + 2, N + 2): between all nodes, the source (N) and the sink (N + 1)."""
    count = graph.terminal.size
    matrix = np.zeros((count + 2, count + 2), np.int32)
    matrix[count, :count] = np.maximum(graph.terminal, 0)
    matrix[:count, count + 1] = np.maximum(-graph.terminal, 0)
    node = np.arange(count)
    heads = [*(node + graph.offset[:, None]), node ^ 1, graph.across]
    for arc in range(graph.capacity.shape[1]):
        used = graph.capacity[:, arc] > 0
        np.add.at(matrix, (node[used], heads[arc][used]), graph.capacity[used, arc])
    return matrix


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


@pytest.mark.parametrize("seed", range(3))
def test_a_grid_of_the_size_of_an_image_agrees_with_pymaxflow(seed):
    maxflow = pytest.importorskip("maxflow", reason="needs PyMaxflow (GPL, the extra `oracle`)")
    height, width = 120, 160
    graph = random_graph(np.random.default_rng(seed), height, width, 1, largest=1000)
    nodes = nodes_of(height, width, 1)
    reference = maxflow.Graph[int](nodes.size, 4 * nodes.size)
    reference.add_nodes(nodes.size)
    index = np.full(graph.terminal.size, -1)
    index[nodes] = np.arange(nodes.size)
    for node in nodes:
        weight = int(graph.terminal[node])
        reference.add_tedge(index[node], max(weight, 0), max(-weight, 0))
        for arc in (0, 2):
            other = node + graph.offset[arc]
            if index[other] >= 0:
                forth, back = int(graph.capacity[node, arc]), int(graph.capacity[other, arc + 1])
                reference.add_edge(index[node], index[other], forth, back)
    assert maximum_flow(graph)[0] == reference.maxflow()
