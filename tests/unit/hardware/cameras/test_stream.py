"""Whose clock a camera's stamps are on, and whether it hangs."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.cameras.stream import CaptureClock, Repeats
from hardware.clock import to_epoch_s


@pytest.mark.parametrize(
    ("kind", "zero_s"),
    [("monotonic", 0.0), ("epoch", time.time() - time.monotonic()), ("arrival", -1e6)],
    ids=["monotonic", "epoch", "arrival"],
)
def test_stamps_near_now_on_a_clock_we_know_are_believed_and_arrival_is_taken_else(kind: str, zero_s: float) -> None:
    clock = CaptureClock()
    now_s = time.monotonic()
    for k in range(5):
        taken_s, arrival_s = now_s + k / 30, now_s + k / 30 + 0.02
        stamp_s = clock.stamp_s(zero_s + taken_s, arrival_s)
        assert stamp_s == pytest.approx(arrival_s if kind == "arrival" else taken_s, abs=1e-3)
        assert clock.kind == kind


def test_of_another_machine_only_a_time_of_day_near_ours_is_believed() -> None:
    epoch_s = to_epoch_s(0.0)
    for zero_s, behind_s, kind in ((0.0, 0.02, "arrival"), (epoch_s, 0.02, "epoch"), (epoch_s, 0.5, "arrival")):
        clock = CaptureClock(same_machine=False)
        for k in range(3):
            stamp_s = clock.stamp_s(zero_s + 100.0 + k, 100.0 + behind_s + k)
            assert clock.kind == kind
            assert stamp_s == pytest.approx(100.0 + k + (behind_s if kind == "arrival" else 0.0), abs=1e-6)


def test_a_clock_that_is_believed_is_not_left_for_one_late_picture() -> None:
    clock = CaptureClock(same_machine=False)
    for k, behind_s in enumerate((0.1, 0.4, 0.3, 0.9)):
        assert clock.stamp_s(to_epoch_s(100.0 + k), 100.0 + k + behind_s) == pytest.approx(100.0 + k, abs=1e-6)


def test_without_a_stamp_it_is_the_arrival() -> None:
    clock = CaptureClock()
    assert clock.stamp_s(None, 12.5) == 12.5 and clock.kind == "arrival"


def test_the_same_stamp_again_or_an_older_one_is_no_picture_whatever_its_clock() -> None:
    for zero_s in (0.0, 5e5):
        clock = CaptureClock()
        assert clock.stamp_s(zero_s + 100.0, 100.01) is not None
        assert clock.stamp_s(zero_s + 100.0, 100.04) is None
        assert clock.stamp_s(zero_s + 99.9, 100.07) is None
        assert clock.stamp_s(zero_s + 100.1, 100.11) is not None


def test_a_clock_that_starts_anew_is_taken_up() -> None:
    clock = CaptureClock()
    assert clock.stamp_s(5000.0, 100.0) == 100.0
    assert clock.stamp_s(3.0, 101.0) == 101.0
    assert clock.stamp_s(4.0, 102.0) == 102.0


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(0, 1e6))
def test_no_stamp_lies_in_the_future_or_long_ago(claimed_s: float, arrival_s: float) -> None:
    stamp_s = CaptureClock().stamp_s(claimed_s, arrival_s)
    assert stamp_s is not None and arrival_s - CaptureClock.BEHIND_S <= stamp_s <= arrival_s


def test_a_picture_that_comes_again_from_a_camera_whose_noise_made_each_another_is_none() -> None:
    repeats = Repeats()
    for k in range(Repeats.LIVELY):
        assert not repeats.again(b"%d" % k)
    assert all(repeats.again(b"%d" % (Repeats.LIVELY - 1)) for _ in range(10))
    assert not repeats.again(b"alive")


def test_a_still_picture_without_noise_is_no_hang() -> None:
    repeats = Repeats()
    assert not any(repeats.again(b"%d" % (k // 3)) for k in range(500))
