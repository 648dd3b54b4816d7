"""The order of kz2's moves as a whole: energies that only fall, labels that stay valid, the same bits every time."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from stereogrid.matching.kz2 import KolmogorovZabihMatcher, solve
from stereogrid.matching.kz2.cost import energy_of_pair
from stereogrid.matching.kz2.energy import total_energy
from stereogrid.matching.kz2.moves import UNMATCHED
from stereogrid.matching.kz2.solve import LEAST_SPLIT_ROWS, Search, minimise, offer
from stereogrid.matching.kz2.start import _make_unique, good_start
from stereogrid.matching.maxflow import empty_graph

COUNT = 12


def scene(seed, shape=(48, 90), grain_px=1.0):
    """A textured square of disparity 8 before a wall of disparity 3, with noise: (left, right) (H, W) uint8."""
    rng = np.random.default_rng(seed)
    wall, near = (cv2.GaussianBlur(rng.normal(size=(shape[0], shape[1] + COUNT)), (0, 0), grain_px) for _ in range(2))
    width, rows = shape[1], slice(shape[0] // 4, 3 * shape[0] // 4)
    left, right = wall[:, :width].copy(), wall[:, 3 : width + 3].copy()
    left[rows, 40:65], right[rows, 32:57] = near[rows, 40:65], near[rows, 40:65]
    noisy = (128 + 40 * i / wall.std() + rng.normal(0, 3, shape) for i in (left, right))
    return tuple(np.clip(np.rint(i), 0, 255).astype(np.uint8) for i in noisy)


def problem(seed, shape=(48, 90)):
    return energy_of_pair(*scene(seed, shape), COUNT)[0]


def nothing(energy):
    return np.full(energy.cost.shape[1:], UNMATCHED, np.int16)


def assert_valid(label):
    """Labels in range, matches inside the right image, and no right pixel twice."""
    assert label.dtype == np.int16
    assert label.min() >= UNMATCHED
    assert label.max() < COUNT
    row, column = np.nonzero(label >= 0)
    matched = column - label[row, column]
    assert (matched >= 0).all()
    assert np.unique(row * label.shape[1] + matched).size == matched.size


def assert_consistent(energy, labels):
    assert_valid(labels.label)
    row, column = np.nonzero(labels.label >= 0)
    d = labels.label[row, column]
    owner = np.full(labels.label.shape, UNMATCHED)
    owner[row, column - d] = column
    np.testing.assert_array_equal(labels.owner, owner)
    np.testing.assert_array_equal(labels.cost[row, column], energy.cost[d, row, column])


@pytest.mark.parametrize("seed", range(4))
def test_the_start_is_a_valid_labelling_better_than_none_and_than_the_cheapest_matches(seed):
    energy = problem(seed)
    start = good_start(energy)
    assert_valid(start)
    cheapest = energy.cost.argmin(axis=0).astype(np.int16)
    assert total_energy(energy, start) < min(0, total_energy(energy, cheapest))


@pytest.mark.parametrize("shape", [(48, 90), (20, 90)])
@pytest.mark.parametrize("begin", [good_start, nothing])
def test_no_move_of_a_run_raises_the_energy_and_each_lowers_it_by_what_it_says(monkeypatch, begin, shape):
    energy, lock, moves = problem(5, shape), threading.Lock(), []

    def watched(of, labels, offer, tools):
        with lock:
            before = total_energy(of, labels.label)
            gain, steps = make_move(of, labels, offer, tools)
            alike, own = len(np.unique(offer[0][offer[0] >= 0])) <= 1, labels.label[offer[1] :][: len(offer[0])]
            assert alike or not ((offer[0] == own) & (own >= 0)).any()
            moves.append((alike, int(gain), int(before - total_energy(of, labels.label))))
            assert_consistent(of, labels)
        return gain, steps

    make_move = solve.make_move
    monkeypatch.setattr(solve, "make_move", watched)
    start = begin(energy)
    search = minimise(energy, start)
    assert all(0 <= gain <= fell for _, gain, fell in moves)
    assert all(gain == fell for alike, gain, fell in moves if alike)
    assert sum(fell > 0 for *_, fell in moves) >= 3
    assert sum(not alike for alike, *_ in moves) <= 1
    assert total_energy(energy, start) - sum(search.gains) == total_energy(energy, search.labels.label)


def test_a_search_leaves_its_start_as_it_is():
    energy = problem(6)
    start = nothing(energy)
    found = minimise(energy, start).labels.label
    assert (start == UNMATCHED).all()
    assert np.mean(found >= 0) > 0.8


def test_a_label_is_offered_to_its_region_alone():
    energy = problem(13)
    search, region = Search.of(energy, nothing(energy)), np.zeros((30, 90), np.uint8)
    region[5:9, 20:50] = 1
    gain, steps = solve._expand(search, region, (10, 3), (empty_graph(30, 90, 2), 1, True))
    assert gain > 0 < steps
    row, column = np.nonzero(search.labels.label == 3)
    assert (row.min(), row.max()) == (15, 18)
    assert 20 <= column.min() < column.max() < 50
    assert (search.labels.label[search.labels.label != 3] == UNMATCHED).all()


def test_of_two_first_matches_of_a_right_pixel_the_nearer_stays():
    label = np.array([0, 1, 0, 1, 3, UNMATCHED, 2], np.int16)
    _make_unique(label)
    np.testing.assert_array_equal(label, [UNMATCHED, 1, UNMATCHED, 1, 3, UNMATCHED, 2])
    label = np.array([0, 0, 1, 3], np.int16)
    _make_unique(label)
    np.testing.assert_array_equal(label, [UNMATCHED, UNMATCHED, 1, 3])


@pytest.mark.parametrize("rows", [LEAST_SPLIT_ROWS - 1, LEAST_SPLIT_ROWS, 48])
def test_every_row_has_its_turn_the_one_between_the_parts_too(rows):
    energy = problem(7, (rows, 90))
    found = minimise(energy, nothing(energy)).labels.label
    assert np.mean(found >= 0, axis=1).min() > 0.6


@pytest.mark.parametrize("height", [1, 2, 7, 8, 9, 33, 34, 40])
def test_an_image_may_be_low_and_have_all_its_texture_at_one_end(height):
    for seed in range(21, 24):
        rng = np.random.default_rng(seed)
        left, right = (np.full((height, 40), 100, np.uint8) for _ in range(2))
        left[0], right[0] = rng.integers(0, 256, (2, 40))
        for images in ((left, right), (left[::-1], right[::-1])):
            energy, _ = energy_of_pair(*images, COUNT)
            assert_valid(minimise(energy, good_start(energy)).labels.label)


def test_from_nothing_and_from_a_good_start_the_search_ends_nearly_as_low():
    for seed in range(3):
        energy = problem(seed)
        ends = [minimise(energy, start).labels.label for start in (nothing(energy), good_start(energy))]
        low, other = (int(total_energy(energy, label)) for label in ends)
        assert low == pytest.approx(other, rel=0.003)


def test_a_finished_search_is_offered_in_vain_what_it_has_or_what_is_worse():
    energy = problem(8)
    search = Search.of(energy, minimise(energy, good_start(energy)).labels.label)
    before = search.labels.label.copy()
    for other in (before, nothing(energy)):
        offer(search, other)
        np.testing.assert_array_equal(search.labels.label, before)
    assert search.gains == [0, 0]


def test_after_the_deadline_no_move_is_made():
    energy = problem(9)
    start = good_start(energy)
    search = minimise(energy, start, deadline_s=time.monotonic() - 1)
    assert search.gains == []
    np.testing.assert_array_equal(search.labels.label, start)


def test_a_run_that_is_stopped_half_way_has_a_valid_labelling_no_worse_than_its_start(monkeypatch):
    """By a clock of our own that ticks with each move. Near nothing, the first 24 have nothing to offer."""
    energy, clock = problem(10), iter(range(10**9))
    monkeypatch.setattr(solve, "time", type("Clock", (), {"monotonic": staticmethod(lambda: next(clock))}))
    ends = []
    for moves in (0, 40, 10**6):
        search = minimise(energy, nothing(energy), deadline_s=next(clock) + moves)
        assert_consistent(energy, search.labels)
        ends.append(int(total_energy(energy, search.labels.label)))
        assert ends[-1] == -sum(search.gains)
    assert 0 == ends[0] > ends[1] > ends[2]


def test_progress_rises_to_one():
    energy, shares = problem(11), []
    minimise(energy, good_start(energy), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[0] > 0
    assert shares[-1] == 1
    assert len(shares) >= 4


def test_two_runs_and_four_at_once_give_the_same_bits():
    left, right = scene(12)
    chosen = KolmogorovZabihMatcher(num_disparities=COUNT)
    (label, energy), again = chosen.labels(left, right), chosen.labels(left, right)
    np.testing.assert_array_equal(label, again[0])
    alone = chosen.match(left, right)
    with ThreadPoolExecutor(4) as threads:
        for found in threads.map(lambda _: chosen.labels(left, right), range(8)):
            np.testing.assert_array_equal(found[0], label)
            assert found[1] == energy
        for found in threads.map(lambda _: chosen.match(left, right), range(4)):
            np.testing.assert_array_equal(found.disparity_px, alone.disparity_px)
            np.testing.assert_array_equal(found.sigma_px, alone.sigma_px)
