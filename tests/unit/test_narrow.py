"""A table for the screen is as wide as the screen at most, and loses no character of a number."""

import re
import subprocess
import sys

import pytest

from experiments.narrow import narrowed
from experiments.screen import print_tables
from stereogrid.report import ReportTable

SCORES = ("auc_all", "log_loss_all", "ece_width_all", "log_loss_balanced", "brier_balanced")
CANDIDATES = ("none 0.03 0.8 0.3", "submaps, pieces of 2 m")
TUNED = ReportTable(
    "Candidates",
    ["noise", "fusion", "candidate", *SCORES],
    [
        ["drift with turns", "cell", name, *(f"0.{7 * n + k}45" for k in range(len(SCORES)))]
        for n, name in enumerate(CANDIDATES, start=2)
    ],
    n_names=3,
)
DIFFERENCES = ReportTable(
    "Differences",
    ["cause", *(f"error number {n} of all cells in view [nat]" for n in range(3))],
    [["matching", *(f"+0.{n}100 [+0.{n}050, +0.{n}150]" for n in range(1, 4))], ["- its images", *["- [-, -]"] * 3]],
)


def lines_of(capsys, monkeypatch, table, width):
    monkeypatch.setenv("COLUMNS", str(width))
    print_tables([table])
    return capsys.readouterr().out.splitlines()


def test_a_table_that_fits_is_as_it_was():
    assert narrowed(TUNED, 200) == ("", [TUNED])


def test_a_name_that_all_rows_share_is_said_once_before_anything_is_folded():
    common, (part,) = narrowed(TUNED, 110)
    assert common == "noise: drift with turns, fusion: cell"
    assert list(part.header) == ["candidate", *SCORES]
    assert part.n_names == 1
    assert [list(row) for row in part.rows] == [list(row[2:]) for row in TUNED.rows]


def test_one_name_stays_even_where_there_is_one_row():
    one = ReportTable("", ["noise", "candidate", "score"], [["drift", "none " * 9, "0.1"]], n_names=2)
    _, (part, *_) = narrowed(one, 30)
    assert part.header[0] == "candidate"


@pytest.mark.parametrize("width", [120, 80, 60, 40])
@pytest.mark.parametrize("table", [TUNED, DIFFERENCES], ids=["scores", "intervals"])
def test_on_a_screen_of_any_width_every_number_is_whole(capsys, monkeypatch, table, width):
    lines = lines_of(capsys, monkeypatch, table, width)
    assert max(map(len, lines)) <= width
    shown = "\n".join(lines)
    assert "…" not in shown
    for row in table.rows:
        for number in " ".join(row[table.n_names :]).split():
            assert re.search(rf"(?<!\S){re.escape(number)}(?!\S)", shown), number


def test_headings_are_folded_at_blanks_and_behind_underscores():
    _, (part,) = narrowed(TUNED, 80)
    assert list(part.header[1:]) == [
        "auc_\nall",
        "log_\nloss_\nall",
        "ece_\nwidth_\nall",
        "log_\nloss_\nbalanced",
        "brier_\nbalanced",
    ]


def test_what_does_not_fit_beside_each_other_stands_below_with_the_names_of_its_rows():
    _, parts = narrowed(DIFFERENCES, 80)
    assert [part.header[0] for part in parts] == ["cause"] * 2
    assert [len(part.header) for part in parts] == [3, 2]


def test_several_tables_stand_under_their_captions(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    print_tables([DIFFERENCES, TUNED])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Differences"
    assert lines[lines.index("Candidates") - 1] == ""


def test_the_commands_are_there_before_anything_slow_is_imported():
    code = "import sys, experiments.__main__; print(sorted({'numba', 'cv2', 'matplotlib'} & {*sys.modules}))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout == "[]\n"
