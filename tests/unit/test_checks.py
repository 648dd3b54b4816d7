"""A check says what to do, and one problem is enough to be ill."""

import json

import pytest

from stereogrid.checks import NOT_THERE, OK, PROBLEM, WARNING, Check, as_table, healthy
from stereogrid.errors import InvalidInputError


@pytest.mark.parametrize("state", [WARNING, PROBLEM])
def test_trouble_without_a_remedy_is_refused(state):
    with pytest.raises(InvalidInputError, match="needs a remedy"):
        Check("lens", state, "dirty")


def test_a_line_is_one_line():
    with pytest.raises(InvalidInputError, match="more than one line"):
        Check("lens", WARNING, "dirty", "wipe it\nagain")


def test_a_state_that_there_is_not_is_refused():
    with pytest.raises(InvalidInputError, match="ok, warning, problem, not there"):
        Check("lens", "fine", "clean")


def test_problems_alone_make_it_ill_and_machines_are_told_so():
    well = [Check("a", OK, ""), Check("b", WARNING, "", "wait"), Check("c", NOT_THERE, "")]
    assert healthy(well) and healthy([])
    ill = [*well, Check("d", PROBLEM, "", "mend it", {"volts": 11.2})]
    assert not healthy(ill)
    table = json.loads(json.dumps(as_table(ill)))
    assert not table["healthy"]
    assert table["checks"][3] == {
        "name": "d", "state": "problem", "found": "", "remedy": "mend it", "values": {"volts": 11.2}
    }  # fmt: skip
