"""The packed state of a cell: log-odds add up, updates are counted, and two halves make the whole."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.grid.blocks import CELLS
from stereogrid.grid.cells import LARGEST_EVIDENCE, NOTHING, OCTOMAP_CLAMP, ONE, LogOddsCells, to_evidence

RULES = [LogOddsCells(0.5), LogOddsCells(0.3, OCTOMAP_CLAMP), LogOddsCells(0.5, None)]
evidences = st.integers(0, 2**32 - 1).map(
    lambda seed: np.random.default_rng(seed).choice(
        [NOTHING, -LARGEST_EVIDENCE, LARGEST_EVIDENCE, *range(-400, 400)],
        (5, 3, CELLS),
        p=[0.3, 0.01, 0.01] + [0.68 / 800] * 800,
    )
)


def fused(rule, observations, words=None):
    words = np.zeros((4, CELLS), rule.dtype) if words is None else words
    rows = np.array([2, 0, 3])
    for evidence in observations:
        rule.fuse(words, rows, evidence.astype(np.int16))
    return words


def added(rule, observations):
    """The twin: log-odds in units of 1 / ONE, and counts, cell by cell of blocks 2, 0 and 3."""
    low, high = rule._rule[1:]
    value, count = np.zeros((3, CELLS), np.int64), np.zeros((3, CELLS), np.int64)
    for evidence in observations:
        seen = evidence != NOTHING
        value = np.where(seen, np.clip(value + evidence, low, high), value)
        count += seen
    return value, count


@pytest.mark.parametrize("rule", RULES)
@given(evidence=evidences)
@settings(max_examples=10, deadline=None, derandomize=True)
def test_fusing_agrees_with_its_twin_to_the_last_bit(rule, evidence):
    words = fused(rule, evidence)
    value, count = added(rule, evidence)
    found = words[[2, 0, 3]]
    np.testing.assert_array_equal(rule.n_updates(found), count)
    np.testing.assert_allclose(rule.log_odds(found), value / ONE + rule.prior_log_odds, rtol=1e-6)
    assert not words[1].any()


@pytest.mark.parametrize("rule", RULES)
@given(evidence=evidences)
@settings(max_examples=6, deadline=None, derandomize=True)
def test_a_whole_block_is_fused_like_its_cells(rule, evidence):
    whole, single = fused(rule, evidence), fused(rule, evidence)
    rows, gains = np.array([1, 2]), np.array([-217, 120], np.int16)
    rule.fuse_whole(whole, rows, gains)
    rule.fuse(single, rows, np.repeat(gains[:, None], CELLS, axis=1))
    np.testing.assert_array_equal(whole, single)


@given(evidence=evidences, at=st.integers(0, 5), order=st.permutations(range(5)))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_without_a_clamp_neither_order_nor_halves_matter(evidence, at, order):
    rule = LogOddsCells(0.5, None)
    whole = fused(rule, evidence)
    np.testing.assert_array_equal(whole, fused(rule, evidence[order]))
    np.testing.assert_array_equal(whole, rule.merged(fused(rule, evidence[:at]), fused(rule, evidence[at:])))


@given(one=evidences, other=evidences)
@settings(max_examples=6, deadline=None, derandomize=True)
def test_merging_is_the_same_either_way_and_with_nothing_changes_nothing(one, other):
    for rule in RULES:
        a, b = fused(rule, one), fused(rule, other)
        np.testing.assert_array_equal(rule.merged(a, b), rule.merged(b, a))
        np.testing.assert_array_equal(rule.merged(a, np.zeros_like(a)), a)


def test_without_a_clamp_ten_thousand_observations_of_the_largest_evidence_still_count():
    rule = LogOddsCells(0.5, None)
    words = np.zeros((1, CELLS), rule.dtype)
    for _ in range(10_000):
        rule.fuse(words, np.array([0]), np.full((1, CELLS), -LARGEST_EVIDENCE, np.int16))
    assert rule.log_odds(words)[0, 0] == pytest.approx(-10_000 * LARGEST_EVIDENCE / ONE)
    assert rule.n_updates(words)[0, 0] == 10_000


@pytest.mark.parametrize("rule", RULES)
def test_the_count_stops_at_its_largest_value_and_never_reaches_the_log_odds(rule):
    words = np.full((1, CELLS), (1 << rule.count_bits) - 1, rule.dtype)
    rule.fuse(words, np.array([0]), np.zeros((1, CELLS), np.int16))
    assert (rule.n_updates(words) == (1 << rule.count_bits) - 1).all()
    assert (rule.log_odds(words) == np.float32(rule.prior_log_odds)).all()


@pytest.mark.parametrize("rule", RULES)
@given(value=st.floats(-30, 30), count=st.integers(0, 5000))
@settings(max_examples=40, derandomize=True)
def test_what_is_packed_comes_back_rounded_and_clamped(rule, value, count):
    word = rule.pack(value, count)
    assert rule.n_updates(word) == min(count, (1 << rule.count_bits) - 1)
    low, high = rule.clamp or (-np.inf, np.inf)
    expected = np.clip(value, low, high) if count else rule.prior_log_odds
    assert float(rule.log_odds(word)) == pytest.approx(expected, abs=0.6 / ONE)


def test_evidence_is_rounded_cut_off_and_missing_where_it_is_nan():
    gain = np.array([np.nan, 0.0, 1.0, -0.85, 1e9, -1e9])
    expected = [NOTHING, 0, ONE, round(-0.85 * ONE), LARGEST_EVIDENCE, -LARGEST_EVIDENCE]
    np.testing.assert_array_equal(to_evidence(gain), expected)


@pytest.mark.parametrize("clamp", [(2.0, 1.0), (-1.0, -0.5), (0.5, 1.0), (np.nan, 1.0), (-np.inf, 4.0), (-4.0, 1e9)])
def test_a_clamp_that_does_not_hold_the_prior_is_refused(clamp):
    with pytest.raises(InvalidInputError, match="clamp"):
        LogOddsCells(0.5, clamp)
