"""The experiment on the motion error, from the command to its run folder: one surface, few runs."""

import csv
import re

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulated robot needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone

from experiments.__main__ import app
from experiments.motion import MotionConfig
from experiments.motion_course import WAYS, drawn_faults, drive, faulty_runs
from sim.robot.wheel_faults import WheelFaults
from stereogrid.cli import run as run_command
from stereogrid.config import load_config, save_config
from stereogrid.motion import FitOptions, MotionError, Runs, fit_motion, read_runs

CONFIG = MotionConfig(surfaces=("vinyl",), bumpy=(), faults=("good",), count=4, sets=2, resamples=200)


@pytest.fixture(scope="module")
def courses():
    return [drive("vinyl", way) for way in WAYS]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motion")
    save_config(CONFIG, folder / "config.toml")
    arguments = ["--config", folder / "config.toml", "--runs", folder / "runs"]
    assert run_command(app, ["motion", *map(str, arguments)]) == 0
    return folder / "runs" / "latest"


def test_the_run_folder_holds_runs_that_the_command_reads_and_fits_that_the_mapper_reads(finished):
    assert load_config(MotionConfig, finished / "config.toml") == CONFIG
    runs = read_runs(finished / "runs-good.csv")
    assert sorted(run.kind for run in runs) == ["straight"] * 4 + ["turn"] * 4
    again = fit_motion(runs, np.random.default_rng(0), FitOptions(resamples=100)).error
    kept = load_config(MotionError, finished / "motion-good-vinyl.toml")
    assert again.along.sigma(5.0) == pytest.approx(kept.along.sigma(5.0), rel=1e-2)
    assert again.turn.sigma(6.28) == pytest.approx(kept.turn.sigma(6.28), rel=1e-2)


def test_every_set_and_parameter_is_in_the_tidy_file_beside_what_was_injected(finished):
    with (finished / "recovery.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * 16
    injected = {(row["part"], row["name"]): float(row["injected"]) for row in rows if row["name"] in ("a", "b")}
    assert injected["along", "b"] == CONFIG.injected.along.b
    assert all(float(row["low"]) <= float(row["high"]) for row in rows)


def test_the_report_stands_alone(finished):
    report = (finished / "report.html").read_text()
    assert stands_alone(report)
    assert report.count("data:image/png;base64,") == len(list(finished.glob("*.png"))) == 3
    assert "| along b | 1 | 0.01 |" in (finished / "tables.md").read_text()


def test_the_robot_goes_past_all_its_marks_and_its_own_odometry_errs_little(courses):
    for course in courses:
        assert len(course.marks) == (5 if course.turns else 6)
        reached = course.reached[list(course.marks)]
        np.testing.assert_allclose(reached, np.arange(len(reached)) * (np.pi / 2 if course.turns else 1), atol=0.02)
    runs = Runs(tuple(faulty_runs(courses, WheelFaults(), 4, np.random.default_rng(0))))
    fit = fit_motion(runs, np.random.default_rng(0), FitOptions(resamples=100))
    assert fit.parts["along"].sigma < 0.001
    assert abs(fit.parts["along"].bias) < 0.001
    assert abs(fit.parts["turn"].bias) < 0.01


def test_bumps_make_runs_differ_and_the_same_bumps_do_not(courses):
    first, again, other = (drive("grass", "forth", bumps=bumps) for bumps in (0, 0, 1))
    np.testing.assert_array_equal(first.wheels_rad, again.wheels_rad)
    turned = [abs(each.wheels_rad[each.marks[-1]].mean()) for each in (courses[0], first, other)]
    assert np.ptp(turned) > 1e-3 * turned[0]
    assert first.surface == "grass, bumpy"


def test_radii_that_err_anew_each_run_are_found_as_what_each_run_keeps(courses):
    """Both by 1 %: the way by .01 / sqrt(2), the heading of straight runs by .01 sqrt(2) over the track."""
    faults = WheelFaults(left_radius=0.01, right_radius=0.01)
    runs = Runs(tuple(faulty_runs(courses, faults, 100, np.random.default_rng(1))))
    error = fit_motion(runs, np.random.default_rng(0), FitOptions(resamples=100)).error
    assert error.along.b == pytest.approx(0.01 / np.sqrt(2), rel=0.25)
    assert error.heading.b == pytest.approx(0.01 * np.sqrt(2) / 0.588, rel=0.25)
    assert error.along.a < 1e-6


def test_faults_are_drawn_anew_for_each_run_about_none():
    rng = np.random.default_rng(2)
    drawn = [drawn_faults(WheelFaults(left_radius=0.01, track=0.05, slip=0.02), rng) for _ in range(400)]
    radii = [each.left_radius for each in drawn]
    assert np.mean(radii) == pytest.approx(0, abs=0.002)
    assert np.std(radii) == pytest.approx(0.01, rel=0.15)
    assert {each.right_radius for each in drawn} == {0.0}
    assert {each.slip for each in drawn} == {0.02}


@pytest.mark.parametrize(
    ("arguments", "named"),
    [(["--surfaces", "vinyl,moon"], "no surface named 'moon'; choose from: .*vinyl")],
)
def test_what_there_is_not_is_refused_in_one_line(arguments, named, tmp_path, capsys):
    assert run_command(app, ["motion", *arguments, "--runs", str(tmp_path / "runs")]) == 1
    assert re.fullmatch(f"error: .*{named}.*\n", capsys.readouterr().err)
    assert not (tmp_path / "runs").exists()
