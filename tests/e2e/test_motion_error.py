"""The command from a file of runs to motion.toml and a figure, and from bad input to one line."""

import re

import cv2
import numpy as np
import pytest
from marked_runs import noisy_runs

from stereogrid import cli
from stereogrid.config import load_config
from stereogrid.motion import Growth, MotionError, write_runs
from stereogrid.motion.parameters import HEADER

ERROR = MotionError(
    along=Growth(2e-4, 0.01), across=Growth(1e-4, 0.004), heading=Growth(2e-4, 0.01), turn=Growth(1e-3, 0.03)
)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    path = tmp_path_factory.mktemp("runs") / "runs.csv"
    write_runs(path, noisy_runs(ERROR, 12, np.random.default_rng(0), turns=12, steps=2))
    return path


def command(*arguments):
    return cli.run(cli.app, ["motion-error", *map(str, arguments)])


def test_a_file_of_runs_becomes_a_table_a_config_for_the_mapper_and_a_figure(runs, tmp_path, capsys):
    out, figure = tmp_path / "motion.toml", tmp_path / "motion.png"
    assert command(runs, "--out", out, "--figure", figure, "--way", "pose") == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in HEADER)
    assert re.search(r"along +b +[\d.e-]+ +[\d.e-]+ to [\d.e-]+ +1 +12", shown)
    assert "12 runs know a sigma to about 21 %" in shown
    assert "warning" not in shown
    error = load_config(MotionError, out)
    assert error.way == "pose"
    for part in ("along", "across", "heading"):
        assert getattr(error, part).sigma(5.0) == pytest.approx(getattr(ERROR, part).sigma(5.0), rel=0.6)
    assert error.turn.sigma(6.28) == pytest.approx(ERROR.turn.sigma(6.28), rel=0.6)
    picture = cv2.imread(str(figure))
    assert min(picture.shape[:2]) > 500
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100


def test_the_same_file_gives_the_same_bytes(runs, tmp_path):
    for name in ("one", "two"):
        assert command(runs, "--out", tmp_path / f"{name}.toml", "--figure", tmp_path / f"{name}.png") == 0
    for suffix in (".toml", ".png"):
        assert (tmp_path / f"one{suffix}").read_bytes() == (tmp_path / f"two{suffix}").read_bytes()


def test_a_truth_that_was_measured_badly_leaves_less_for_the_robot(runs, tmp_path):
    assert command(runs, "--out", tmp_path / "exact.toml") == 0
    assert command(runs, "--out", tmp_path / "measured.toml", "--truth-mm", "8", "--truth-deg", "0.5") == 0
    exact, measured = (load_config(MotionError, tmp_path / f"{name}.toml") for name in ("exact", "measured"))
    assert measured.along.a < 0.7 * exact.along.a
    assert measured.heading.a < 0.8 * exact.heading.a


def with_lines(runs, tmp_path, change):
    path = tmp_path / "changed.csv"
    path.write_text("\n".join(change(runs.read_text().splitlines())) + "\n")
    return path


def reversed_odometry(lines):
    """As if the sign of x and y were wrong."""
    rows = [line.split(",") for line in lines[1:]]
    return [lines[0], *(",".join([*row[:2], *(f"{-float(v):g}" for v in row[2:4]), *row[4:]]) for row in rows)]


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda lines: [lines[0].replace("odo_y_m", "odo_z_m"), *lines[1:]], "unknown column 'odo_z_m'; did you mean"),
        (lambda lines: [line.rsplit(",", 1)[0] for line in lines], "missing column true_heading_rad"),
        (lambda lines: [*lines, "s0,,9000,0,0,6,0,0"], "row 134, column odo_x_m: 9000 m .* mm, it seems"),
        (lambda lines: [*lines, "t0,,0,0,90,0,0,7"], "row 134, column odo_heading_rad: 90 rad .* degrees, it seems"),
        (lambda lines: lines[:13], "2 straight runs and 0 turns on the spot: at least 3 of a kind"),
        (lambda lines: lines[:1], "changed.csv: names its columns, but has no rows"),
        (lambda lines: lines[1:], "its first row must name the columns; choose from: run, surface"),
        (lambda lines: ["," + lines[0], *lines[1:]], "column 1 has no name"),
        (lambda lines: [lines[0].upper(), *lines[1:]], "first row must name the columns"),
        (lambda lines: [lines[0].replace("odo_x_m", "Odo_X_m"), *lines[1:]], "did you mean 'odo_x_m'"),
        (lambda lines: [line.replace(",", "\t") for line in lines], r"separated by commas, not by '\\t'"),
        (
            lambda lines: [*lines, *lines[1:]],
            "row 134 .run s0.: the mark is not beyond .* shares its name with no other",
        ),
        (reversed_odometry, "row 7 .run s0.: odometry goes 17. degrees beside the truth, seen from the headings"),
        (lambda lines: [*lines[:3], "s0,,x,0,0,6,0,0"], "row 4, column odo_x_m: 'x' is not a number"),
    ],
)
def test_bad_runs_get_one_line_and_write_nothing(runs, tmp_path, capsys, change, named):
    out = tmp_path / "motion.toml"
    assert command(with_lines(runs, tmp_path, change), "--out", out) == 1
    assert re.fullmatch(f"error: .*{named}.*\n", capsys.readouterr().err)
    assert not out.exists()


def test_runs_of_one_mark_and_one_length_are_fitted_and_warned_of(runs, tmp_path, capsys):
    def ends(lines):
        runs = [line.split(",")[0] for line in lines[1:]]
        first_or_last = [
            n for n in range(len(runs)) if runs[n - 1 : n] != [runs[n]] or runs[n + 1 : n + 2] != [runs[n]]
        ]
        return [lines[0], *(lines[1 + n] for n in first_or_last if runs[n].startswith("s"))]

    assert command(with_lines(runs, tmp_path, ends), "--out", tmp_path / "motion.toml") == 0
    assert "warning: the straight runs have one mark each, all at one length" in capsys.readouterr().out
    error = load_config(MotionError, tmp_path / "motion.toml")
    assert error.along.a == 0
    assert error.along.b > 0


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--way", "often"], "no way to use the motion error named 'often'"),
        (["--bootstrap", "twice"], "no bootstrap named 'twice'"),
        (["--surface", "ice"], "no run on the surface 'ice'"),
        (["--truth-mm", "-1"], "position_m must be >= 0"),
        (["--out", "nowhere/motion.toml"], "nowhere: no such folder"),
        (["--figure", "motion.svg"], "motion.svg: the figure is a .png"),
    ],
)
def test_options_that_cannot_be_get_one_line(runs, capsys, arguments, named):
    assert command(runs, *arguments) == 1
    assert re.fullmatch(f"error: .*{named}.*\n", capsys.readouterr().err)


def test_runs_are_not_written_over_nor_one_result_by_the_other(runs, tmp_path, capsys):
    before = runs.read_bytes()
    both = tmp_path / "both.png"
    for arguments in (["--out", runs], ["--out", both, "--figure", both]):
        assert command(runs, *arguments) == 1
        assert re.fullmatch("error: .*is named twice, and would be written over\n", capsys.readouterr().err)
    assert runs.read_bytes() == before
    assert not both.exists()


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_a_file_in_another_encoding_is_named(runs, tmp_path, capsys, encoding):
    path = tmp_path / "changed.csv"
    path.write_text(runs.read_text().replace("s0,", "Füße,"), encoding=encoding)
    assert command(path) == 1
    assert re.fullmatch("error: .*changed.csv: is no text in UTF-8; .*\n", capsys.readouterr().err)


def test_without_headings_odometry_and_truth_must_be_along_the_same_axes(runs, tmp_path, capsys):
    def turned_round(lines):
        """Each run's odometry begins at zero, whichever way it drives."""
        cells = [line.split(",") for line in lines if not line.startswith("t")]
        kept = [[*row[:4], *row[5:7]] for row in cells]
        return [",".join(kept[0]), *(",".join([*row[:4], f"{-float(row[4]):g}", row[5]]) for row in kept[1:])]

    assert command(with_lines(runs, tmp_path, turned_round)) == 1
    assert "without headings both must be along the same axes" in capsys.readouterr().err
