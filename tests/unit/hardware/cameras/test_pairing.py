"""Two clocks that nobody synchronises: which of their pictures are pairs."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.cameras.pairing import LEFT, MOST_WAITING, RIGHT, Pairing, SkewBound
from hardware.cameras.pairs import PairCounts
from stereogrid.errors import InvalidInputError

PERIOD_S = 1 / 30
FOCAL_PX = 320.0


@dataclass(frozen=True)
class Picture:
    side: int
    stamp_s: float


def pairing(max_skew_s: float = PERIOD_S / 2, turn_radps: float = 0.0) -> tuple[Pairing[Picture], PairCounts]:
    counts = PairCounts()
    bound = SkewBound(max_skew_s, FOCAL_PX, lambda: turn_radps)
    return Pairing[Picture](PERIOD_S, bound, counts), counts


def run(pairs: Pairing[Picture], pictures: list[Picture]) -> list[tuple[Picture, Picture]]:
    return [pair for each in pictures for pair in pairs.add(each.side, each)]


@dataclass(frozen=True)
class Clocks:
    """Two cameras: period_s of each, the right one's phase, jitter of the stamps (std), share of pictures lost."""

    phase_s: float
    drift: float
    jitter_s: float
    lost: float
    seed: int
    seconds: float = 6.0

    def pictures(self) -> list[Picture]:
        """In the order in which they arrive: a picture comes up to some milliseconds after it was taken."""
        rng = np.random.default_rng(self.seed)
        arrivals = []
        for side, period_s, start_s in ((LEFT, PERIOD_S, 0.0), (RIGHT, PERIOD_S * (1 + self.drift), self.phase_s)):
            ticks = np.arange(int(self.seconds / period_s))
            stamps_s = start_s + ticks * period_s + np.clip(rng.normal(0, self.jitter_s, len(ticks)), -5e-3, 5e-3)
            kept = rng.random(len(ticks)) >= self.lost
            delays_s = rng.uniform(1e-3, 4e-3, len(ticks))
            came_s = np.maximum.accumulate(stamps_s + delays_s)
            arrivals += [(c, side, s) for c, s, k in zip(came_s, stamps_s, kept, strict=True) if k]
        return [Picture(side, float(stamp_s)) for _, side, stamp_s in sorted(arrivals)]


clocks = st.builds(
    Clocks,
    phase_s=st.floats(-PERIOD_S / 2, PERIOD_S / 2),
    drift=st.floats(-2e-3, 2e-3),
    jitter_s=st.sampled_from([0.0, 3e-4, 1.5e-3]),
    lost=st.sampled_from([0.0, 0.02, 0.3]),
    seed=st.integers(0, 2**32 - 1),
)
bounds = st.sampled_from([1e-3, 5e-3, PERIOD_S / 2, PERIOD_S])


@settings(max_examples=40)
@given(clocks, bounds)
def test_every_pair_is_within_the_bound_goes_forward_and_uses_no_picture_twice(both: Clocks, bound_s: float) -> None:
    pairs = run(pairing(bound_s)[0], both.pictures())
    for left, right in pairs:
        assert (left.side, right.side) == (LEFT, RIGHT)
        assert abs(left.stamp_s - right.stamp_s) <= bound_s
    for side in (LEFT, RIGHT):
        stamps_s = [pair[side].stamp_s for pair in pairs]
        assert all(a < b for a, b in pairwise(stamps_s))


@settings(max_examples=40)
@given(clocks, bounds)
def test_every_picture_is_paired_or_counted_or_waits(both: Clocks, bound_s: float) -> None:
    made, counts = pairing(bound_s)
    pictures = both.pictures()
    pairs = run(made, pictures)
    assert len(pictures) == 2 * len(pairs) + 2 * counts.skewed + counts.broken + made.waiting()


@settings(max_examples=40)
@given(clocks)
def test_without_jitter_a_pair_is_two_that_are_each_others_nearest(both: Clocks) -> None:
    pictures = replace(both, jitter_s=0.0, lost=0.0).pictures()
    stamps_s = {side: np.array([p.stamp_s for p in pictures if p.side == side]) for side in (LEFT, RIGHT)}
    # Near half a period two partners are as near as each other, but for the drift.
    tie_s = abs(both.drift) * PERIOD_S + 1e-9
    for left, right in run(pairing()[0], pictures):
        nearest_s = min(np.abs(stamps_s[RIGHT] - left.stamp_s).min(), np.abs(stamps_s[LEFT] - right.stamp_s).min())
        assert abs(left.stamp_s - right.stamp_s) <= nearest_s + tie_s


@settings(max_examples=40)
@given(clocks)
def test_nearly_every_picture_finds_its_partner(both: Clocks) -> None:
    pictures = both.pictures()
    fewer = min(sum(p.side == side for p in pictures) for side in (LEFT, RIGHT))
    pairs = run(pairing(PERIOD_S / 2 + 10e-3)[0], pictures)
    slips = abs(both.drift) * both.seconds / PERIOD_S + 2
    if both.lost == 0 and both.jitter_s == 0:
        assert len(pairs) >= fewer - slips
    elif both.lost == 0:
        # Half a period apart, jitter makes now this one and now that one the nearer partner.
        assert len(pairs) >= 0.8 * fewer - slips
    else:
        # Both pictures of a moment are there in (1 - lost)^2 of all.
        assert len(pairs) >= ((1 - both.lost) ** 2 - 0.2) * both.seconds / PERIOD_S


@settings(max_examples=40)
@given(st.floats(0.05, 3.0), clocks)
def test_while_it_turns_no_pair_is_smeared_by_more_than_a_pixel(turn_radps: float, both: Clocks) -> None:
    for sign in (-1, 1):
        for left, right in run(pairing(turn_radps=sign * turn_radps)[0], both.pictures()):
            assert FOCAL_PX * turn_radps * abs(left.stamp_s - right.stamp_s) <= 1.0 + 1e-9


@pytest.mark.parametrize(("turn_degps", "bound_ms"), [(0.0, 16.667), (5.0, 16.667), (30.0, 5.968), (60.0, 2.984)])
def test_the_bound_is_half_a_period_until_a_turn_would_smear_more_than_a_pixel(
    turn_degps: float, bound_ms: float
) -> None:
    bound = SkewBound(PERIOD_S / 2, FOCAL_PX, lambda: np.deg2rad(turn_degps))
    assert 1e3 * bound.now_s() == pytest.approx(bound_ms, abs=1e-3)


def test_a_turn_that_is_not_known_leaves_the_bound() -> None:
    assert SkewBound(0.01, FOCAL_PX, lambda: float("nan")).now_s() == 0.01
    assert SkewBound(0.01, FOCAL_PX).now_s() == 0.01


def test_pictures_of_one_moment_are_a_pair_at_once_in_whichever_order_they_come() -> None:
    for first, second in ((LEFT, RIGHT), (RIGHT, LEFT)):
        made, counts = pairing(max_skew_s=1e-6, turn_radps=2.0)
        assert made.add(first, Picture(first, 5.0)) == []
        assert made.add(second, Picture(second, 5.0)) == [(Picture(LEFT, 5.0), Picture(RIGHT, 5.0))]
        assert counts == PairCounts()


def test_a_pair_beyond_the_bound_is_counted_once_and_lost_whole() -> None:
    made, counts = pairing(max_skew_s=2e-3)
    for k in range(10):
        assert made.add(LEFT, Picture(LEFT, k * PERIOD_S)) == []
        assert made.add(RIGHT, Picture(RIGHT, k * PERIOD_S + 8e-3)) == []
    assert (counts.skewed, counts.broken, made.waiting()) == (10, 0, 0)
    assert made.last_skew_s == pytest.approx(8e-3)


def test_a_side_that_was_away_is_caught_up_with_at_its_first_picture() -> None:
    made, counts = pairing()
    for k in range(100):
        made.add(LEFT, Picture(LEFT, k * PERIOD_S))
    assert made.waiting() == MOST_WAITING
    pairs = made.add(RIGHT, Picture(RIGHT, 99 * PERIOD_S + 1e-3))
    assert [(left.stamp_s, right.stamp_s) for left, right in pairs] == [(99 * PERIOD_S, 99 * PERIOD_S + 1e-3)]
    assert counts.broken == 99 and made.waiting() == 0


def test_a_nearer_partner_that_is_still_to_come_is_waited_for() -> None:
    made, _ = pairing(max_skew_s=PERIOD_S)
    made.add(LEFT, Picture(LEFT, 0.0))
    assert made.add(RIGHT, Picture(RIGHT, 0.025)) == []
    assert made.add(LEFT, Picture(LEFT, 0.033)) == [(Picture(LEFT, 0.033), Picture(RIGHT, 0.025))]


def test_a_stamp_that_goes_back_is_counted_and_changes_nothing() -> None:
    made, counts = pairing()
    made.add(LEFT, Picture(LEFT, 1.0))
    for stamp_s in (1.0, 0.5, float("nan")):
        assert made.add(LEFT, Picture(LEFT, stamp_s)) == []
    assert counts.broken == 3
    assert len(made.add(RIGHT, Picture(RIGHT, 1.0))) == 1


@pytest.mark.parametrize("wrong", [{"max_skew_s": -1.0}, {"focal_px": 0.0}, {"smear_px": float("nan")}])
def test_a_bound_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError):
        SkewBound(**{"max_skew_s": 0.01, "focal_px": 320.0, **wrong})


@pytest.mark.parametrize("period_s", [0.0, -1.0, float("nan")])
def test_a_period_that_cannot_be_is_refused(period_s: float) -> None:
    with pytest.raises(InvalidInputError):
        Pairing[Picture](period_s, SkewBound(0.01, 320.0), PairCounts())
