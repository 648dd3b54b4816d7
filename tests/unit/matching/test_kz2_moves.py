"""The energy of kz2 against its definition, and its moves against the best of all outcomes on tiny images."""

import itertools
from typing import NamedTuple

import numpy as np
import pytest

from stereogrid.matching.kz2.cost import NO_ASSIGNMENT, Energy, energy_of_pair, flat_edges
from stereogrid.matching.kz2.energy import total_energy
from stereogrid.matching.kz2.moves import UNMATCHED, labels_of, make_move
from stereogrid.matching.kz2.solve import Search, minimise, offer
from stereogrid.matching.kz2.start import good_start
from stereogrid.matching.maxflow import empty_graph

NO_ROOM = 1 << 40


class Problem(NamedTuple):
    """An energy, and the images (H, W, channels) int that its smoothness was made from."""

    energy: Energy
    left: np.ndarray
    right: np.ndarray


def random_problem(seed, shape=(3, 5), count=3, channels=1):
    rng = np.random.default_rng(seed)
    left, right = (rng.integers(0, 14, (*shape, channels), dtype=np.uint8) for _ in range(2))
    cost = rng.integers(-25, 16, (count, *shape)).astype(np.int16)
    for d in range(count):
        cost[d, :, :d] = NO_ASSIGNMENT
    energy = Energy(cost, flat_edges(left), flat_edges(right), 9, 3)
    return Problem(energy, left.astype(int), right.astype(int))


def random_labels(seed, shape=(3, 5), count=3, share=0.8):
    """Labels (H, W) int16 with no right pixel twice."""
    rng = np.random.default_rng(1000 + seed)
    label = np.full(shape, UNMATCHED, np.int16)
    for y, x in np.ndindex(*shape):
        free = set(range(min(x + 1, count))) - {x - u + label[y, u] for u in range(x) if label[y, u] >= 0}
        if free and rng.random() < share:
            label[y, x] = rng.choice(sorted(free))
    return label


def penalty(problem, p, q, d):
    """lambda of the assignments of disparity d of two neighbours; 0 if one of them is none."""
    if min(p[1], q[1]) < d:
        return 0
    changes = (
        problem.left[p] - problem.left[q],
        problem.right[p[0], p[1] - d] - problem.right[q[0], q[1] - d],
    )
    flat = all(np.abs(change).max() < 8 for change in changes)
    return problem.energy.lambda1 if flat else problem.energy.lambda2


def neighbours(shape):
    for y, x in np.ndindex(*shape):
        yield from (((y, x), q) for q in ((y, x + 1), (y + 1, x)) if q[0] < shape[0] and q[1] < shape[1])


def energy_twin(problem, label):
    cost = problem.energy.cost
    data = sum(int(cost[(label[p], *p)]) for p in np.ndindex(*label.shape) if label[p] >= 0)
    pairs = itertools.product(neighbours(label.shape), range(len(cost)))
    return data + sum(penalty(problem, p, q, d) for (p, q), d in pairs if (label[p] == d) != (label[q] == d))


def least_energy(problem, outcomes, extra=lambda *_: 0):
    """The least energy of all unique labellings: outcomes[y][x] lists (label, how). Row by row, no row left out.

    extra(p, outcome of p, q, outcome of q) is added for each pair of neighbours.
    """

    def between(p, q):
        def term(a, b):
            broken = {a[0], b[0]} - {UNMATCHED} if a[0] != b[0] else ()
            return sum(penalty(problem, p, q, d) for d in broken) + extra(p, a, q, b)

        return np.array([[term(a, b) for b in outcomes[q[0]][q[1]]] for a in outcomes[p[0]][p[1]]])

    least, states_above = np.zeros(1, int), None
    for y, row in enumerate(outcomes):
        states = np.array([s for s in itertools.product(*(range(len(each)) for each in row)) if unique(row, s)])
        energy = np.zeros(len(states), int)
        for x, each in enumerate(row):
            data = np.array([0 if d < 0 else problem.energy.cost[d, y, x] for d, _ in each], int)
            energy += data[states[:, x]]
            if x > 0:
                energy += between((y, x - 1), (y, x))[states[:, x - 1], states[:, x]]
        if y > 0:
            tables = [between((y - 1, x), (y, x)) for x in range(len(row))]
            down = sum(t[states_above[:, None, x], states[None, :, x]] for x, t in enumerate(tables))
            energy += (least[:, None] + down).min(axis=0)
        least, states_above = energy, states
    return int(least.min())


def unique(row, state):
    matched = [x - each[k][0] for x, (each, k) in enumerate(zip(row, state, strict=True)) if each[k][0] >= 0]
    return len(set(matched)) == len(matched)


def outcomes_of(label, proposal, first=0):
    """What a move may do: keep, take or lose where something is proposed; keep or lose where that takes a match."""
    outcomes = []
    for y, row in enumerate(label):
        offered = proposal[y - first] if first <= y < first + len(proposal) else np.full(len(row), UNMATCHED)
        wanted = {x - d for x, d in enumerate(offered) if d >= 0}
        outcomes.append([])
        for x, d in enumerate(row):
            lost = [(UNMATCHED, "lost")] if offered[x] >= 0 or (d >= 0 and x - d in wanted) else []
            taken = [(int(offered[x]), "taken")] if offered[x] >= 0 else []
            outcomes[-1].append([(int(d), "kept"), *lost, *taken])
    return outcomes


def moved(problem, label, proposal, first=0, eager=False):
    """(gain, labels afterwards) of one move."""
    labels = labels_of(problem.energy, label.copy())
    graph = empty_graph(*proposal.shape, 2)
    gain, _ = make_move(problem.energy, labels, (proposal, first), (graph, 1, eager))
    return int(gain), labels


def region_of(d, region):
    proposal = np.where(region, d, UNMATCHED).astype(np.int16)
    proposal[:, :d] = UNMATCHED
    return proposal


def assert_consistent(problem, labels, start):
    """Owner, cost and changed say what the labels say."""
    owner, cost = np.full(labels.label.shape, UNMATCHED), np.zeros(labels.label.shape)
    for y, x in np.argwhere(labels.label >= 0):
        d = labels.label[y, x]
        assert owner[y, x - d] == UNMATCHED
        owner[y, x - d], cost[y, x] = x, problem.energy.cost[d, y, x]
    np.testing.assert_array_equal(labels.owner, owner)
    np.testing.assert_array_equal(labels.cost[labels.label >= 0], cost[labels.label >= 0])
    np.testing.assert_array_equal(labels.changed, labels.label != start)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("seed", range(20))
def test_the_energy_is_that_of_its_definition(seed, channels):
    problem, label = random_problem(seed, (4, 7), 4, channels), random_labels(seed, (4, 7), 4)
    assert total_energy(problem.energy, label) == energy_twin(problem, label)
    assert total_energy(problem.energy, np.full_like(label, UNMATCHED)) == 0


@pytest.mark.parametrize("eager", [False, True])
@pytest.mark.parametrize("seed", range(25))
def test_an_expansion_is_the_best_of_all_its_outcomes(seed, eager):
    problem, label = random_problem(seed), random_labels(seed)
    before, fell = energy_twin(problem, label), 0
    for d in range(3):
        proposal = region_of(d, np.ones(label.shape, bool))
        gain, labels = moved(problem, label, proposal, eager=eager)
        after = energy_twin(problem, labels.label)
        assert after == least_energy(problem, outcomes_of(label, proposal))
        assert gain == before - after
        assert_consistent(problem, labels, label)
        fell += gain
    assert fell > 0


@pytest.mark.parametrize("seed", range(25))
def test_a_move_of_a_region_or_of_some_rows_is_the_best_of_its_outcomes_and_leaves_the_rest(seed):
    problem, label, rng = random_problem(seed, (4, 5)), random_labels(seed, (4, 5)), np.random.default_rng(seed)
    for d, (first, last) in itertools.product(range(3), [(0, 4), (1, 3), (2, 4), (0, 1)]):
        proposal = region_of(d, rng.random((last - first, 5)) < 0.5)
        gain, labels = moved(problem, label, proposal, first, eager=bool(seed % 2))
        after, outcomes = energy_twin(problem, labels.label), outcomes_of(label, proposal, first)
        assert after == least_energy(problem, outcomes)
        assert gain == energy_twin(problem, label) - after
        assert all(labels.label[p] in [d for d, _ in outcomes[p[0]][p[1]]] for p in np.ndindex(4, 5))
        assert_consistent(problem, labels, label)


def test_of_equally_good_outcomes_the_eager_one_takes_all_proposals_that_the_other_takes_and_more():
    more = 0
    for seed in range(40):
        problem, label = random_problem(seed), random_labels(seed)
        proposal = region_of(seed % 3, np.ones(label.shape, bool))
        (gain, eager), (same, shy) = (moved(problem, label, proposal, eager=each) for each in (True, False))
        took_eagerly, took = ((each.label == proposal) & (proposal >= 0) for each in (eager, shy))
        assert gain == same
        assert not (took & ~took_eagerly).any()
        more += np.count_nonzero(took_eagerly & ~took)
    assert more > 0


@pytest.mark.parametrize("seed", range(25))
def test_a_move_to_another_labelling_is_the_best_by_a_bound_and_the_energy_falls_at_least_as_far(seed):
    """The bound: a kept match and a neighbour's taken one count as different, both ways, even where they are alike."""
    problem, label, other = random_problem(seed), random_labels(seed), random_labels(seed + 50)
    proposal = np.where(other == label, np.int16(UNMATCHED), other)
    outcomes = outcomes_of(label, proposal)

    def bound(p, a, q, b):
        # What cannot be lost is no node: that it is alike is known.
        unsure = all(len(outcomes[at[0]][at[1]]) > 1 for at in (p, q))
        alike = a[0] == b[0] >= 0 and {a[1], b[1]} == {"kept", "taken"}
        return 2 * penalty(problem, p, q, a[0]) if alike and unsure else 0

    gain, labels = moved(problem, label, proposal)
    before, after = energy_twin(problem, label), energy_twin(problem, labels.label)
    assert before - gain == least_energy(problem, outcomes, bound)
    assert 0 <= gain <= before - after
    assert_consistent(problem, labels, label)


def test_an_offered_labelling_never_raises_the_energy_mostly_lowers_it_and_its_gain_is_noted():
    gains = []
    for seed in range(30):
        problem, start = random_problem(seed, (6, 8), 4), random_labels(seed, (6, 8), 4)
        search = Search.of(problem.energy, start)
        offer(search, random_labels(seed + 50, (6, 8), 4))
        assert search.gains == [energy_twin(problem, start) - energy_twin(problem, search.labels.label)]
        assert_consistent(problem, search.labels, start)
        gains += search.gains
    assert min(gains) >= 0
    assert np.mean(np.array(gains) > 0) > 0.8


@pytest.mark.parametrize("seed", range(30))
def test_of_two_labels_on_a_tiny_image_the_result_is_the_best_of_all_labellings(seed):
    rng = np.random.default_rng(seed)
    left, right = (rng.integers(0, 40, (3, 4, 1 + 2 * (seed % 2)), dtype=np.uint8) for _ in range(2))
    energy, _ = energy_of_pair(left, right, 2)
    problem = Problem(energy, left.astype(int), right.astype(int))
    every = [[[(d, "any") for d in range(-1, min(x + 1, 2))] for x in range(4)] for _ in range(3)]
    best = least_energy(problem, every)
    for start in (good_start(energy), np.full((3, 4), UNMATCHED, np.int16)):
        assert energy_twin(problem, minimise(energy, start).labels.label) == best
