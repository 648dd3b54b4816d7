import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu

from stereogrid.scoring.ranking import auc, average_precision, ranking_scores

SEEDS = st.integers(0, 2**32 - 1)


def tied_sample(seed, n=200):
    rng = np.random.default_rng(seed)
    occupied = rng.random(n) < 0.3
    occupied[:2] = True, False
    return np.round(np.clip(rng.normal(0.4 + 0.2 * occupied, 0.2), 0, 1), 1), occupied


@given(SEEDS)
@settings(max_examples=50, deadline=None)
def test_auc_is_the_mann_whitney_statistic_with_ties(seed):
    p, occupied = tied_sample(seed)
    u = mannwhitneyu(p[occupied], p[~occupied]).statistic
    assert auc(p, occupied) == pytest.approx(u / (occupied.sum() * (~occupied).sum()))


@given(SEEDS)
@settings(max_examples=50, deadline=None)
def test_ranks_do_not_change_under_a_monotone_transform_or_another_order(seed):
    p, occupied = tied_sample(seed)
    order = np.random.default_rng(seed).permutation(len(p))
    for score in (auc, average_precision):
        assert score(p**3 / 2, occupied) == pytest.approx(score(p, occupied))
        assert score(p[order], occupied[order]) == pytest.approx(score(p, occupied))


@given(SEEDS)
@settings(max_examples=50, deadline=None)
def test_average_precision_is_the_sum_over_thresholds(seed):
    p, occupied = tied_sample(seed)
    expected, recall_before = 0.0, 0.0
    for threshold in np.unique(p)[::-1]:
        called = p >= threshold
        recall = occupied[called].sum() / occupied.sum()
        expected += (recall - recall_before) * occupied[called].mean()
        recall_before = recall
    assert average_precision(p, occupied) == pytest.approx(expected)


@given(SEEDS)
@settings(max_examples=50, deadline=None)
def test_reversed_probabilities_reverse_the_auc(seed):
    p, occupied = tied_sample(seed)
    assert auc(1 - p, occupied) == pytest.approx(1 - auc(p, occupied))


def test_counts_at_one_half_are_those_on_paper():
    p = np.array([0.9, 0.8, 0.7, 0.5, 0.3, 0.2])
    occupied = np.array([True, False, True, True, False, False])
    scores = ranking_scores(p, occupied)
    assert scores["occupied_precision"] == pytest.approx(2 / 3)
    assert scores["occupied_recall"] == pytest.approx(2 / 3)
    assert scores["occupied_f1"] == pytest.approx(2 / 3)
    assert scores["occupied_iou"] == pytest.approx(2 / 4)
    assert scores["cell_accuracy"] == pytest.approx(4 / 6)


def test_p_of_exactly_one_half_is_not_called_occupied():
    scores = ranking_scores(np.full(4, 0.5), np.array([True, False, False, False]))
    assert (scores["auc"], scores["occupied_recall"]) == (0.5, 0.0)


def test_without_cells_or_with_one_class_nothing_is_ranked():
    assert all(np.isnan(value) for value in ranking_scores(np.empty(0), np.empty(0, bool)).values())
    assert np.isnan(auc(np.array([0.1, 0.9]), np.array([True, True])))
    assert np.isnan(average_precision(np.array([0.1, 0.9]), np.array([False, False])))
