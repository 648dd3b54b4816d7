"""How far errors go together, as the library knows it: one set of numbers a matcher, and one for those without."""

import json
import math
from importlib import resources

import pytest

from stereogrid.errors import InvalidInputError
from stereogrid.matching import MATCHERS
from stereogrid.matching.correlation import (
    ErrorReach,
    _from_json,
    error_correlation_px,
    error_reach,
    error_reaches,
    temporal_share,
)
from stereogrid.matching.sigma import GENERIC, sigma_tables

GOOD = {"correlation_px": 5.0, "temporal_share": 0.4, "decorrelation_px": 2.0, "lasting_share": 0.1}


def test_every_matcher_with_a_sigma_table_was_measured():
    assert set(error_reaches()) == set(sigma_tables())
    for name in set(MATCHERS) & set(sigma_tables()):
        assert error_correlation_px(name) == error_reaches()[name].correlation_px > 1
        assert temporal_share(name) == error_reaches()[name].temporal_share


def test_a_matcher_that_was_not_measured_gets_the_most_cautious_numbers():
    others = [reach for name, reach in error_reaches().items() if name != GENERIC]
    unknown = error_reach("mine")
    assert error_correlation_px("mine") == max(each.correlation_px for each in others)
    assert temporal_share("mine") == min(each.temporal_share for each in others)
    assert unknown.decorrelation_px == max(each.decorrelation_px for each in others)
    assert unknown.lasting_share == max(each.lasting_share for each in others)


def test_the_file_names_the_command_that_wrote_it():
    text = resources.files("stereogrid.matching").joinpath("correlation_lengths.json").read_text(encoding="utf-8")
    assert json.loads(text)["command"] == "python -m experiments correlation --data ../shared/data --write"


def test_null_in_the_file_stands_for_infinity():
    assert _from_json({**GOOD, "decorrelation_px": None}) == ErrorReach(**{**GOOD, "decorrelation_px": math.inf})


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"correlation_px": 0.9}, "correlation_px must be finite and >= 1, not 0.9"),
        ({"correlation_px": math.inf}, "correlation_px must be finite and >= 1, not inf"),
        ({"correlation_px": math.nan}, "correlation_px must be finite and >= 1, not nan"),
        ({"temporal_share": 1.1}, "temporal_share must be 0 to 1, not 1.1"),
        ({"temporal_share": math.nan}, "temporal_share must be 0 to 1, not nan"),
        ({"lasting_share": -2.0}, "lasting_share must be -1 to 1, not -2.0"),
        ({"decorrelation_px": -1.0}, "decorrelation_px must be >= 0, not -1.0"),
    ],
)
def test_numbers_that_cannot_be_are_refused_by_name(changed, reason):
    with pytest.raises(InvalidInputError, match=reason):
        ErrorReach(**{**GOOD, **changed})
