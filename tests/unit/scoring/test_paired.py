"""Differences between arms, and how sure of them one may be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.scoring.paired import bootstrap_mean, paired_difference

NAN = np.nan
samples = st.lists(st.floats(-10, 10), min_size=2, max_size=8)


def rng(seed=0):
    return np.random.default_rng(seed)


@pytest.mark.parametrize(("n", "at_least"), [(5, 0.89), (20, 0.93)])
def test_the_interval_holds_the_true_mean_about_as_often_as_it_says(n, at_least):
    draws, random = rng(1), rng(2)
    trials = 500
    held = 0
    for _ in range(trials):
        interval = bootstrap_mean(draws.normal(3.0, 1.0, n), rng=random)
        held += interval.low <= 3.0 <= interval.high
    assert at_least <= held / trials <= 0.98


def test_a_lower_level_holds_it_less_often():
    values = rng(3).normal(size=10)
    wide, narrow = (bootstrap_mean(values, rng=rng(), level=level) for level in (0.95, 0.5))
    assert wide.low < narrow.low < narrow.mean < narrow.high < wide.high


@given(samples)
def test_swapping_the_arms_swaps_the_sign_and_nothing_else(values):
    arm, reference = np.array(values), np.arange(len(values), dtype=float)
    there, back = (paired_difference(a, b, rng=rng()) for a, b in ((arm, reference), (reference, arm)))
    np.testing.assert_allclose([back.mean, back.low, back.high], [-there.mean, -there.high, -there.low], atol=1e-9)


@given(samples, st.floats(-100, 100))
def test_what_both_arms_share_drops_out(values, shared):
    arm, reference = np.array(values), np.zeros(len(values))
    alone, together = (paired_difference(arm + each, reference + each, rng=rng()) for each in (0.0, shared))
    np.testing.assert_allclose(
        [together.mean, together.low, together.high], [alone.mean, alone.low, alone.high], atol=1e-9
    )


@given(samples)
def test_the_interval_lies_around_the_mean_and_within_the_values(values):
    interval = bootstrap_mean(values, rng=rng())
    assert min(values) - 1e-9 <= interval.low <= interval.mean + 1e-9
    assert interval.mean - 1e-9 <= interval.high <= max(values) + 1e-9
    assert interval.mean == pytest.approx(np.mean(values)) and interval.n == len(values)


def test_the_same_seed_gives_the_same_interval_and_another_seed_nearly():
    values = rng(4).normal(size=12)
    first, again, other = (bootstrap_mean(values, rng=rng(seed)) for seed in (5, 5, 6))
    assert first == again
    assert first != other
    assert other.low == pytest.approx(first.low, abs=0.1)


def test_more_units_give_a_narrower_interval():
    values = rng(7).normal(size=100)
    few, many = bootstrap_mean(values[:10], rng=rng()), bootstrap_mean(values, rng=rng())
    assert many.high - many.low < 0.6 * (few.high - few.low)


def test_a_unit_that_is_undefined_in_either_arm_is_left_out_of_both():
    interval = paired_difference([1.0, NAN, 3.0, 4.0], [0.0, 5.0, NAN, 2.0], rng=rng())
    assert (interval.mean, interval.n) == (1.5, 2)


@pytest.mark.parametrize(("values", "mean"), [([], NAN), ([NAN], NAN), ([2.0], 2.0)])
def test_fewer_than_two_units_have_no_interval(values, mean):
    interval = bootstrap_mean(values, rng=rng())
    np.testing.assert_equal([interval.mean, interval.low, interval.high], [mean, NAN, NAN])


@pytest.mark.parametrize(("arm", "reference"), [([1.0, 2.0], [1.0]), ([[1.0, 2.0]], [[1.0, 2.0]]), (1.0, 2.0)])
def test_values_that_do_not_pair_are_refused(arm, reference):
    with pytest.raises(InvalidInputError, match="paired values"):
        paired_difference(arm, reference, rng=rng())


@pytest.mark.parametrize("level", [0.0, 1.0, 95.0, NAN])
def test_a_level_that_is_no_share_is_refused(level):
    with pytest.raises(InvalidInputError, match="level"):
        bootstrap_mean([1.0, 2.0], rng=rng(), level=level)
