"""The error budget, from the command to its run folder and in its parts, on a drive of three small pairs."""

import csv
import json
import re
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulated drive needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone
from small_drives import small_drive

from experiments.__main__ import app
from experiments.budget import BudgetConfig, TrueDrive, make_maps
from experiments.budget_arms import CAUSES, EVERY, IDEAL, REAL, Arm, budget_arms, made_real, made_true
from experiments.budget_oracles import Labelled, Recalibrated
from experiments.budget_report import ERRORS, Budget
from experiments.drives import true_disparity
from experiments.faulty_drive import FaultyDrive, displaced_disparity
from sim.faults import CameraFaults, FaultyCameras, camera_faults
from sim.faults.optics import unknown_rotation
from stereogrid.cli import run as run_command
from stereogrid.config import GridConfig, MatcherConfig, load_config, save_config
from stereogrid.errors import StereogridError
from stereogrid.mapping_run import build_map, untracked
from stereogrid.recording import TruePoses, open_recording
from stereogrid.scoring import Score

CONFIG = BudgetConfig(worlds=("corridor",), n_seeds=2, camera_faults="mild", finest=0)
CONFIG = replace(CONFIG, mapping=replace(CONFIG.mapping, matcher=MatcherConfig("bm", 32), grid=GridConfig(cell_m=0.1)))
FAULTS = camera_faults("mild, drop_share=0.5")


def in_process(*arguments):
    return run_command(app, ["budget", *map(str, arguments)])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return small_drive(tmp_path_factory.mktemp("drive") / "drive.mcap")


@pytest.fixture(scope="module")
def drive(path):
    return open_recording(path)


@pytest.fixture(scope="module")
def true_drive(drive):
    return TrueDrive.of(drive, CONFIG)


@pytest.fixture(scope="module")
def grid(drive):
    return build_map(TruePoses(FaultyCameras(drive, camera_faults("mild"), 1)), CONFIG.mapping).grid


@pytest.fixture(scope="module")
def finished(path, tmp_path_factory):
    folder = tmp_path_factory.mktemp("budget")
    save_config(CONFIG, folder / "config.toml")
    options = ("--config", folder / "config.toml", "--recording", path, "--runs", folder / "runs")
    assert in_process(*options) == 0
    return folder / "runs" / "latest"


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def by_name(scores):
    return {score.name: score.value for score in scores}


def test_every_arm_has_its_scores_for_every_unit(finished):
    rows = read(finished / "scores.csv")
    found = {(r["world"], int(r["seed"]), r["arm"]) for r in rows if r["score"] == "log_loss_all" and r["value"]}
    assert found == {("corridor", seed, arm) for seed in (1, 2) for arm in CONFIG.arms}


def test_the_ideal_is_better_than_the_real_and_the_labels_are_best(finished):
    values = {}
    for r in read(finished / "scores.csv"):
        if r["score"] in ("log_loss_all", "auc"):
            values.setdefault((r["score"], r["arm"]), []).append(float(r["value"]))
    assert np.mean(values["log_loss_all", IDEAL]) < np.mean(values["log_loss_all", REAL])
    assert values["auc", f"{IDEAL}, labels"] == values["auc", "all real but labels"] == [1, 1]


def test_the_report_stands_alone_and_the_run_can_be_read_back(finished):
    report = (finished / "report.html").read_text()
    assert stands_alone(report)
    assert report.count("data:image/png;base64,") == 1
    assert load_config(BudgetConfig, finished / "config.toml") == CONFIG


def test_what_a_cause_takes_away_is_what_the_scores_say(finished):
    values = {}
    for r in read(finished / "scores.csv"):
        if r["score"] == "log_loss_all":
            values.setdefault(r["arm"], []).append(float(r["value"]))
    label = "made true, all else real | odometry | log-loss of all cells in view [nat]"
    expected = np.mean(values[REAL]) - np.mean(values["all real but odometry"])
    assert json.loads((finished / "metrics.json").read_text())["budget"][label]["mean"] == pytest.approx(expected)


def test_making_every_cause_true_is_the_ideal_arm():
    arms, left = budget_arms(2, 4), set(EVERY)
    for parts in CAUSES.values():
        left -= set(parts)
    assert arms[IDEAL] == Arm(frozenset(left)) and not left
    assert arms[REAL].real == set(EVERY)
    assert len(set(arms.values())) == len(arms)


def test_who_needs_no_matcher_does_not_see_how_good_the_images_are():
    assert Arm(frozenset({"images", "cells"})).map_made == Arm(frozenset({"cells"})).map_made
    assert Arm(frozenset({"images", "matcher"})).map_made != Arm(frozenset({"matcher"})).map_made


def drawn_budget():
    """Scores at random, of two units."""
    rng, arms = np.random.default_rng(0), budget_arms(2, 0)
    names = {error.score for error in ERRORS}
    scores = {
        arm: {("a", n): [Score(name, rng.random(), "1", 1) for name in sorted(names)] for n in (1, 2)} for arm in arms
    }
    return Budget(scores, arms, 0)


@pytest.mark.parametrize("steps", [made_true(0), made_real()], ids=["made true", "made real"])
@pytest.mark.parametrize("error", ERRORS, ids=lambda error: error.score)
def test_the_parts_of_matching_add_up_to_it(steps, error):
    budget, (whole, *parts) = drawn_budget(), steps[:3]
    assert [part.part for part in parts] == [True, True]
    gaps = [budget.gap(step, error).mean for step in (whole, *parts)]
    assert gaps[0] == pytest.approx(sum(gaps[1:]))


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: error.score)
def test_a_gap_is_positive_where_the_worse_arm_has_more_error(error):
    budget, step = drawn_budget(), made_true(0)[0]
    gap = budget.error(step.worse, error) - budget.error(step.better, error)
    assert budget.gap(step, error).mean == pytest.approx(gap.mean())
    assert budget.by_world(step, error) == {"a": pytest.approx(gap.mean())}


def test_the_ladder_goes_from_all_real_to_all_true_and_then_the_labels():
    rungs = drawn_budget().ladder
    assert [rungs[0][1], rungs[-2][1], rungs[-1][1]] == [REAL, IDEAL, f"{IDEAL}, labels"]
    assert len({arm for _, arm in rungs}) == len(rungs) == len(CAUSES) + 2


def test_the_oracle_of_labels_is_perfect_where_the_map_was_touched(true_drive, grid):
    usual = by_name(true_drive.truth.score(grid, surface=False))
    best = by_name(true_drive.truth.score(Labelled(grid, true_drive.truth.labels), surface=False))
    assert usual["auc"] < 1 and best["auc"] == best["occupied_f1"] == 1
    assert best["log_loss"] == pytest.approx(0, abs=1e-5)
    assert {best[name] for name in ("coverage", "coverage_occupied")} == {usual["coverage"], usual["coverage_occupied"]}
    missed = 1 - usual["coverage"]
    assert best["log_loss_all"] == pytest.approx(missed * np.log(2), rel=1e-3)


def test_recalibration_keeps_the_order_and_no_monotone_change_has_a_lower_log_loss(true_drive, grid):
    truth, best = true_drive.truth, Recalibrated.by(true_drive.truth, grid)
    assert (np.diff(best.frequency) >= 0).all()
    usual, oracle = by_name(truth.score(grid, surface=False)), by_name(truth.score(best, surface=False))
    assert oracle["ece_width"] < 1e-9 < usual["ece_width"]
    assert oracle["coverage"] == usual["coverage"] and oracle["auc"] >= usual["auc"]
    for power in (0.5, 1.0, 1.5):
        other = Recalibrated(grid, best.p, best.p**power)
        assert by_name(truth.score(other, surface=False))["log_loss"] > oracle["log_loss"]


def test_recalibrating_twice_changes_nothing_more(true_drive, grid):
    best = Recalibrated.by(true_drive.truth, grid)
    again = Recalibrated.by(true_drive.truth, best)
    assert again.frequency == pytest.approx(again.p, abs=1e-12)


def test_a_right_camera_that_is_not_turned_displaces_nothing_and_one_that_is_shifts_by_its_angle(drive):
    each, camera = next(iter(drive)), drive.camera
    true = true_disparity(camera, each).disparity_px
    assert np.array_equal(displaced_disparity(camera, each, np.eye(3)).disparity_px, true, equal_nan=True)
    rad = 1e-3
    about_y = np.array([[np.cos(rad), 0, np.sin(rad)], [0, 1, 0], [-np.sin(rad), 0, np.cos(rad)]])
    shifted = displaced_disparity(camera, each, about_y).disparity_px
    # The camera turns to the right, so all it sees moves to the left: by f tan(rad) in the middle of the picture.
    middle = np.s_[:, camera.width_px // 2]
    moved = (shifted - true)[middle]
    assert np.nanmedian(moved) == pytest.approx(camera.focal_px * rad, rel=0.05)


def test_the_displaced_disparity_is_the_one_that_a_matcher_finds_in_such_images(drive):
    faults = replace(CameraFaults(), calibration_error_deg=0.25)
    match, shifts_px = MatcherConfig("bm", 32).build().match, []
    for seed in range(1, 6):
        R = unknown_rotation(faults, seed)
        for each in islice(FaultyCameras(drive, faults, seed), 1):
            true = true_disparity(drive.camera, each).disparity_px
            found = match(each.left, each.right).disparity_px - true
            displaced = displaced_disparity(drive.camera, each, R).disparity_px - true
            shifts_px.append((np.nanmedian(found), np.nanmedian(displaced[~np.isnan(found)])))
    found_px, displaced_px = np.array(shifts_px).T
    assert np.ptp(displaced_px) > 0.3
    assert found_px == pytest.approx(displaced_px, abs=0.06)


def test_with_every_fault_real_the_pairs_are_those_of_the_faulty_cameras(drive):
    seen = FaultyDrive(drive, FAULTS, CONFIG.mapping.motion_error, 2)
    mine = [each for each, _ in seen.readings(MatcherConfig("bm", 32), images=True, calibration=True)]
    theirs = list(FaultyCameras(drive, FAULTS, 2))
    assert [each.stamp_s for each in mine] == [each.stamp_s for each in theirs]
    assert all(np.array_equal(a.right, b.right) for a, b in zip(mine, theirs, strict=True))


def test_with_no_fault_real_the_disparity_is_the_true_one(drive):
    seen = FaultyDrive(drive, FAULTS, CONFIG.mapping.motion_error, 1).readings(None, images=False, calibration=False)
    for each, disparity in seen:
        assert np.array_equal(disparity.disparity_px, true_disparity(drive.camera, each).disparity_px, equal_nan=True)


def test_the_odometry_errs_alike_whatever_pairs_the_cameras_drop_and_true_poses_are_true(drive):
    error = CONFIG.mapping.motion_error
    observations = list(drive)
    whole, dropping = (FaultyDrive(drive, faults, error, 3).poses(true=False) for faults in (CameraFaults(), FAULTS))
    true = FaultyDrive(drive, FAULTS, error, 3).poses(true=True)
    for each in observations:
        assert np.array_equal(whole(each).T_world_cam, dropping(each).T_world_cam)
        assert np.array_equal(true(each).T_world_cam, each.truth.T_world_cam)
    assert not np.allclose(whole(observations[-1]).T_world_cam, observations[-1].T_world_cam, atol=1e-6)


def test_a_map_of_the_budget_is_the_map_that_the_library_makes(drive):
    made = Arm(frozenset({"cells", "fusion"})).map_made
    faulty = FaultyDrive(drive, FAULTS, CONFIG.mapping.motion_error, 1)
    grid = make_maps(faulty, {made}, CONFIG.mapping, untracked)[made]
    plain = replace(CONFIG.mapping, motion_error=type(CONFIG.mapping.motion_error)())
    known = build_map(TruePoses(drive), plain, disparity_of=lambda each: true_disparity(drive.camera, each))
    assert grid.sha256() == known.grid.sha256()


def test_a_map_made_by_pieces_holds_the_last_of_them_too(drive):
    made = Arm(frozenset({"odometry", "cells", "fusion"})).map_made
    mapping = replace(CONFIG.mapping, motion_error=replace(CONFIG.mapping.motion_error, way="submaps", submap_m=100.0))
    faulty = FaultyDrive(drive, FAULTS, mapping.motion_error, 1)
    assert make_maps(faulty, {made}, mapping, untracked)[made].n_known > 1000


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"worlds": ()}, "worlds"),
        ({"worlds": ("office", "office")}, "none twice"),
        ({"worlds": ("attic",)}, "attic.*office"),
        ({"n_seeds": 0}, "n_seeds"),
        ({"camera_faults": "foggy"}, "foggy.*mild"),
        ({"finer": 1}, "finer"),
        ({"finer": 2, "finest": 2}, "finest"),
        ({"obstacles_m": (2.0, 1.0)}, "obstacles_m"),
    ],
)
def test_a_wrong_parameter_is_named_before_anything_is_done(wrong, named):
    with pytest.raises(StereogridError, match=named):
        BudgetConfig(**wrong)


def test_two_drives_of_one_world_are_refused_in_one_line(path, tmp_path, capsys):
    assert in_process("--recording", path, "--recording", path, "--runs", tmp_path / "runs") == 1
    assert re.fullmatch(r"error: .*different worlds, not of corridor, corridor\n", capsys.readouterr().err)
    assert not any((tmp_path / "runs").iterdir())
