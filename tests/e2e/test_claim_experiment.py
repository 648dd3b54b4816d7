"""The test of the claim, from the command to its run folder: half a metre of one world, two seeds, two ways."""

import csv
import re
import shutil
from dataclasses import replace

import pytest

pytest.importorskip("pybullet", reason="the simulated drive needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone

from experiments import claim as claim_module
from experiments.__main__ import app
from experiments.claim import TOLD_ZERO
from experiments.claim_config import NOISES, ClaimConfig, TuneConfig, arm_of
from experiments.claim_units import ANY, CONTROLS, PRIOR, SHUFFLED, TRUE_DEPTH
from stereogrid.cli import INTERRUPTED
from stereogrid.cli import run as run_command
from stereogrid.config import load_config, save_config

CONFIG = ClaimConfig(
    worlds=("corridor",),
    n_seeds=2,
    bound_seeds=2,
    control_seeds=1,
    distance_m=0.5,
    width_px=160,
    height_px=120,
    noises=(NOISES[1], replace(NOISES[3], most_seeds=0)),
    arms=(arm_of("none"), arm_of("rss")),
)
CONFIG = replace(CONFIG, mapping=replace(CONFIG.mapping, grid=replace(CONFIG.mapping.grid, cell_m=0.2)))
N_UNITS = 2 * 2 * 2 * (2 + 1) + 2 * (3 + 2)


def in_process(*arguments):
    return run_command(app, list(map(str, arguments)))


@pytest.fixture
def made(monkeypatch):
    """The units that are computed, one by one; the test may raise in between."""
    seen, real = [], claim_module.scores_of

    def counting(scene, task, track):
        seen.append(task)
        if counting.before is not None:
            counting.before(task)
        return real(scene, task, track)

    counting.before = None
    monkeypatch.setattr(claim_module, "scores_of", counting)
    return counting, seen


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("claim")
    save_config(CONFIG, folder / "config.toml")
    options = ("--work", folder / "work", "--runs", folder / "runs", "--publish", folder / "docs")
    assert in_process("claim", "--config", folder / "config.toml", *options) == 0
    return folder


@pytest.fixture
def afresh(finished, tmp_path):
    """Options for a run that has the drive, and nothing else."""
    shutil.copytree(finished / "work" / "drives", tmp_path / "work" / "drives")
    return ("--config", finished / "config.toml", "--work", tmp_path / "work", "--runs", tmp_path / "runs")


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_every_unit_has_its_scores(finished):
    rows = read(finished / "runs" / "latest" / "claim.csv")
    assert list(rows[0]) == ["world", "noise", "seed", "fusion", "way", "score", "value", "unit", "n"]
    auc = {
        (r["noise"], r["seed"], r["fusion"], r["way"]): float(r["value"] or "nan") for r in rows if r["score"] == "auc"
    }
    for noise in ("drift", "perfect"):
        for seed in "12":
            for fusion in CONFIG.fusions:
                for way in CONFIG.by_arm:
                    assert 0.5 < auc[noise, seed, fusion, way] <= 1
    assert {key[3] for key in auc if key[0] == CONTROLS} == {
        TRUE_DEPTH,
        SHUFFLED,
        PRIOR,
        *(TOLD_ZERO + way for way in CONFIG.by_arm),
    }
    bound = [r for r in rows if r["score"] == "bound_coverage_along"]
    assert len(bound) == 2 * 2 * 2 and {r["fusion"] for r in bound} == {ANY}


def test_the_arms_are_other_maps_and_controls_are_as_they_must_be(finished):
    rows = read(finished / "runs" / "latest" / "claim.csv")
    loss = {(r["noise"], r["seed"], r["fusion"], r["way"]): r["value"] for r in rows if r["score"] == "log_loss"}
    assert loss["drift", "1", "cell", "rss"] != loss["drift", "1", "cell", "none"] != loss["drift", "2", "cell", "none"]
    assert loss["perfect", "1", "cell", "none"] != loss["perfect", "2", "cell", "none"]  # the cameras' noise
    assert loss["drift", "1", "cell", "none"] != loss["drift", "1", "sum_of_rays", "none"]
    zero = [loss[CONTROLS, "1", "cell", TOLD_ZERO + way] for way in CONFIG.by_arm]
    assert zero[0] == zero[1] == loss["perfect", "1", "cell", "none"]
    chance = [r["value"] for r in rows if r["way"] == PRIOR and r["score"] == "auc_all"]
    assert chance == ["0.5", "0.5"]


def test_calibration_over_the_seeds_is_a_file_too_and_is_published(finished):
    rows = read(finished / "runs" / "latest" / "calibration.csv")
    assert len(rows) == 2 * 2 * 2 * 2  # noises, rules of fusion, ways; the world and the mean over it
    assert all(0 < float(row["ece"]) < 1 and int(row["n"]) == 2 for row in rows)
    assert {(row["difference"], row["low"]) for row in rows if row["way"] == "none"} == {("0", "0")}
    assert (finished / "docs" / "calibration.csv").read_bytes() == (
        finished / "runs" / "latest" / "calibration.csv"
    ).read_bytes()


def test_the_summary_holds_a_line_a_difference(finished):
    rows = read(finished / "runs" / "latest" / "summary.csv")
    found = [r for r in rows if (r["noise"], r["fusion"], r["way"], r["score"]) == ("drift", "cell", "rss", "auc")]
    assert [r["world"] for r in found] == ["corridor", "these worlds", "worlds like these"]
    units = read(finished / "runs" / "latest" / "claim.csv")
    auc = {
        (r["seed"], r["way"]): float(r["value"])
        for r in units
        if (r["noise"], r["fusion"], r["score"]) == ("drift", "cell", "auc")
    }
    mean = sum(auc[seed, "rss"] - auc[seed, "none"] for seed in "12") / 2
    assert float(found[0]["difference"]) == pytest.approx(mean, rel=1e-4)


def test_the_report_stands_alone_and_what_is_published_is_small(finished):
    folder, docs = finished / "runs" / "latest", finished / "docs"
    assert load_config(ClaimConfig, folder / "config.toml") == CONFIG
    report = (folder / "report.html").read_text()
    assert stands_alone(report)
    pictures = {"coverage.png", "differences-cell.png", "differences-sum_of_rays.png"}
    assert {path.name for path in folder.glob("*.png")} == pictures
    assert {path.name for path in docs.iterdir()} == {
        *pictures,
        "claim.csv",
        "summary.csv",
        "calibration.csv",
        "config.toml",
    }
    assert max(path.stat().st_size for path in docs.iterdir()) < 300_000


def test_stopped_and_started_again_it_goes_on_where_it_was(finished, afresh, made, capsys, tmp_path):
    counting, seen = made

    def stop(task):
        if len(seen) >= 12:
            raise KeyboardInterrupt

    counting.before = stop
    assert in_process("claim", *afresh) == INTERRUPTED
    assert not (tmp_path / "runs").exists()
    kept = len(list((tmp_path / "work" / "units").glob("*.json")))
    assert 10 <= kept < 14
    counting.before = None
    seen.clear()
    assert in_process("claim", *afresh) == 0
    assert len(seen) == N_UNITS - kept
    again, before = (f / "runs" / "latest" / "claim.csv" for f in (tmp_path, finished))
    assert again.read_bytes() == before.read_bytes()
    seen.clear()
    assert in_process("claim", *afresh) == 0
    assert not seen


def test_a_unit_that_fails_is_named_and_does_not_lose_the_rest(afresh, made, capsys, tmp_path):
    counting, _ = made

    def fail(task):
        if (task.kind, task.seed, task.mapping.motion_error.way, task.mapping.grid.fusion) == ("map", 2, "rss", "cell"):
            raise ValueError("no such luck")

    counting.before = fail
    assert in_process("claim", *afresh) == 0
    assert "failed: corridor, drift, seed 2, cell, rss: ValueError: no such luck" in capsys.readouterr().err
    report = (tmp_path / "runs" / "latest" / "report.html").read_text()
    assert "2 units failed and are left out" in report and "no such luck" in report
    assert len(list((tmp_path / "work" / "units").glob("*.json"))) == N_UNITS - 2


def test_where_every_unit_fails_there_is_one_line_and_no_run(afresh, made, capsys, tmp_path):
    counting, _ = made

    def fail(task):
        raise ValueError("no such luck")

    counting.before = fail
    assert in_process("claim", *afresh) == 1
    assert re.search("error: no unit could be made.*no such luck", capsys.readouterr().err)
    assert not (tmp_path / "runs").exists()


def test_candidates_are_tried_on_worlds_that_are_not_scored(finished, tmp_path, capsys):
    candidates = TuneConfig(worlds=("corridor",), kept_apart=("office",), n_seeds=1, noises=NOISES[1:2])
    fields = ("distance_m", "width_px", "height_px", "mapping", "arms")
    candidates = replace(candidates, **{name: getattr(CONFIG, name) for name in fields})
    save_config(candidates, tmp_path / "tune.toml")
    options = ("--work", finished / "work", "--runs", tmp_path / "runs")
    assert in_process("claim-tune", "--config", tmp_path / "tune.toml", *options) == 0
    rows = read(tmp_path / "runs" / "latest" / "candidates.csv")
    assert {(r["noise"], r["candidate"]) for r in rows} == {("drift", "none"), ("drift", "rss")}
    assert {r["score"] for r in rows} >= {"auc_all", "log_loss_all", "ece_width_all", "log_loss_balanced"}
    assert all(0 < float(r["mean"]) < 2 for r in rows)
    (tmp_path / "tune.toml").write_text('worlds = ["office"]\n')
    assert in_process("claim-tune", "--config", tmp_path / "tune.toml", *options) == 1
    assert "office: a world is for tuning or for the claim, never for both" in capsys.readouterr().err


def test_a_folder_that_cannot_be_published_to_is_refused_before_any_work(afresh, tmp_path, made, capsys):
    _, seen = made
    (tmp_path / "file").touch()
    assert in_process("claim", *afresh, "--publish", tmp_path / "file" / "docs") == 1
    assert re.fullmatch("error: .*docs: nothing can be written there .*\n", capsys.readouterr().err)
    assert not seen
