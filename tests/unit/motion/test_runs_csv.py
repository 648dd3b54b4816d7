"""A file of runs is read in whatever units its columns say, and what is wrong with it is named by row and column."""

import re
from pathlib import Path

import numpy as np
import pytest
from marked_runs import noisy_runs

from stereogrid.errors import InvalidInputError
from stereogrid.motion import (
    FitOptions,
    Growth,
    MotionError,
    Run,
    Runs,
    append_readings,
    fit_motion,
    read_runs,
    write_runs,
)

HEADER = "run,odo_x_m,odo_y_m,odo_heading_rad,true_x_m,true_y_m,true_heading_rad"
ROWS = ["1,0,0,0,0,0,0", "1,1.01,0.02,0.01,1,0,0", "1,2.02,0.05,0.02,2,0,0"]


@pytest.fixture
def written(tmp_path):
    def write(header, rows, encoding="utf-8"):
        path = tmp_path / "runs.csv"
        path.write_text("\n".join([header, *rows]) + "\n", encoding=encoding)
        return path

    return write


def test_what_is_written_is_read_to_the_micrometre(tmp_path):
    error = MotionError(along=Growth(2e-4, 0.01), heading=Growth(2e-4, 0.01), turn=Growth(1e-3, 0.03))
    runs = noisy_runs(error, 3, np.random.default_rng(0), turns=3)
    write_runs(tmp_path / "runs.csv", runs)
    again = read_runs(tmp_path / "runs.csv")
    assert [run.name for run in again] == [run.name for run in runs]
    for one, other in zip(runs, again, strict=True):
        np.testing.assert_allclose(other.odo, one.odo, atol=5.1e-7)
        np.testing.assert_allclose(other.true, one.true, atol=5.1e-7)


def test_units_stand_in_the_names_of_the_columns_which_may_come_in_any_order(written):
    header = "true_heading_deg,surface,odo_x_mm,odo_y_cm,run,odo_heading_deg,true_x_cm,true_y_m"
    runs = read_runs(written(header, ["0,tiles,0,0,a,0,0,0", "3,tiles,1010,2,a,5,100,0.01"], "utf-8-sig"))
    (run,) = runs
    np.testing.assert_allclose(run.odo[1], [1.01, 0.02, np.radians(5)])
    np.testing.assert_allclose(run.true[1], [1.0, 0.01, np.radians(3)])
    assert (run.name, run.surface, runs.surfaces) == ("a", "tiles", ("tiles",))


def test_the_example_of_the_documents_is_read_as_three_straight_runs(written):
    document = (Path(__file__).parents[3] / "docs" / "motion.md").read_text()
    header, *rows = re.search(r"```csv\n(.*?)```", document, re.DOTALL)[1].splitlines()
    runs = read_runs(written(header, rows))
    assert [(run.kind, run.surface, round(run.length_m, 2)) for run in runs] == [("straight", "tiles", 2.0)] * 3
    fit = fit_motion(runs, np.random.default_rng(0), FitOptions(resamples=100))
    assert 0.002 < fit.error.along.sigma(2.0) < 0.05


def test_headings_may_be_absent(written):
    (run,) = read_runs(written("run,odo_x_m,odo_y_m,true_x_m,true_y_m", ["1,0,0,0,0", "1,1.01,0,1,0"]))
    assert not run.has_headings
    assert run.kind == "straight"


def test_runs_of_one_name_on_two_surfaces_are_two(written):
    rows = [f"{surface},{row}" for surface in ("tiles", "grass") for row in ROWS]
    runs = read_runs(written("surface," + HEADER, rows))
    assert [str(run) for run in runs] == ["run 1 on tiles", "run 1 on grass"]
    assert len(runs.on("grass")) == 1
    with pytest.raises(InvalidInputError, match="no run on the surface 'ice'; choose from: 'tiles', 'grass'"):
        runs.on("ice")


def test_a_run_may_begin_anywhere(written):
    rows = ["1,500.5,-2,3,7000,20,3", "1,501.5,-2,3,7001,20,3"]
    (run,) = read_runs(written(HEADER, rows))
    assert run.length_m == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("header", "rows", "named"),
    [
        (HEADER.replace("odo_y_m,", ""), ["1,0,0,0,0,0"], "missing column odo_y_m or odo_y_cm or odo_y_mm"),
        (HEADER.replace("run,", "surface,"), ROWS, "missing column 'run'"),
        (HEADER.replace(",true_heading_rad", ""), [], "missing column true_heading_rad or true_heading_deg"),
        (HEADER.replace("odo_x_m", "odom_x_m"), ROWS, "unknown column 'odom_x_m'; did you mean 'odo_x_m'?"),
        (HEADER.replace("odo_x_m", "odo_x"), ROWS, "unknown column 'odo_x'; did you mean 'odo_x_m"),
        (HEADER + ",odo_x_mm", ROWS, "more than one column holds odo_x"),
        (HEADER + ",run", [row + ",1" for row in ROWS], "a column is there twice"),
        (HEADER, [ROWS[0], "1,abc,0,0,1,0,0"], "row 3, column odo_x_m: 'abc' is not a number"),
        (HEADER, [ROWS[0], "1,,0,0,1,0,0"], "row 3, column odo_x_m: '' is not a number"),
        (HEADER, [ROWS[0], "1,nan,0,0,1,0,0"], "row 3, column odo_x_m: 'nan' is not a number"),
        (HEADER, [ROWS[0], "1,1,0,0,1,0"], "row 3 has 6 values, but there are 7 columns"),
        (HEADER, [ROWS[0], ",1,0,0,1,0,0"], "row 3: no name or number of the run"),
        (HEADER, [*ROWS, "1,5000,0,0,5,0,0"], "row 5, column odo_x_m: 5000 m .*too far; mm, it seems: .*_mm"),
        (HEADER, [*ROWS, "1,500,0,0,5,0,0"], "row 5, column odo_x_m: 500 m .*too far; cm or mm, it seems: .*_cm or"),
        (HEADER, [ROWS[0], "1,0,0,0.03,0,0,1.57"], r"row 3 \(run 1\): odometry has turned by 1.72 degrees .* by 90"),
        (HEADER, [*ROWS, "1,3,0,90,3,0,0"], "row 5, column odo_heading_rad: 90 rad is no heading; degrees, it seems"),
        (HEADER, [ROWS[0], "1,80,0,0,1,0,0"], r"row 3 \(run 1\): odometry says 80 m from the start and the truth 1 m"),
        (HEADER, [ROWS[0], "1,1,0,2,1,0,0"], r"row 3 \(run 1\): odometry's heading is off by 2.00 rad.*degrees\?"),
        (HEADER, [ROWS[0]], "run 1 has one row, which is its start"),
        (HEADER, [ROWS[0], ROWS[2], ROWS[1]], r"row 4 \(run 1\): the mark is not beyond the one before it"),
        (HEADER, [ROWS[0], ROWS[1], ROWS[1]], r"row 4 \(run 1\): the mark is not beyond the one before it"),
        (
            HEADER,
            [ROWS[0], "1,0,0,3,0,0,3"],
            r"row 3 \(run 1\): the heading turns by 172 degrees .*up to 150: mark more often",
        ),
        (HEADER.replace(",", ";"), ROWS, "columns must be separated by commas"),
    ],
)
def test_what_is_wrong_is_named_with_its_row_and_column(written, header, rows, named):
    with pytest.raises(InvalidInputError, match=f"runs.csv: .*{named}"):
        read_runs(written(header, rows))


def test_an_empty_file_and_none_are_refused(tmp_path):
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(InvalidInputError, match=r"empty.csv: is empty; its first row must name the columns"):
        read_runs(tmp_path / "empty.csv")
    with pytest.raises(InvalidInputError, match=r"none.csv: cannot be read \(No such file"):
        read_runs(tmp_path / "none.csv")
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00run")
    with pytest.raises(InvalidInputError, match=re.escape("bytes.csv: ")):
        read_runs(tmp_path / "bytes.csv")


@pytest.mark.parametrize(
    ("odo", "true", "named"),
    [
        (np.zeros((2, 2)), np.zeros((2, 3)), r"odo must be \(1 \+ marks, 3\), not \(2, 2\)"),
        (np.zeros((2, 3)), np.zeros((3, 3)), "2 readings of odometry, but 3 of the truth"),
        (np.full((2, 3), np.nan), np.zeros((2, 3)), "x and y of odo must be finite"),
    ],
)
def test_a_run_that_does_not_pair_is_refused(odo, true, named):
    with pytest.raises(InvalidInputError, match=f"run 7: {named}"):
        Run("7", odo, true)


def test_a_run_is_straight_or_on_the_spot_or_neither():
    def run(x_m, heading_rad):
        ends = np.array([[0, 0, 0], [x_m, 0, heading_rad]])
        return Run("1", ends, ends)

    assert run(5.0, 0.1).kind == "straight"
    assert run(0.05, 1.5).kind == "turn"
    assert run(5.0, 1.5).kind == run(0.05, 0.1).kind == ""
    assert [each.kind for each in Runs((run(5.0, 0.1), run(0.0, -1.5)))] == ["straight", "turn"]


def measured_run(name="4", surface="", marks=2):
    rows = np.arange(marks + 1)[:, None] * [[1.0, 0.01, 0.02]]
    return Run(name, rows * 1.01, rows, surface=surface)


def test_readings_are_appended_in_the_columns_and_units_of_the_file(written):
    path = written("true_heading_deg,surface,odo_x_mm,odo_y_cm,run,odo_heading_deg,true_x_cm,true_y_m", [])
    path.write_text(path.read_text() + "0,tiles,0,0,a,0,0,0\n3,tiles,1010,2,a,5,100,0.01")
    before = path.read_text()
    append_readings(path, measured_run(surface="tiles"))
    assert path.read_text().startswith(before + "\n")
    first, second = read_runs(path)
    assert first.name == "a"
    np.testing.assert_allclose(second.odo, measured_run().odo, atol=1e-5)
    np.testing.assert_allclose(second.true, measured_run().true, atol=1e-5)


def test_a_run_may_be_appended_mark_by_mark(tmp_path):
    path = tmp_path / "runs.csv"
    for marks in (1, 2, 3):
        append_readings(path, measured_run(marks=marks), 0 if marks == 1 else marks)
        (run,) = read_runs(path)
        np.testing.assert_allclose(run.true, measured_run(marks=marks).true, atol=1e-5)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (f"{HEADER}\n" + "\n".join(ROWS), "has no column 'surface', and run 4 on tiles names one"),
        ("hello\n", "runs.csv: its first row must name the columns"),
        (f"{HEADER}\n1,0,0,0,0,0\n", "row 2 has 6 values"),
    ],
)
def test_a_file_that_cannot_take_readings_is_left_as_it_is(tmp_path, content, named):
    path = tmp_path / "runs.csv"
    path.write_text(content)
    with pytest.raises(InvalidInputError, match=named):
        append_readings(path, measured_run(surface="tiles"))
    assert path.read_text() == content
