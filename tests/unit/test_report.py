"""The report stands alone: nothing in it is fetched, nothing in it is executed, no number lacks its unit."""

import base64
import json
import re
from dataclasses import dataclass, field
from datetime import datetime
from html.parser import HTMLParser
from typing import Annotated
from urllib.parse import unquote

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stereogrid.config import MappingConfig, save_config
from stereogrid.described import Doc
from stereogrid.report import ReportFigure, environment, format_score, score_table, write_metrics, write_report
from stereogrid.run_record import RunRecord
from stereogrid.runs import begun, run_folder
from stereogrid.scoring import BOUND_NAMES, SCORE_NAMES, Score, scores_to_dict
from stereogrid.scoring.held_out import HELD_OUT_NAMES
from stereogrid.scoring.meanings import MEANINGS

SCORES = [
    Score("camera_height_m", 1.6512, "m", 100),
    Score("auc", 0.98765, "1", 5000),
    Score("log_loss", 0.1234, "nat", 5000),
    Score("occupied_f1", np.nan, "1", 0),
]
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)
VOID = {"meta", "img", "br"}
nasty = st.sampled_from(['<b class="x">', '"><img src="x">', "'><a href='x'>", "</title><script>", "&lt;b&gt;", "é\n"])


class Page(HTMLParser):
    """Tags, attributes and text of a page; refuses tags that do not close in order."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.texts, self.open = [], [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes.extend((tag, *attribute) for attribute in attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    @property
    def text(self):
        return " ".join(self.texts)


def write(folder, **changes):
    picture = folder / "slice.png"
    picture.write_bytes(PNG)
    options = {
        "summary": "3 observations",
        "arms": {"map": SCORES},
        "figures": [ReportFigure(picture, "A slice.")],
        "facts": {"command": "stereogrid map drive.mcap"},
        **changes,
    }
    title = options.pop("title", "Map of drive")
    return write_report(folder, title, **options).read_text(encoding="utf-8")


def test_the_report_refers_to_nothing_outside_itself(tmp_path):
    (tmp_path / "config.toml").write_text('[matcher]\nname = "bm"\n')
    text = write(tmp_path)
    page = Page(text)
    assert not re.search(r"https?:|file:|//\w|url\(|@import", text)
    assert not {"script", "link", "iframe", "object", "embed"} & set(page.tags)
    loaded = [value for _, name, value in page.attributes if name in ("src", "srcset", "data")]
    assert len(loaded) == 1
    assert loaded[0].startswith("data:image/png;base64,")
    assert base64.b64decode(loaded[0].split(",", 1)[1]) == PNG
    policy = next(value for tag, name, value in page.attributes if tag == "meta" and value.startswith("default-src"))
    assert policy.startswith("default-src 'none'; img-src data:;")


def test_the_files_of_the_run_are_linked_beside_the_page_whatever_their_names(tmp_path):
    names = ["map.sgrid", "metrics.json", 'a "b" <i>#?%.csv', "results.md"]
    for name in names:
        (tmp_path / name).write_text("x" * 1500)
    (tmp_path / ".half-written").write_text("x")
    page = Page(write(tmp_path))
    links = [value for tag, name, value in page.attributes if tag == "a" and name == "href"]
    assert all(link.startswith("./") for link in links)
    assert sorted(unquote(link.removeprefix("./")) for link in links) == sorted(names)
    assert set(names) <= set(page.texts) and "2 kB" in page.texts


def test_the_report_reads_the_same_when_its_figures_are_gone(tmp_path):
    text = write(tmp_path)
    (tmp_path / "slice.png").unlink()
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == text
    assert sorted(each.name for each in tmp_path.iterdir()) == ["report.html"]


def test_every_score_stands_in_the_report_with_its_unit(tmp_path):
    page = Page(write(tmp_path))
    for name in ("camera_height_m", "auc", "log_loss", "occupied_f1"):
        assert name in page.texts
    numbers = [text for text in page.texts if re.match(r"^[\d.]+( \w+)?$", text)]
    assert any(re.fullmatch(r"1\.65\d* m", number) for number in numbers)
    assert any(re.fullmatch(r"0\.12\d* nat", number) for number in numbers)
    assert any(re.fullmatch(r"0\.98\d*", number) for number in numbers)
    assert SCORE_NAMES["auc"][1] in page.texts


@pytest.mark.parametrize("missing", [None, Score("auc", np.nan, "1", 0), Score("accuracy_m", np.nan, "m", 0)])
def test_a_number_that_is_not_there_is_a_dash(missing):
    shown = Page(f"<p>{format_score(missing)}</p>").text
    assert shown.split()[0] in ("-", "–")
    assert "nan" not in shown.lower()


def test_arms_that_lack_a_score_show_a_dash_in_its_row():
    table = score_table({"ideal": SCORES, "noisy": SCORES[:1]})
    rows = table.split("<tr>")[2:]
    assert len(rows) == len(SCORES)
    for row, score in zip(rows, SCORES, strict=True):
        cells = re.findall(r'<td class="number">(.*?)</td>', row)
        assert cells[0] == format_score(score)
        assert cells[1] == format_score(score if score.name == "camera_height_m" else None)
    assert table.index("ideal") < table.index("noisy")


@given(value=st.floats(-1e6, 1e6), unit=st.sampled_from(["m", "bit", "nat", "cell", "s"]))
@settings(max_examples=60, derandomize=True)
def test_a_score_is_shown_to_three_decimals_or_two_digits_and_ends_with_its_unit(value, unit):
    number, shown_unit = format_score(Score("x", value, unit, 1)).split()
    assert shown_unit == unit
    off = 5.1e-4 if abs(value) >= 0.001 else 0.05 * abs(value)
    assert float(number.replace(",", "")) == pytest.approx(value, abs=off)
    assert format_score(Score("x", value, "1", 1)) == number


@given(name=nasty, unit=nasty, title=nasty, summary=nasty, arm=nasty, caption=nasty, fact=nasty)
@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_name_can_bring_tags_of_its_own(tmp_path, name, unit, title, summary, arm, caption, fact):
    picture = tmp_path / "slice.png"
    picture.write_bytes(PNG)
    (tmp_path / "config.toml").write_text(f"# {fact}", encoding="utf-8")

    def tags(*texts):
        name, unit, title, summary, arm, caption, fact = texts
        arms = {arm: [Score(name, 0.5, unit, 1)]}
        figures = [ReportFigure(picture, caption)]
        page = Page(write(tmp_path, title=title, summary=summary, arms=arms, figures=figures, facts={fact: fact}))
        return page.tags, [(tag, key) for tag, key, _ in page.attributes], page.attributes

    nasty_tags, keys, attributes = tags(name, unit, title, summary, arm, caption, fact)
    plain_tags, plain_keys, _ = tags("n", "u", "t", "s", "a", "c", "f")
    assert nasty_tags == plain_tags
    assert keys == plain_keys
    assert ("img", "alt", caption) in attributes


def test_the_config_is_quoted_where_there_is_one_and_the_versions_are_named(tmp_path):
    assert "config.toml" not in write(tmp_path)
    (tmp_path / "config.toml").write_text("[grid]\ncell_m = 0.05\n")
    text = Page(write(tmp_path)).text
    assert "cell_m = 0.05" in text
    for name in ("stereogrid", "numpy", "numba", "opencv"):
        assert name in environment()["versions"]
    assert environment()["versions"] in text


@dataclass(frozen=True)
class Drive:
    """What a drive is."""

    longest: Annotated[float, Doc("How long.", "m")] = 6.0
    share_m: Annotated[float, Doc("A number without a dimension, whatever its name ends with.", "1")] = 0.5


@dataclass(frozen=True)
class Documented:
    """A config with all that configs have."""

    world_seed: Annotated[int, Doc("Paints.")] = 7
    mapping: Annotated[MappingConfig, Doc("How.")] = field(default_factory=MappingConfig)
    drives: Annotated[tuple[Drive, ...], Doc("Several.")] = (Drive(), Drive(7.0))
    arms: Annotated[dict, Doc("Tables.")] = field(default_factory=lambda: {"a_m": 1})
    until_s: Annotated[float | None, Doc("Not set.", "s")] = None


def test_every_parameter_stands_in_a_table_with_its_own_unit_and_the_seed_among_what_was_run(tmp_path):
    save_config(Documented(), tmp_path / "config.toml")
    text = write(tmp_path, config=Documented())
    for row in (
        *(
            ["mapping.grid.cell_m", "0.05", "m"],
            ["mapping.grid.clamp", "-6, 6", "nat"],
            ["drives[1].longest", "6", "m"],
        ),
        *(["drives[2].longest", "7", "m"], ["drives[2].share_m", "0.5", ""], ["world_seed", "7", ""]),
        *(["arms.a_m", "1", ""], ["mapping.matcher.num_disparities", "64", "px"]),
    ):
        assert "".join(f"<td>{cell}</td>" for cell in row) in text
    assert "<tr><th>seed</th><td>world_seed 7</td></tr>" in text
    assert "<th>unit</th>" not in write(tmp_path)  # nobody guesses


def test_a_run_folder_tells_when_it_began_and_its_record_what_was_run(tmp_path):
    record = RunRecord("map", "stereogrid map drive.mcap", "../drive.mcap", end_s=9.0, stride=2)
    with run_folder(tmp_path, "drive") as folder:
        record.save(folder)
        text = write(folder, facts={})
        began = begun(folder)
    assert abs((datetime.now() - began).total_seconds()) < 60
    rows = dict(re.findall(r"<tr><th>(.*?)</th><td>(.*?)</td></tr>", text))
    assert rows["date"] == f"{began:%Y-%m-%d %H:%M:%S}" and re.fullmatch(r"\d+ s", rows["duration"])
    assert rows["command"] == record.command and rows["recording"] == record.recording
    assert rows["part of it"] == "to 9 s one observation of 2"
    assert begun(tmp_path) is None


def test_an_interval_stands_below_its_score_and_nothing_where_there_is_none():
    assert format_score(Score("auc", 0.9, "1", 5, 0.8, 0.95)) == "0.900<small>0.800 to 0.950</small>"
    assert format_score(Score("accuracy_m", 0.9, "m", 5)) == "0.900 m"


@pytest.mark.parametrize("name", MEANINGS)
def test_every_score_has_a_meaning(name):
    table = score_table({"map": [Score(name, 0.5, "1", 5)]})
    (meaning,) = re.findall(r'<td class="meaning">(.*?)</td>', table)
    assert len(meaning) > 10


def test_what_a_map_has_without_a_truth_has_meanings_too():
    assert {"camera_height_m", "disparity_density", "known_cells"} <= set(MEANINGS)
    assert {*SCORE_NAMES, *BOUND_NAMES, *HELD_OUT_NAMES} <= set(MEANINGS)


def test_notes_stand_below_the_scores(tmp_path):
    text = write(tmp_path, notes=["Intervals: of <blocks>."])
    assert "auc" in text.split("Intervals: of &lt;blocks&gt;.")[0] and "<figure>" in text.split("&lt;blocks")[1]


def test_a_headline_comes_first_and_all_scores_are_still_there(tmp_path):
    text = write(tmp_path, headline=["auc"])
    before, after = text.split("<figure>")
    assert "auc" in before
    assert "log_loss" not in before
    assert all(score.name in after for score in SCORES)


def test_metrics_are_json_with_null_for_what_is_not_there(tmp_path):
    path = write_metrics(tmp_path, {"scores": scores_to_dict(SCORES)})
    back = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert back["scores"]["occupied_f1"] == {"value": None, "unit": "1", "n": 0}
    assert back["scores"]["camera_height_m"] == {"value": 1.6512, "unit": "m", "n": 100}


def test_a_bare_nan_in_metrics_is_refused_and_leaves_the_old_file(tmp_path):
    path = write_metrics(tmp_path, {"scores": {}})
    before = path.read_text()
    with pytest.raises(ValueError, match="JSON"):
        write_metrics(tmp_path, {"value": float("nan")})
    assert path.read_text() == before
    assert [each.name for each in tmp_path.iterdir()] == ["metrics.json"]
