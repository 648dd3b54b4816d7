"""What two cameras give is judged by rate, skew and by what is on it."""

import numpy as np
import pytest

from hardware.cameras.pairs import PairCounts, RawPair
from hardware.clock import now_s
from hardware.doctor.pictures import Measured, judge, measure
from hardware.mailbox import Mailbox
from stereogrid.checks import OK, PROBLEM, WARNING


def measured(**changed):
    good = {
        "size_px": (320, 240),
        "stamps_s": tuple(np.arange(60) / 30),
        "skew_s": (0.004,) * 60,
        "skewed": 0,
        "broken": 0,
        "means": (100.0, 104.0),
        "difference": 20.0,
    }
    return Measured(**{**good, **changed})


def states(seen, **given):
    return {check.name: check.state for check in judge(seen, 30.0, **given)}


def test_good_cameras_are_well():
    assert states(measured()) == {"camera pairs": OK, "camera skew": OK, "pictures": OK}
    pairs, skew, _ = judge(measured(), 30.0)
    assert pairs.found == "320x240, 30.0 pairs/s of 30, 0 broken pictures"
    assert skew.found == "median 4.0 ms, 95 % within 4.0, worst 4.0; 0 % of pairs thrown away"


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"stamps_s": tuple(np.arange(60) / 20)}, "camera pairs"),
        ({"broken": 20}, "camera pairs"),
        ({"skewed": 30}, "camera skew"),
        ({"means": (100.0, 2.0)}, "pictures"),
        ({"means": (100.0, 150.0)}, "pictures"),
        ({"difference": 0.0}, "pictures"),
    ],
)
def test_what_is_wrong_is_a_warning_of_its_own(changed, name):
    wrong = [key for key, state in states(measured(**changed)).items() if state == WARNING]
    assert wrong == [name]


def test_cameras_without_a_pair_are_a_problem_with_what_they_say():
    nothing = measured(stamps_s=(), skew_s=())
    (check,) = judge(nothing, 30.0, "the left camera is gone")
    assert (check.state, "the left camera is gone" in check.found) == (PROBLEM, True)


class Canned:
    """Two cameras that have given what they will give."""

    size_px = (4, 3)
    name = "canned"

    def __init__(self, pairs):
        self.counts, self.about, self.pairs = PairCounts(), {}, pairs

    def subscribe(self, most=4):
        box = Mailbox(most)
        for pair in self.pairs:
            box.put(pair)
        box.close()
        return box


def test_stamps_and_skews_are_those_of_the_pairs():
    left, right = np.full((3, 4), 40, np.uint8), np.full((3, 4), 50, np.uint8)
    start_s = now_s()
    pairs = [RawPair(left, right, start_s + n / 10, start_s + n / 10 + 0.002) for n in range(5)]
    seen, last = measure(Canned(pairs), 5.0)
    assert last is pairs[-1]
    assert seen.rate_hz == pytest.approx(10)
    np.testing.assert_allclose(seen.skew_s, 0.002, atol=1e-9)
    assert (seen.means, seen.difference) == ((40.0, 50.0), 10.0)


def test_no_pair_is_measured_as_none():
    seen, last = measure(Canned([]), 0.1)
    assert (last, seen.rate_hz, seen.stamps_s) == (None, 0.0, ())
