"""What took long is kept under a key of what makes it."""

import ast
import math

import pytest

from experiments import kept
from experiments.claim_units import CODE
from experiments.kept import KeptScores, code_key, key_of
from stereogrid.errors import InvalidInputError
from stereogrid.motion import Growth, MotionError
from stereogrid.scoring import Score

SCORES = [Score("auc", 0.1 + 0.2, "1", 7), Score("accuracy_m", math.nan, "m", 0)]


def test_scores_come_back_as_they_were(tmp_path):
    store = KeptScores(tmp_path / "units")
    assert store.get("a") is None
    store.keep("a", SCORES, {"world": "corridor"})
    first, second = KeptScores(tmp_path / "units").get("a")
    assert first == SCORES[0] and second.name == "accuracy_m" and math.isnan(second.value)


def test_a_damaged_file_counts_as_none(tmp_path):
    store = KeptScores(tmp_path)
    for text in ("", "{", "[]", '{"scores": {"auc": {}}}'):
        (tmp_path / "a.json").write_text(text)
        assert store.get("a") is None


def test_a_place_where_nothing_can_be_kept_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="file/units"):
        KeptScores(tmp_path / "file" / "units")


def test_keys_differ_with_any_parameter_and_with_nothing_else():
    error = MotionError(along=Growth(1e-3))
    assert key_of("map", error, 1) == key_of("map", MotionError(along=Growth(1e-3)), 1)
    others = [("bound", error, 1), ("map", error, 2), ("map", MotionError(along=Growth(0, 1e-3)), 1), ("map", error)]
    assert len({key_of(*each) for each in [("map", error, 1), *others]}) == 5


def test_the_code_has_another_key_once_a_line_of_it_is_other(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "ROOT", tmp_path)
    (tmp_path / "inside" / "drawing").mkdir(parents=True)
    (tmp_path / "inside" / "a.py").write_text("1")
    (tmp_path / "inside" / "drawing" / "b.py").write_text("2")
    (tmp_path / "one.py").write_text("3")
    whole = code_key(["inside", "one.py"])
    part = code_key(["inside", "one.py"], but=["inside/drawing"])
    (tmp_path / "inside" / "drawing" / "b.py").write_text("22")
    assert code_key(["inside", "one.py"]) != whole != part
    assert code_key(["inside", "one.py"], but=["inside/drawing"]) == part
    (tmp_path / "one.py").write_text("33")
    assert code_key(["inside", "one.py"], but=["inside/drawing"]) != part
    without = code_key(["inside"])
    (tmp_path / "inside" / "table.json").write_text("[1]")
    assert code_key(["inside"]) != without


def test_the_key_of_a_unit_of_the_claim_is_of_all_the_code_of_the_experiments_that_makes_it():
    """What its modules import from their neighbours is in the key; but for bars on the screen and keys themselves."""
    named = {each for each in CODE if each.startswith("experiments/")}
    used = set()
    for path in named:
        for node in ast.walk(ast.parse((kept.ROOT / path).read_text())):
            if isinstance(node, ast.ImportFrom) and node.level == 1:
                used.add(f"experiments/{node.module}.py")
    assert used - named == {"experiments/kept.py", "experiments/parallel.py"}
    assert all((kept.ROOT / each).exists() for each in (*CODE, *kept.NO_SCORE_DEPENDS_ON))
