"""What is still to be driven follows from what is wanted and what the file holds."""

import math

import numpy as np
import pytest
from marked_runs import noisy_run

from hardware.motion_runs.plan import Plan, next_name
from stereogrid.errors import InvalidInputError
from stereogrid.motion import MotionError


def run(name, extent, *, turn=False, surface="carpet", sign=1):
    return noisy_run(name, MotionError(), (extent,), np.random.default_rng(0), turn=turn, surface=surface, sign=sign)


def test_runs_of_the_same_kind_length_and_surface_count():
    plan = Plan(2.0, math.pi / 2, runs=3, surface="carpet")
    held = [
        run("1", 2.0),
        run("2", 2.1),
        run("3", 1.0),
        run("4", 2.0, surface="tiles"),
        run("5", math.pi / 2, turn=True),
    ]
    assert plan.left(held) == {"straight": 1, "turn": 2}
    assert plan.left([]) == {"straight": 3, "turn": 3}
    assert plan.left([run(str(n), 2.0) for n in range(7)]) == {"straight": 0, "turn": 3}


def test_a_turn_to_the_right_counts_as_one_to_the_left():
    plan = Plan(turn_rad=math.pi / 2, runs=2, surface="carpet")
    assert plan.done("turn", [run("1", math.pi / 2, turn=True), run("2", math.pi / 2, turn=True, sign=-1)]) == 2


def test_turns_go_left_and_right_in_turn():
    plan = Plan(turn_rad=2 * math.pi)
    assert [[round(math.degrees(leg.amount)) for leg in plan.legs("turn", done)] for done in (0, 1, 2)] == [
        [90] * 4,
        [-90] * 4,
        [90] * 4,
    ]


def test_straight_runs_go_forth_and_back_along_the_line():
    plan = Plan(2.0, math.pi / 2)
    assert [plan.start("straight", done) for done in (0, 1, 2)] == [(0, 0, 0), (2.0, 0, math.pi), (0, 0, 0)]
    assert plan.start("turn", 1) == (0, 0, 0)


@pytest.mark.parametrize(
    ("distance_m", "every_m", "pieces"),
    [(2.0, 1.0, [1, 1]), (2.0, 5.0, [2]), (2.5, 1.0, [1, 1, 0.5]), (2.02, 1.0, [1, 1.02])],
)
def test_a_way_has_a_mark_at_its_end(distance_m, every_m, pieces):
    legs = Plan(distance_m, every_m=every_m).legs("straight", 0)
    assert [leg.amount for leg in legs] == pytest.approx(pieces)


def test_names_go_on_from_the_largest_number():
    assert next_name([]) == "1"
    assert next_name([run("7", 2.0), run("b", 2.0), run("3", 2.0)]) == "8"


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({}, "--distance 2"),
        ({"distance_m": 0.3}, "0.6 to 20 m, not 0.3"),
        ({"distance_m": math.nan}, "not nan"),
        ({"distance_m": 2.0, "runs": 0}, "at least 1 run"),
        ({"turn_rad": math.radians(20)}, "54 to 720 degrees"),
        ({"turn_rad": -math.pi}, "to the right by itself"),
        ({"distance_m": 2.0, "every_m": 0.0}, "0.1 m apart"),
        ({"turn_rad": 4.0, "every_rad": math.pi}, "nobody can tell"),
    ],
)
def test_what_motion_error_would_leave_out_is_refused(given, named):
    with pytest.raises(InvalidInputError, match=named):
        Plan(**given)
