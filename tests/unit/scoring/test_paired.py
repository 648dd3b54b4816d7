"""Differences between arms, and how sure of them one may be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.scoring import paired
from stereogrid.scoring.paired import bootstrap_mean, hierarchical_mean, holm, paired_difference, sign_flip_p

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


def worlds(effects, n=20, seed=0):
    random = rng(seed)
    return [effect + random.normal(size=n) for effect in effects]


def shares_held(monkeypatch, spread, *, count=3, n=20, trials=400):
    """How often both intervals hold: the mean of the very worlds that were drawn, and of all there could be."""
    monkeypatch.setattr(paired, "RESAMPLES", 1000)
    draws, random = rng(1), rng(2)
    these = others = of_all = 0
    for _ in range(trials):
        effects = draws.normal(0, spread, count)
        found = hierarchical_mean([effect + draws.normal(size=n) for effect in effects], rng=random)
        these += found.these_worlds.low <= effects.mean() <= found.these_worlds.high
        of_all += found.these_worlds.low <= 0 <= found.these_worlds.high
        others += found.other_worlds.low <= 0 <= found.other_worlds.high
    return np.array([these, others, of_all]) / trials


@pytest.mark.parametrize("n", [4, 20])
def test_over_worlds_that_do_not_differ_both_intervals_hold_as_often_as_they_say(monkeypatch, n):
    these, others, _ = shares_held(monkeypatch, 0.0, n=n)
    assert 0.91 <= these <= 0.975
    assert 0.94 <= others <= 0.998


@pytest.mark.parametrize("count", [3, 6])
def test_over_worlds_that_differ_only_the_interval_of_other_worlds_holds_for_them(monkeypatch, count):
    these, others, of_all = shares_held(monkeypatch, 1.0, count=count)
    assert 0.92 <= these <= 0.98
    assert 0.92 <= others <= 0.98
    assert of_all < 0.6


def test_each_world_counts_the_same_however_many_seeds_it_has():
    found = hierarchical_mean([[1.0, 1.0], [4.0] * 30, [NAN]], rng=rng())
    assert (found.mean, found.these_worlds.n, found.other_worlds.n) == (2.5, 32, 2)
    assert found.these_worlds.low == found.these_worlds.high == pytest.approx(2.5)
    assert found.other_worlds.low < 1 and found.other_worlds.high > 4


def test_one_world_has_the_interval_of_its_seeds_and_none_of_other_worlds():
    values = rng(3).normal(size=12)
    found, plain = hierarchical_mean([values], rng=rng()), bootstrap_mean(values, rng=rng())
    assert [found.these_worlds.low, found.these_worlds.high] == pytest.approx([plain.low, plain.high], abs=0.05)
    np.testing.assert_equal([found.other_worlds.low, found.other_worlds.high], [NAN, NAN])


def test_one_seed_a_world_tells_nothing_of_other_seeds_but_of_other_worlds():
    found = hierarchical_mean([[1.0], [2.0], [3.0]], rng=rng())
    np.testing.assert_equal([found.these_worlds.low, found.these_worlds.high], [NAN, NAN])
    # Student's t with two degrees of freedom: 4.303 / sqrt 3 on either side.
    assert [found.other_worlds.low, found.other_worlds.high] == pytest.approx([2 - 2.4841, 2 + 2.4841], abs=1e-3)


def test_worlds_without_values_have_no_mean():
    found = hierarchical_mean([[], [NAN]], rng=rng())
    np.testing.assert_equal([found.mean, found.these_worlds.low, found.other_worlds.high], 3 * [NAN])
    assert np.isnan(sign_flip_p([[], [NAN]], rng=rng()))


def test_undefined_seeds_are_left_out_of_worlds():
    values = worlds([0.0, 1.0])
    holed = [np.append(world, NAN) for world in values]
    assert hierarchical_mean(holed, rng=rng()) == hierarchical_mean(values, rng=rng())
    assert sign_flip_p(holed, rng=rng()) == sign_flip_p(values, rng=rng())


def test_means_over_worlds_are_the_same_with_the_same_seed_and_turn_with_the_sign():
    values = worlds([0.0, 1.0, -0.5])
    found, again = (hierarchical_mean(values, rng=rng(5)) for _ in range(2))
    assert found == again
    turned = hierarchical_mean([-world for world in values], rng=rng(5))
    for name in ("these_worlds", "other_worlds"):
        here, there = getattr(found, name), getattr(turned, name)
        assert [there.low, there.high] == pytest.approx([-here.high, -here.low])


def test_signs_of_a_few_units_are_all_tried():
    """Of 1, 2 and 4 only two of the 8 choices of signs, all + and all -, are as far from 0 as 7; and none is nearer
    than 1 + 2 - 4."""
    assert sign_flip_p([[1.0, 2.0, 4.0]], rng=rng()) == 0.25
    assert sign_flip_p([[1.0, 2.0, -4.0]], rng=rng()) == 1
    assert sign_flip_p([[1.0, 2.0], [4.0]], rng=rng()) == 0.25
    assert sign_flip_p([np.zeros(5)], rng=rng()) == 1


def test_p_is_uniform_where_nothing_differs(monkeypatch):
    monkeypatch.setattr(paired, "RESAMPLES", 500)
    draws, random = rng(1), rng(2)
    p = np.array([sign_flip_p(draws.normal(size=(3, 10)), rng=random) for _ in range(1000)])
    for level in (0.05, 0.2, 0.5, 0.8):
        assert np.mean(p <= level) == pytest.approx(level, abs=3.5 * np.sqrt(level * (1 - level) / 1000))


def test_p_is_small_where_the_arms_differ_and_agrees_with_all_choices():
    assert sign_flip_p(worlds([0.8, 1.0, 1.2]), rng=rng()) == pytest.approx(1e-4, rel=0.01)
    values = worlds([0.3], n=13, seed=4)
    exact = sign_flip_p(values, rng=rng())
    signs = rng(6).choice([-1, 1], size=(200_000, 13))
    assert exact == pytest.approx(np.mean(np.abs(signs @ values[0]) >= abs(values[0].sum())), abs=0.005)


def test_holm_known_value():
    """.01, .04, .03, .005: sorted .005 .01 .03 .04, times 4 3 2 1 = .02 .03 .06 .04, and never less than before."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, NAN, 0.5]) == pytest.approx([1.0, NAN, 1.0], nan_ok=True)
    assert len(holm([])) == 0


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_keeps_the_order_never_lowers_p_and_never_exceeds_bonferroni(values):
    p = np.array(values)
    adjusted = holm(p)
    assert (adjusted >= p).all() and (adjusted <= np.minimum(len(p) * p, 1) + 1e-15).all()
    assert (np.diff(adjusted[np.argsort(p, kind="stable")]) >= 0).all()
    np.testing.assert_array_equal(holm(p[::-1]), adjusted[::-1])


@pytest.mark.parametrize("p", [[0.5, 1.1], [-0.1], [[0.1]], 0.1])
def test_p_values_that_are_none_are_refused(p):
    with pytest.raises(InvalidInputError, match="p values"):
        holm(p)


def test_a_world_must_be_a_row_of_values():
    with pytest.raises(InvalidInputError, match="values of a world"):
        hierarchical_mean([[[1.0, 2.0]]], rng=rng())
    with pytest.raises(InvalidInputError, match="level"):
        hierarchical_mean([[1.0, 2.0]], rng=rng(), level=2)
