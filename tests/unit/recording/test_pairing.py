"""Pictures of two cameras that run freely are paired by their stamps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.recording.pairing import paired

MS = 1_000_000


def ns(*stamps_ms: float) -> np.ndarray:
    return (np.array(stamps_ms) * MS).astype(np.int64) + 1_700_000_000_000_000_000


def test_each_picture_goes_with_the_nearest_of_the_other_camera() -> None:
    assert paired(ns(0, 33, 66), ns(10, 43, 76)).tolist() == [[0, 0], [1, 1], [2, 2]]
    assert paired(ns(0, 33, 66), ns(-10, 23, 56)).tolist() == [[0, 0], [1, 1], [2, 2]]


def test_a_lost_picture_loses_its_pair_alone() -> None:
    assert paired(ns(0, 33, 66, 99), ns(5, 71, 104)).tolist() == [[0, 0], [2, 1], [3, 2]]
    assert paired(ns(0, 66, 99), ns(5, 38, 71, 104)).tolist() == [[0, 0], [1, 2], [2, 3]]


def test_pictures_of_different_moments_are_no_pair() -> None:
    """The left camera lost the second picture, the right one the first: what is left is a whole period apart."""
    assert paired(ns(0, 66, 99, 132), ns(33, 71, 104, 137)).tolist() == [[1, 1], [2, 2], [3, 3]]
    assert paired(ns(0), ns(51)).tolist() == [] and paired(ns(0), ns(49)).tolist() == [[0, 0]]


def test_the_bound_of_the_skew_can_be_chosen() -> None:
    lefts, rights = ns(0, 1000), ns(5, 1015)
    assert paired(lefts, rights, 0.01).tolist() == [[0, 0]]
    assert paired(lefts, rights, 0.02).tolist() == [[0, 0], [1, 1]]


stamps = st.lists(st.integers(0, 10**10), min_size=1, max_size=30, unique=True).map(
    lambda each: np.array(sorted(each), np.int64)
)


@given(lefts=stamps, rights=stamps)
def test_no_picture_is_in_two_pairs_and_none_would_have_been_nearer(lefts: np.ndarray, rights: np.ndarray) -> None:
    pairs = paired(lefts, rights, np.inf)
    assert len(pairs) >= 1
    assert (np.diff(pairs, axis=0) > 0).all()
    for left, right in pairs:
        apart = abs(int(lefts[left]) - int(rights[right]))
        assert apart == np.abs(rights - lefts[left]).min() == np.abs(lefts - rights[right]).min()


@pytest.mark.parametrize("late_ms", [-12, 0, 3, 12])
def test_swapping_the_cameras_swaps_the_pairs(late_ms: int) -> None:
    rng = np.random.default_rng(abs(late_ms))
    lefts = ns(*np.cumsum(rng.uniform(28, 38, 50)))
    rights = np.delete(lefts + late_ms * MS, rng.integers(0, 50, 10))
    there, back = paired(lefts, rights), paired(rights, lefts)
    assert len(there) == len(rights) and there[:, ::-1].tolist() == back.tolist()
