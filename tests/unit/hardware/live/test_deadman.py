"""Held keys on a terminal that tells only of presses and their repeats."""

import numpy as np
import pytest

from hardware.live.deadman import DIRECTIONS, FIRST_HOLD_S, DeadMan


def repeats(delay_s: float, period_s: float, until_s: float) -> list[float]:
    """When a terminal sends a key that is held from 0 to until_s."""
    return [0.0, *np.arange(delay_s, until_s, period_s).tolist()]


def moving(
    presses: list[tuple[float, str]], step_s: float = 0.01, until_s: float = 5.0
) -> list[tuple[float, tuple[int, int]]]:
    """The direction over time, of a loop that looks every step_s."""
    held, waiting, seen = DeadMan(), list(presses), []
    for now_s in np.arange(0.0, until_s, step_s):
        while waiting and waiting[0][0] <= now_s:
            held.press(waiting.pop(0)[1], float(now_s))
        seen.append((float(now_s), held.direction(float(now_s))))
    return seen


def test_nothing_moves_before_a_key_is_pressed() -> None:
    assert DeadMan().direction(0.0) == (0, 0)


@pytest.mark.parametrize("key", DIRECTIONS)
def test_one_press_moves_its_way_for_half_a_second_at_most(key: str) -> None:
    times = [now_s for now_s, direction in moving([(1.0, key)]) if direction == DIRECTIONS[key]]
    assert times[0] == pytest.approx(1.0, abs=0.02) and times[-1] - times[0] <= FIRST_HOLD_S <= 0.5


@pytest.mark.parametrize("delay_s", [0.25, 0.4, 0.49])
def test_a_held_key_moves_without_a_pause(delay_s: float) -> None:
    seen = moving([(t, "w") for t in repeats(delay_s, 0.033, 3.0)], until_s=3.0)
    assert all(direction == (1, 0) for _, direction in seen)


def test_where_repeats_begin_late_the_robot_hesitates_once_and_no_more() -> None:
    seen = moving([(t, "w") for t in repeats(0.66, 0.04, 3.0)], until_s=3.0)
    resting = [now_s for now_s, direction in seen if direction == (0, 0)]
    assert min(resting) >= 0.5 and max(resting) <= 0.67


@pytest.mark.parametrize("held_s", [0.05, 0.5, 0.52, 0.7, 2.0])
def test_a_key_that_is_let_go_stops_within_six_tenths_of_a_second(held_s: float) -> None:
    seen = moving([(t, "w") for t in repeats(0.5, 0.033, held_s)])
    assert max(now_s for now_s, direction in seen if direction != (0, 0)) <= held_s + 0.6


def test_another_key_takes_over_at_once() -> None:
    held = DeadMan()
    held.press("w", 0.0)
    held.press("a", 0.1)
    assert held.direction(0.1) == (0, 1)
    held.release()
    assert held.direction(0.1) == (0, 0)


def test_a_slow_tapping_is_no_held_key() -> None:
    seen = dict(moving([(0.0, "w"), (1.0, "w"), (2.0, "w")]))
    assert [seen[t] for t in seen if abs(t - 0.8) < 1e-6] == [(0, 0)]
    assert max(t for t in seen if seen[t] != (0, 0)) <= 2.0 + FIRST_HOLD_S
