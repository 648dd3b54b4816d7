"""YAML of strangers is read as plain values or refused in one line, before it can grow."""

from pathlib import Path

import pytest

from stereogrid.errors import RecordingError
from stereogrid.plainyaml import plain_text, read_yaml

WRONG = {
    "merge keys": ("a: &a {x: 1}\nb: {<<: *a}", r"has aliases \(\*name\)"),
    "deep": ("a: " + 11 * "[", "is nested deeper"),
    "large": ("a: " + 200 * "x", "203 bytes; no a.yaml has more than 100"),
    "a tag": ("a: !!python/name:os.system", "no YAML of plain values: could not determine"),
    "no date": ("a: 2011-13-26", "no YAML of plain values"),
    "a list": ("[1, 2]", "no keys and values, but list"),
    "no key": ("? [a]\n: 1\n? {b: 1}\n: 2", "no (YAML of plain|keys)"),
    "two documents": ("a: 1\n---\nb: 2", "no YAML of plain values"),
    "no YAML": ("a: [1, }", "no YAML of plain values"),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG)
def test_what_is_not_plain_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(RecordingError, match=message) as caught:
        read_yaml(path, most_bytes=100)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_a_file_of_opencvs_is_read_but_for_its_tags(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("%YAML:1.0\n---\na: {b: [1, 2.5, three]}\n")
    assert read_yaml(path, most_bytes=100) == {"a": {"b": [1, 2.5, "three"]}}
    path.write_text("%YAML:1.0\n---\na: !!opencv-matrix\n   rows: 1\n")
    assert "!!opencv-matrix" in plain_text(path, most_bytes=100)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"a\.yaml: cannot be read: No such file"):
        read_yaml(tmp_path / "a.yaml", most_bytes=100)
