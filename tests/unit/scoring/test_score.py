import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.scoring import Score, scores_from_dict, scores_to_dict

SCORES = st.builds(
    Score,
    st.text(min_size=1),
    st.floats(allow_infinity=False),
    st.sampled_from(["m", "bit", "1"]),
    st.integers(0, 10**9),
)


@given(st.lists(SCORES, unique_by=lambda score: score.name))
def test_scores_survive_json(scores):
    text = json.dumps(scores_to_dict(scores), allow_nan=False)
    back = scores_from_dict(json.loads(text))
    assert [(s.name, s.unit, s.n) for s in back] == [(s.name, s.unit, s.n) for s in scores]
    for score, copy in zip(scores, back, strict=True):
        assert copy.value == score.value or (math.isnan(copy.value) and math.isnan(score.value))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_is_written_as_null(value):
    assert scores_to_dict([Score("auc", value, "1", 0)])["auc"]["value"] is None


def test_a_score_without_a_unit_is_refused():
    with pytest.raises(InvalidInputError, match="unit"):
        Score("auc", 0.5, "", 1)


def test_two_scores_of_one_name_are_refused():
    with pytest.raises(InvalidInputError, match="auc"):
        scores_to_dict([Score("auc", 0.5, "1", 1), Score("auc", 0.6, "1", 1)])


def test_a_row_without_its_unit_is_named():
    with pytest.raises(InvalidInputError, match="'auc' lacks unit"):
        scores_from_dict({"auc": {"value": 0.5, "n": 3}})
