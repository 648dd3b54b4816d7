import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.scoring import bound_coverage, reliability_table
from stereogrid.scoring.calibration import (
    CLIP,
    calibration_scores,
    covered,
    entropy_bit,
    in_sigmas,
    log_loss,
    stretch,
)

SEEDS = st.integers(0, 2**32 - 1)


def calibrated_sample(seed=0, n=200_000):
    rng = np.random.default_rng(seed)
    p = rng.random(n)
    return p, rng.random(n) < p


@given(st.floats(0, 1), st.integers(1, 50), st.integers(1, 50))
@settings(deadline=None)
def test_the_balanced_brier_score_of_a_constant_does_not_depend_on_the_classes(p, n_occupied, n_free):
    occupied = np.arange(n_occupied + n_free) < n_occupied
    scores = calibration_scores(np.full(len(occupied), p), occupied)
    assert scores["brier_balanced"] == pytest.approx(((1 - p) ** 2 + p**2) / 2)
    assert scores["brier"] == pytest.approx((n_occupied * (1 - p) ** 2 + n_free * p**2) / len(occupied))


@pytest.mark.parametrize("equal_count", [False, True])
def test_a_calibrated_sample_has_almost_no_calibration_error(equal_count):
    assert reliability_table(*calibrated_sample(), equal_count=equal_count).expected_error < 0.005


@pytest.mark.parametrize("name", ["ece_width", "ece_count"])
def test_an_overconfident_sample_has_a_large_calibration_error(name):
    p, occupied = calibrated_sample()
    assert calibration_scores(np.where(p > 0.5, 0.99, 0.01), occupied)[name] == pytest.approx(0.24, abs=0.01)


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_the_table_does_not_depend_on_the_order_of_the_cells(seed):
    rng = np.random.default_rng(seed)
    p = rng.choice([0.12, 0.3, 0.5, 0.97], 300)
    occupied, order = rng.random(300) < 0.4, rng.permutation(300)
    for equal_count in (False, True):
        one = reliability_table(p, occupied, equal_count=equal_count)
        other = reliability_table(p[order], occupied[order], equal_count=equal_count)
        assert np.array_equal(one.count, other.count)
        assert np.allclose(one.frequency, other.frequency, equal_nan=True)


@given(SEEDS, st.booleans())
@settings(max_examples=30, deadline=None)
def test_every_cell_is_in_one_bin_whose_edges_hold_it(seed, equal_count):
    p, occupied = calibrated_sample(seed, 500)
    p[:3] = 0, 0.3, 1
    table = reliability_table(p, occupied, equal_count=equal_count)
    full = table.count > 0
    assert table.count.sum() == 500
    assert (table.mean_p[full] * table.count[full]).sum() == pytest.approx(p.sum())
    assert (table.frequency[full] * table.count[full]).sum() == pytest.approx(occupied.sum())
    assert (table.edges[:-1][full] <= table.mean_p[full]).all() and (table.mean_p[full] <= table.edges[1:][full]).all()


def test_bins_of_equal_count_hold_a_tenth_each():
    assert np.abs(reliability_table(*calibrated_sample(n=1000), equal_count=True).count - 100).max() <= 1


def test_a_probability_on_an_edge_belongs_to_the_bin_below():
    table = reliability_table(np.array([0.0, 0.5, 1.0]), np.array([False, True, True]))
    assert np.flatnonzero(table.count).tolist() == [0, 4, 9]


def test_an_empty_bin_is_missing_and_not_zero():
    table = reliability_table(np.array([0.05, 0.95]), np.array([False, True]))
    assert np.isnan(table.mean_p[1:9]).all() and np.isnan(table.frequency[1:9]).all()


def test_the_log_loss_of_a_certain_error_is_clipped():
    loss = log_loss(np.array([0.0, 1.0, 0.0, 1.0]), np.array([True, False, False, True]))
    assert loss == pytest.approx([-np.log(CLIP), -np.log(CLIP), 0, 0], abs=2e-6)


def test_entropy_is_one_bit_at_one_half_and_none_at_certainty():
    assert entropy_bit(np.array([0.5, 0.0, 1.0, 0.11])) == pytest.approx([1, 0, 0, 0.49992], abs=1e-5)


def test_without_cells_nothing_is_calibrated():
    assert all(np.isnan(v) for v in calibration_scores(np.empty(0), np.empty(0, bool)).values())


def test_one_label_short_is_refused():
    with pytest.raises(InvalidInputError, match="label"):
        reliability_table(np.array([0.1, 0.2]), np.array([True]))


def test_gaussian_errors_are_within_the_bound_as_often_as_it_says():
    rng = np.random.default_rng(0)
    true_m, sigma_m = rng.uniform(1, 5, 100_000), rng.uniform(0.01, 0.2, 100_000)
    score = bound_coverage(true_m, true_m + rng.normal(0, sigma_m), sigma_m)
    assert score.value == pytest.approx(0.95, abs=0.003)
    assert (score.n, score.unit) == (100_000, "1")


def test_hits_without_a_range_are_left_out_of_the_bound():
    score = bound_coverage(np.array([1, 1, np.nan]), np.array([1.1, 2, 1]), np.array([0.1, 0.1, 0.1]))
    assert (score.value, score.n) == (0.5, 2)
    assert np.isnan(bound_coverage(np.array([np.nan]), np.ones(1), np.ones(1)).value)


def test_the_stretch_of_a_bound_is_what_would_make_it_right():
    sigmas = np.abs(np.random.default_rng(0).normal(size=100_000))
    assert stretch(3 * sigmas) == pytest.approx(3, abs=0.03)
    assert covered(3 * sigmas / stretch(3 * sigmas))[0] == pytest.approx(0.95, abs=1e-4)
    assert stretch(np.append(sigmas, np.nan)) == stretch(sigmas)
    assert np.isnan(stretch(np.empty(0)))
    assert np.isnan(stretch(np.array([1.0, np.inf]))), "no factor covers an error without a bound"


def test_no_error_where_none_is_claimed_says_nothing_and_an_error_there_has_no_bound():
    sigmas = in_sigmas(np.array([0.0, -1.0, -3.0]), np.array([0.0, 0.0, 2.0]))
    np.testing.assert_equal(sigmas, [np.nan, np.inf, 1.5])
    assert covered(sigmas) == (0.5, 2)


def test_ranges_of_different_shapes_are_refused():
    with pytest.raises(InvalidInputError, match="one shape"):
        bound_coverage(np.ones(3), np.ones(3), np.ones(2))
