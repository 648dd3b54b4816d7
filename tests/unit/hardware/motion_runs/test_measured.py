"""What a person types is what was meant, or is asked again."""

import math

import pytest

from hardware.motion_runs.measured import angle_rad, far_off, length_m
from stereogrid.errors import InvalidInputError


@pytest.mark.parametrize("answer", ["2012", "2012 mm", " 2012mm ", "201.2 cm", "2.012 m", "2,012 m", "+2.012 M"])
def test_a_length_may_name_its_unit(answer):
    assert length_m(answer) == pytest.approx(2.012)


@pytest.mark.parametrize("answer", ["-90", "-90 deg", "-90°", "-90 degrees", "-1.5707963 rad"])
def test_an_angle_may_name_its_unit(answer):
    assert angle_rad(answer) == pytest.approx(-math.pi / 2)


@pytest.mark.parametrize("answer", ["", "two", "2 km", "2 deg", "nan", "inf", "1e3", "2 m 3", "--2", "2.1.3"])
def test_what_is_no_length_is_refused_by_its_own_words(answer):
    with pytest.raises(InvalidInputError, match=f"^'{answer}' is not a length"):
        length_m(answer)


def test_a_digit_too_many_is_doubted_and_an_ordinary_error_is_not():
    odo = (2.0, 0.0, 0.0)
    assert far_off((2.1, 0.05, 0.1), odo) == ""
    assert "2000 mm ahead" in far_off((20.0, 0.0, 0.0), odo)
    assert "degrees" in far_off((2.0, 0.0, 1.0), odo)


def test_a_whole_turn_more_is_no_doubt():
    assert far_off((0.0, 0.0, 2 * math.pi + 0.02), (0.0, 0.0, -0.02)) == ""
