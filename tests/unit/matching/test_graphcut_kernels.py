"""The kernels of the graph-cut matcher against NumPy twins and brute force."""

import itertools

import numpy as np
import pytest

from stereogrid.matching.census import alike, census_of
from stereogrid.matching.graphcut.aggregation import line_means, weight_tables
from stereogrid.matching.graphcut.cost import cost_table, match_costs
from stereogrid.matching.graphcut.expansion import edge_weights, energy, expand
from stereogrid.matching.graphcut.median import straighten
from stereogrid.matching.graphcut.paths import PATHS, sweep
from stereogrid.matching.graphcut.subpixel import fit, smoothed
from stereogrid.matching.graphcut.visibility import agreement, constrain, fill_from_farther, hidden_pixels
from stereogrid.matching.images import toned_as


def grey_image(seed, shape=(9, 14)):
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def census_twin(grey):
    """(H, W, 62) bool in the order of the bits, the first the highest."""
    height, width = grey.shape
    padded = np.pad(grey, ((3, 3), (4, 4)), mode="edge")
    shifts = [(v, u) for v in range(7) for u in range(9) if (v, u) != (3, 4)]
    return np.stack([padded[v : v + height, u : u + width] < grey for v, u in shifts], axis=2)


def cost_twin(left, right, table, beyond, count):
    """(H, W, D) from grey images (H, W)."""
    height, width = left.shape
    bits = census_twin(left), census_twin(right)
    costs = np.full((height, width, count), beyond, np.uint8)
    for d in range(min(count, width)):
        shown = slice(d, width), slice(0, width - d)
        unlike = (bits[0][:, shown[0]] != bits[1][:, shown[1]]).sum(axis=2)
        difference = np.abs(left[:, shown[0]].astype(int) - right[:, shown[1]])
        costs[:, shown[0], d] = table[unlike, difference]
    return costs


def energy_twin(costs, weights, cut, labels):
    data = np.take_along_axis(costs, labels[..., None], axis=2).sum(dtype=np.int64)
    across = np.minimum(np.abs(np.diff(labels, axis=1)), cut) * weights[0, :, :-1]
    down = np.minimum(np.abs(np.diff(labels, axis=0)), cut) * weights[1, :-1]
    return int(data + across.sum() + down.sum())


def random_problem(seed, shape=(9, 14), count=6, strongest=90):
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, 200, (*shape, count)).astype(np.uint16)
    weights = rng.integers(0, strongest, (2, *shape)).astype(np.int32)
    return costs, weights, rng.integers(0, count, shape).astype(np.int32)


def everywhere(labels):
    return np.ones(labels.shape, bool)


@pytest.mark.parametrize("shape", [(9, 14), (1, 1), (3, 40)])
def test_the_census_says_which_neighbours_are_darker(shape):
    grey = grey_image(0, shape)
    powers = 2 ** np.arange(61, -1, -1, dtype=np.uint64)
    np.testing.assert_array_equal(census_of(grey), (census_twin(grey) * powers).sum(axis=2, dtype=np.uint64))


def test_the_census_does_not_see_how_bright_an_image_is():
    grey = grey_image(1) // 2
    np.testing.assert_array_equal(census_of(grey), census_of(grey + 100))


def test_the_cost_rises_with_either_term_and_saturates():
    table = cost_table(15.0, 10.0).astype(int)
    assert table[0, 0] == 0
    assert table.max() <= 254
    assert (np.diff(table, axis=0) >= 0).all()
    assert (np.diff(table, axis=1) >= 0).all()
    assert table[10, 0] > table[62, 0] / 2 - 5
    assert table[0, 20] > 0.8 * table[0, 255]


@pytest.mark.parametrize("count", [1, 5, 14, 20])
def test_costs_are_those_of_the_numpy_twin(count):
    left, right, table = grey_image(2), grey_image(3), cost_table(15.0, 10.0)
    costs = np.empty((*left.shape, count), np.uint8)
    pair = [(i[..., None], census_of(i)) for i in (left, right)]
    match_costs(pair[0], pair[1], table, 77, costs)
    np.testing.assert_array_equal(costs, cost_twin(left, right, table, 77, count))


def test_the_difference_of_colour_images_is_the_mean_of_the_channels():
    left, right = grey_image(4, (9, 14, 3)), grey_image(5, (9, 14, 3))
    bits = np.zeros((9, 14), np.uint64)
    by_difference = np.tile(np.arange(256, dtype=np.uint8), (63, 1))
    costs = np.empty((9, 14, 1), np.uint8)
    match_costs((left, bits), (right, bits), by_difference, 0, costs)
    np.testing.assert_array_equal(costs[..., 0], np.abs(left.astype(int) - right).sum(axis=2) // 3)


def test_alike_counts_the_unlike_bits_where_the_label_points():
    left, right = grey_image(6), grey_image(7)
    labels = np.random.default_rng(8).integers(0, 9, left.shape).astype(np.int32)
    found = np.empty(left.shape, bool)
    alike(census_of(left), census_of(right), labels, 30, found)
    bits = census_twin(left), census_twin(right)
    for y, x in np.ndindex(*left.shape):
        u = x - labels[y, x]
        assert found[y, x] == (u >= 0 and (bits[0][y, x] != bits[1][y, max(u, 0)]).sum() <= 30)
    assert 0 < found.mean() < 1


def means_twin(costs, image, tables, gain):
    """(H, W, D) of a grey image, pixel by pixel."""
    by_change, by_distance = tables
    grey, reach = image.astype(int), len(by_distance) - 1
    means = np.empty(costs.shape)
    for y, x in np.ndindex(*grey.shape):
        total, weights = 0.0, 0.0
        for u in range(max(0, x - reach), min(grey.shape[1], x + reach + 1)):
            way = grey[y, min(x, u) : max(x, u) + 1]
            worst = max(np.abs(way - grey[y, x]).max(), np.abs(np.diff(way, append=way[-1])).max() // 2)
            weight = float(by_change[worst]) * float(by_distance[abs(u - x)]) if u != x else 1.0
            total, weights = total + weight * costs[y, u], weights + weight
        means[y, x] = gain * total / weights
    return means


def test_means_are_those_of_the_numpy_twin():
    grey = np.clip(np.cumsum(np.random.default_rng(9).integers(-9, 10, (6, 30)), axis=1) + 128, 0, 255).astype(np.uint8)
    costs = np.random.default_rng(10).integers(0, 255, (6, 30, 7), dtype=np.uint8)
    tables = weight_tables(5, 12.0, 6.0)
    found = np.empty(costs.shape, np.uint16)
    line_means(costs, grey[..., None], tables, (False, 0, 8.0), found)
    np.testing.assert_allclose(found, means_twin(costs, grey, tables, 8.0), atol=0.51)


def test_the_right_image_reads_the_same_costs_from_the_other_end():
    grey, costs = grey_image(11, (5, 20)), grey_image(12, (5, 20, 7))
    tables = weight_tables(4, 40.0, 6.0)
    mirrored = np.full(costs.shape, 99, np.uint8)
    for d in range(7):
        mirrored[:, : 20 - d, d] = costs[:, d:, d]
    found, expected = (np.empty(costs.shape, np.uint16) for _ in range(2))
    line_means(costs, grey[..., None], tables, (True, 99, 8.0), found)
    line_means(mirrored, grey[..., None], tables, (False, 0, 8.0), expected)
    np.testing.assert_array_equal(found, expected)


def path_twin(costs, image, rule):
    """Sum over the eight paths of Hirschmueller's Eq. 13, by recursion on single pixels."""
    small, large, edge, times = rule
    height, width = image.shape
    total = np.zeros(costs.shape, int)
    for dy, dx in itertools.product((-1, 0, 1), repeat=2):
        if (dy, dx) == (0, 0):
            continue
        path = np.zeros(costs.shape, int)
        for y in range(height)[:: 1 if dy <= 0 else -1]:
            for x in range(width)[:: 1 if dx <= 0 else -1]:
                v, u = y + dy, x + dx
                path[y, x] = costs[y, x]
                if 0 <= v < height and 0 <= u < width:
                    k = times if abs(int(image[y, x]) - int(image[v, u])) >= edge else 1
                    before, least = path[v, u], path[v, u].min()
                    beside = np.minimum(np.append(before[1:], 10**6), np.insert(before[:-1], 0, 10**6)) + small // k
                    path[y, x] += np.minimum(np.minimum(before, beside), least + large // k) - least
        total += path
    return total


@pytest.mark.parametrize("count", [1, 2, 9])
def test_path_costs_are_those_of_the_numpy_twin(count):
    image, rule = grey_image(13), (80, 400, 60, 4)
    costs = np.random.default_rng(14).integers(0, 600, (*image.shape, count)).astype(np.uint16)
    total = np.zeros(costs.shape, np.uint16)
    for forward in (True, False):
        sweep(costs, image[..., None], rule, forward, total)
    np.testing.assert_array_equal(total, path_twin(costs, image, rule))
    assert PATHS == 8


def test_weights_are_less_across_a_step_of_intensity():
    image = np.full((4, 5, 1), 100, np.uint8)
    image[:, 3:] = 110
    weights = edge_weights(image, 80, (10, 4))
    assert (weights[0, :, 2] == 20).all()
    assert (np.delete(weights[0], 2, axis=1) == 80).all()
    assert (weights[1] == 80).all()


def test_the_right_image_gets_the_tones_of_the_left_but_for_what_any_two_views_differ_by():
    left = grey_image(20, (40, 50, 1)) // 2 + 60
    right = np.rint(0.7 * left[:, ::-1] + 20).astype(np.uint8)
    assert np.abs(toned_as(left, right).astype(int) - left[:, ::-1]).max() <= 3 + 0.03 * 64 + 1
    np.testing.assert_array_equal(toned_as(left, left[:, ::-1] + 3), left[:, ::-1] + 3)
    flat = np.full((5, 6, 1), 9, np.uint8)
    np.testing.assert_array_equal(toned_as(flat + 100, flat), flat + 97)


@pytest.mark.parametrize("seed", range(5))
def test_the_energy_is_that_of_the_numpy_twin(seed):
    costs, weights, labels = random_problem(seed)
    assert energy(costs, weights, 3, labels) == energy_twin(costs, weights, 3, labels)


@pytest.mark.parametrize("slack", [-50, 0, 40, 10**6])
@pytest.mark.parametrize("seed", range(4))
def test_no_expansion_raises_the_energy(seed, slack):
    costs, weights, labels = random_problem(seed)
    energies, changed = [energy_twin(costs, weights, 3, labels)], 0
    for alpha in range(costs.shape[2]):
        before = labels.copy()
        moved = expand(costs, weights, (3, slack), alpha, labels, everywhere(labels))
        energies.append(energy_twin(costs, weights, 3, labels))
        assert (labels[labels != before] == alpha).all()
        assert moved == np.count_nonzero(labels != before)
        assert (energies[-1] < energies[-2]) == (moved > 0)
        changed += moved
    assert changed > 0


@pytest.mark.parametrize("seed", range(20))
def test_an_expansion_is_the_best_of_all_moves(seed):
    """Against brute force over all 2^9 ways to give alpha to pixels of a 3 x 3 image."""
    costs, weights, labels = random_problem(seed, (3, 3), 4)
    start, alpha = labels.copy(), seed % 4
    best = min(
        energy_twin(costs, weights, 2, np.where(np.reshape(taken, (3, 3)), alpha, start).astype(np.int32))
        for taken in itertools.product((False, True), repeat=9)
    )
    expand(costs, weights, (2, 10**6), alpha, labels, everywhere(labels))
    assert energy_twin(costs, weights, 2, labels) == best


@pytest.mark.parametrize("seed", range(10))
def test_of_two_labels_one_expansion_finds_the_least_energy_of_all(seed):
    costs, weights, _ = random_problem(seed, (3, 4), 2)
    labels = np.zeros((3, 4), np.int32)
    expand(costs, weights, (1, 10**6), 1, labels, everywhere(labels))
    all_labels = (np.reshape(taken, (3, 4)).astype(np.int32) for taken in itertools.product((0, 1), repeat=12))
    assert energy_twin(costs, weights, 1, labels) == min(energy_twin(costs, weights, 1, each) for each in all_labels)


@pytest.mark.parametrize("seed", range(10))
def test_pixels_that_may_not_move_keep_their_label_and_the_others_do_their_best(seed):
    costs, weights, labels = random_problem(seed, (3, 4), 4)
    start, movable = labels.copy(), np.random.default_rng(seed).random((3, 4)) < 0.6
    ways = itertools.product((False, True), repeat=int(movable.sum()))

    def taken(way):
        found = start.copy()
        found[movable] = np.where(way, 2, start[movable])
        return found

    best = min(energy_twin(costs, weights, 2, taken(way)) for way in ways)
    expand(costs, weights, (2, 10**6), 2, labels, movable)
    np.testing.assert_array_equal(labels[~movable], start[~movable])
    assert energy_twin(costs, weights, 2, labels) == best


def test_a_label_is_offered_where_it_costs_little_more_or_a_neighbour_has_it():
    costs = np.full((1, 7, 2), 100, np.uint16)
    costs[0, :, 1] = 111, 111, 111, 111, 110, 111, 111
    labels = np.array([[1, 0, 0, 0, 0, 0, 0]], np.int32)
    weights = np.zeros((2, 1, 7), np.int32)
    costs[0, [1, 2, 3, 4], 0] = 200
    assert expand(costs, weights, (1, -95), 1, labels, everywhere(labels)) == 1
    np.testing.assert_array_equal(labels, [[1, 1, 0, 0, 0, 0, 0]])
    assert expand(costs, weights, (1, -90), 1, labels, everywhere(labels)) == 2
    np.testing.assert_array_equal(labels, [[1, 1, 1, 0, 1, 0, 0]])


def test_labels_agree_where_the_right_pixel_has_the_same_one():
    left = np.array([[3, 0, 2, 2, 1]], np.int32)
    right = np.array([[2, 0, 3, 5, 9]], np.int32)
    found = np.empty(left.shape, bool)
    agreement(left, right, 0, found)
    np.testing.assert_array_equal(found, [[False, True, True, False, False]])
    agreement(left, right, 2, found)
    np.testing.assert_array_equal(found, [[False, True, True, True, False]])


def test_holes_take_the_smaller_of_the_labels_beside_them():
    labels = np.array([[0, 5, 0, 0, 3, 0], [0, 0, 0, 0, 0, 0], [9, 9, 9, 2, 9, 4]], np.int32)
    agreed = np.array([[0, 1, 0, 0, 1, 0], [0] * 6, [0, 0, 0, 1, 0, 1]], bool)
    fill_from_farther(agreed, labels)
    np.testing.assert_array_equal(labels, [[5, 5, 3, 3, 3, 3], [0] * 6, [2, 2, 2, 2, 2, 4]])


def test_labels_that_would_be_hidden_cost_the_same_and_those_seen_through_a_lot():
    costs = np.full((1, 4, 4), 10, np.uint16)
    costs[0, 3, 0] = 900
    right = np.array([[3, 3, 0, 0]], np.int32)
    agreed = np.array([[True, True, True, False]])
    constrain(costs, right, agreed, (0, 70, 500))
    np.testing.assert_array_equal(costs[0, :3], np.full((3, 4), 10))
    # Label 0 lands on 0: kept; 1 on 0: seen through; 2 on 3: hidden; 3 on 3: kept.
    np.testing.assert_array_equal(costs[0, 3], [900, 500, 70, 10])


def test_beyond_the_edge_every_label_is_hidden():
    costs = np.full((1, 3, 4), 10, np.uint16)
    constrain(costs, np.zeros((1, 3), np.int32), np.zeros((1, 3), bool), (0, 70, 500))
    np.testing.assert_array_equal(costs[0], [[10, 70, 70, 70], [10, 500, 70, 70], [10, 500, 500, 70]])


def test_hidden_is_what_lands_behind_something_nearer_or_outside():
    labels = np.array([[1, 2, 2, 2, 2, 5, 5, 5, 2]], np.int32)
    found = np.empty(labels.shape, bool)
    hidden_pixels(labels, 1, found)
    np.testing.assert_array_equal(found[0], [True] * 5 + [False] * 4)
    hidden_pixels(labels, 3, found)
    np.testing.assert_array_equal(found[0], [True] * 2 + [False] * 7)


@pytest.mark.parametrize("rise", [2.0, 17.0])
@pytest.mark.parametrize(("power", "largest_error_px"), [(2, 0.15), (1, 0.07)])
def test_the_fit_finds_the_minimum_of_parabolas_nearly_and_of_slopes_better(rise, power, largest_error_px):
    for true in np.arange(3.5, 4.51, 0.1):
        costs = np.rint(100 * rise * np.abs(np.arange(9) - true) ** power).astype(np.uint16)[None, None]
        labels = np.array([[round(true)]], np.int32)
        found = np.empty((1, 1), np.float32)
        fit(costs, labels, everywhere(labels), found)
        assert found[0, 0] == pytest.approx(true, abs=largest_error_px)


def test_the_fit_leaves_what_it_may_not_move_and_what_has_no_neighbours():
    costs = np.array([[[5, 9, 30], [30, 2, 9], [9, 30, 8], [30, 2, 9]]], np.uint16)
    labels = np.array([[0, 1, 2, 1]], np.int32)
    found = np.empty((1, 4), np.float32)
    fit(costs, labels, np.array([[True, False, True, True]]), found)
    np.testing.assert_array_equal(found[0, :3], [0, 1, 2])
    assert 1 < found[0, 3] < 1.5


def test_a_slant_stays_as_it_is_when_it_is_evened():
    plane = (0.3 * np.arange(20) + 0.1 * np.arange(12)[:, None] + 5).astype(np.float32)
    np.testing.assert_allclose(smoothed(plane, np.full(plane.shape, 90, np.uint8)), plane, atol=1e-5)


def test_evening_takes_noise_off_but_not_across_an_edge_of_depth():
    rng = np.random.default_rng(15)
    truth = np.where(np.arange(40) < 20, 5.0, 9.0) * np.ones((30, 1))
    noisy = (truth + rng.normal(0, 0.1, truth.shape)).astype(np.float32)
    evened = smoothed(noisy, np.full(truth.shape, 90, np.uint8))
    assert np.std(evened - truth) < 0.5 * np.std(noisy - truth)
    assert np.abs(evened - truth).max() < 0.5


def test_evening_follows_the_image():
    """Of two surfaces closer than the step, one dark and one bright, each keeps its disparity."""
    truth = np.where(np.arange(40) < 20, 5.0, 5.8) * np.ones((30, 1), np.float32)
    grey = np.where(np.arange(40) < 20, 30, 220).astype(np.uint8) * np.ones((30, 1), np.uint8)
    np.testing.assert_allclose(smoothed(truth.astype(np.float32), grey), truth, atol=0.01)


def median_twin(labels, grey, reach, scales):
    """(H, W) weighted medians: the first label with half of the weight of the window up to it."""
    found = np.empty_like(labels)
    for y, x in np.ndindex(*labels.shape):
        v, u = (a.ravel() for a in np.mgrid[y - reach : y + reach + 1, x - reach : x + reach + 1])
        inside = (v >= 0) & (u >= 0) & (v < labels.shape[0]) & (u < labels.shape[1])
        v, u = v[inside], u[inside]
        change = np.abs(grey[v, u].astype(int) - int(grey[y, x]))
        weight = np.exp(-change / scales[0] - (np.abs(v - y) + np.abs(u - x)) / scales[1])
        order = np.argsort(labels[v, u], kind="stable")
        half = np.searchsorted(np.cumsum(weight[order]), weight.sum() / 2)
        found[y, x] = labels[v, u][order][half]
    return found


def test_labels_far_from_the_weighted_median_become_it():
    labels = np.random.default_rng(17).integers(0, 9, (15, 20)).astype(np.int32)
    grey, before = grey_image(18, (15, 20)) // 8, labels.copy()
    medians = median_twin(labels, grey, 4, (8.0, 3.0))
    replaced = straighten(labels, grey, 9, 1)
    np.testing.assert_array_equal(replaced, np.abs(medians - before) > 1)
    np.testing.assert_array_equal(labels, np.where(replaced, medians, before))
    assert 0.1 < replaced.mean() < 0.9


def test_an_edge_of_depth_moves_to_the_edge_of_the_image():
    grey = np.where(np.arange(30) < 15, 40, 200).astype(np.uint8) * np.ones((20, 1), np.uint8)
    labels = np.where(np.arange(30) < 16, 3, 9).astype(np.int32) * np.ones((20, 1), np.int32)
    straighten(labels, grey, 10, 1)
    np.testing.assert_array_equal(labels, np.where(np.arange(30) < 15, 3, 9) * np.ones((20, 1)))


def test_a_slant_has_no_edges_to_straighten():
    labels = (np.arange(30) // 9 + np.zeros((20, 1))).astype(np.int32)
    assert not straighten(labels, grey_image(19, (20, 30)), 10, 1).any()
