"""The data cost of kz2 against a slow twin, its parameters against those of the published reference, and its edges."""

import numpy as np
import pytest

from experiments.pairs import open_pair
from stereogrid.matching.kz2.cost import NO_ASSIGNMENT, automatic_weights, data_cost, energy_of_pair, flat_edges

REFERENCE = {
    "tsukuba": (125, 75, 25, 9),
    "venus": (170, 102, 34, 15),
    "teddy": (1079, 647, 216, 16),
    "motorcycle": (1446, 867, 289, 14),
}


def random_images(seed, channels, shape=(5, 9), spread=60):
    """Two images (H, W) or (H, W, 3) whose differences lie on both sides of the cut-off."""
    rng = np.random.default_rng(seed)
    shape = shape if channels == 1 else (*shape, channels)
    return tuple(rng.integers(100, 100 + spread, shape, dtype=np.uint8) for _ in range(2))


def span(image, y, x):
    """The least and the largest, a channel, of a pixel and half way to its neighbours above, below and beside it."""
    height, width = image.shape[:2]
    own = [int(value) for value in np.atleast_1d(image[y, x])]
    around = [(y, x), (y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)]
    inside = [(v, u) for v, u in around if 0 <= v < height and 0 <= u < width]
    halves = [[(a + int(b)) // 2 for a, b in zip(own, np.atleast_1d(image[at]), strict=True)] for at in inside]
    return own, [min(channel) for channel in zip(*halves, strict=True)], [max(c) for c in zip(*halves, strict=True)]


def outside(value, lowest, highest):
    return lowest - value if value < lowest else value - highest if value > highest else 0


def cost_twin(left, right, count):
    height, width = left.shape[:2]
    cost = np.full((count, height, width), -1)
    for y, x in np.ndindex(height, width):
        for d in range(min(count, x + 1)):
            ours, theirs = (zip(*span(i, y, u), strict=True) for i, u in ((left, x), (right, x - d)))
            squares = [
                min(outside(a, b_low, b_high), outside(b, a_low, a_high), 30) ** 2
                for (a, a_low, a_high), (b, b_low, b_high) in zip(ours, theirs, strict=True)
            ]
            cost[d, y, x] = sum(squares) // len(squares)
    return cost


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("count", [1, 4, 9, 12])
def test_costs_are_those_of_the_slow_twin(count, channels):
    for seed in range(4):
        left, right = random_images(seed, channels)
        np.testing.assert_array_equal(data_cost(left, right, count), cost_twin(left, right, count))


@pytest.mark.parametrize("channels", [1, 3])
def test_what_the_right_image_does_not_show_has_no_cost_and_the_rest_0_to_900(channels):
    cost = data_cost(*random_images(7, channels, (8, 30), 156), 12)
    d, _, x = np.indices(cost.shape)
    np.testing.assert_array_equal(cost == -1, x < d)
    assert cost[x >= d].min() == 0
    assert cost.max() > 800
    assert data_cost(np.zeros((3, 4), np.uint8), np.full((3, 4), 255, np.uint8), 1).max() == 900


@pytest.mark.parametrize("channels", [1, 3])
def test_images_that_are_alike_match_at_no_cost_and_either_may_be_the_first(channels):
    left, right = random_images(8, channels)
    assert (data_cost(left, left, 3)[0] == 0).all()
    np.testing.assert_array_equal(data_cost(left, right, 1), data_cost(right, left, 1))


def test_half_a_pixel_costs_nothing_on_a_ramp():
    """What Birchfield and Tomasi made their difference for."""
    fine = np.arange(0, 200, 4) + 20
    left, right = (np.tile(each, (4, 1)).astype(np.uint8) for each in (fine[::2], fine[1::2]))
    assert (data_cost(left, right, 1)[0] == 0).all()


def test_three_equal_channels_cost_what_one_does():
    left, right = random_images(9, 1)
    in_colour = (np.stack([i] * 3, axis=2) for i in (left, right))
    np.testing.assert_array_equal(data_cost(*in_colour, 5), data_cost(left, right, 5))


@pytest.mark.parametrize("pair", REFERENCE)
def test_on_real_pairs_the_weights_are_those_of_the_reference(real_data, pair):
    opened = open_pair(real_data(f"stereo/{pair}"))
    found = automatic_weights(data_cost(opened.left, opened.right, opened.num_disparities))
    assert (found.occlusion, found.lambda1, found.lambda2, found.denominator) == REFERENCE[pair]


@pytest.mark.parametrize(("count", "rank"), [(1, 1), (2, 2), (3, 3), (9, 3), (14, 4), (16, 4), (18, 5), (20, 5)])
def test_k_is_the_mean_of_the_kth_smallest_cost_of_pixels_that_have_all(count, rank):
    data = np.random.default_rng(count).integers(1, 900, (count, 4, 40)).astype(np.int16)
    for d in range(count):
        data[d, :, :d] = -1
    found = automatic_weights(data)
    k = np.sort(data[:, :, count - 1 :], axis=0)[rank - 1].mean()
    # A fraction of a denominator up to 16 is within 1 / 32.
    assert found.occlusion / found.denominator == pytest.approx(k, abs=1 / 32)
    assert found.lambda1 / found.denominator == pytest.approx(0.6 * k, abs=1 / 2)
    assert found.lambda2 / found.denominator == pytest.approx(0.2 * k, abs=1 / 2)


def test_without_contrast_or_pixels_that_have_all_matches_the_weights_are_the_smallest():
    for data in (np.zeros((3, 4, 9), np.int16), data_cost(*random_images(3, 1, (5, 6)), 9)):
        found = automatic_weights(data)
        assert (found.occlusion, found.lambda1, found.lambda2, found.denominator) == (1, 1, 1, 16)


def test_an_edge_is_flat_where_no_channel_changes_by_8():
    image = np.full((3, 4, 3), 100, np.uint8)
    image[:, 2:, 1] = 107
    image[2, :, 2] = 92
    flat = flat_edges(image)
    expected = np.array([[5, 7, 7, 6], [9, 11, 11, 10], [1, 3, 3, 2]])  # right 1, left 2, below 4, above 8
    np.testing.assert_array_equal(flat, expected)
    image[:, 2:, 1] = 92
    np.testing.assert_array_equal(flat_edges(image) & 3, np.tile([1, 2, 1, 2], (3, 1)))


def test_the_energy_of_a_match_is_its_cost_less_what_an_unmatched_pixel_costs():
    left, right = random_images(10, 3, (5, 12), 156)
    data = data_cost(left, right, 4)
    energy, weights = energy_of_pair(left, right, 4)
    expected = weights.denominator * data.astype(int) - weights.occlusion
    np.testing.assert_array_equal(energy.cost, np.where(data < 0, NO_ASSIGNMENT, expected))
    assert (energy.lambda1, energy.lambda2) == (weights.lambda1, weights.lambda2)
