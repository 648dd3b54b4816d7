"""Tables of a report: the same cells in HTML and in Markdown, and nothing that breaks out of a cell."""

import ast
import re
from pathlib import Path

import pytest

from stereogrid.errors import InvalidInputError
from stereogrid.report import ReportTable, write_report
from stereogrid.scoring import Score

TABLE = ReportTable("Pairs", ["pair", "matcher", "bad %"], [["teddy", "bm", "4.26"], ["", "a|b<i>", "2.98"]], n_names=2)


def test_html_has_every_cell_escaped_and_numbers_apart_from_names():
    assert re.findall(r"<th>(.*?)</th>", TABLE.html) == ["pair", "matcher", "bad %"]
    assert re.findall(r"<td>(.*?)</td>", TABLE.html) == ["teddy", "bm", "", "a|b&lt;i&gt;"]
    assert re.findall(r'<td class="number">(.*?)</td>', TABLE.html) == ["4.26", "2.98"]
    assert "<p>" not in TABLE.html


def test_markdown_has_a_line_a_row_and_as_many_cells_in_each():
    title, _, *lines = TABLE.markdown.splitlines()
    assert title == "Pairs."
    cells = [re.split(r"(?<!\\)\|", line)[1:-1] for line in lines]
    assert [len(row) for row in cells] == [3] * 4
    assert [cell.strip() for cell in cells[2]] == ["teddy", "bm", "4.26"]
    assert set("".join(cells[1])) == {"-", " "}


def test_a_row_that_does_not_fit_its_header_is_refused():
    with pytest.raises(InvalidInputError, match="a row of 2 cells under a header of 3: teddy"):
        ReportTable("Pairs", ["pair", "matcher", "bad %"], [["teddy", "bm"]])


def test_every_run_with_a_config_tells_its_reports_table_which():
    """Or the parameters would stand there without their units."""
    root = Path(__file__).parents[2]
    for path in [*(root / "experiments").glob("*_report.py"), root / "stereogrid" / "map_report.py"]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "write_report":
                assert "config" in [each.arg for each in node.keywords], f"{path.name}:{node.lineno}"


def test_tables_come_before_the_figures_and_the_scores_fold_away(tmp_path):
    scores = {"map": [Score("auc", 0.9, "1", 5)]}
    text = write_report(
        tmp_path, "Title", summary="", arms=scores, figures=[], facts={}, tables=[TABLE, TABLE]
    ).read_text()
    before, folded = text.split("<details>", 1)
    assert before.count("teddy") == 2
    assert "auc" not in before and "auc" in folded
