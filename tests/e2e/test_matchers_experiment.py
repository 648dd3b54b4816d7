"""The comparison of matchers, from the command to its run folder: a made pair, a drive of 1 m, two seeds."""

import csv
import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulated drive needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone

from experiments.__main__ import app
from experiments.drives import HEADLINE, DriveConfig
from experiments.matchers import MatchersConfig, default_pairs
from stereogrid.cli import run as run_command
from stereogrid.config import load_config, save_config
from stereogrid.errors import StereogridError
from stereogrid.grid import OccupancyGrid
from stereogrid.scoring.paired import paired_difference

SHIFT_PX = 7
CONFIG = MatchersConfig(
    n_seeds=2,
    num_disparities=75,  # of which OpenCV's matchers search 80
    drive=DriveConfig(every_m=0.5, distance_m=1.0),
    contenders={"bm": {}, "sgbm": {"options": {"block_px": 5}}},
)


def write_pair(folder, width=160):
    """A textured plane, SHIFT_PX away from the left image in the right one, as scikit-image lays out Motorcycle."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (90, width + SHIFT_PX, 3), dtype=np.uint8), (0, 0), 1.0)
    cv2.imwrite(str(folder / "imL.png"), wall[:, :width])
    cv2.imwrite(str(folder / "imR.png"), wall[:, SHIFT_PX:])
    np.savez(folder / "disp.npz", disp=np.full((90, width), SHIFT_PX, np.float32))


def command(*arguments, cwd, env=None):
    """The command as a user runs it."""
    clean = {name: value for name, value in os.environ.items() if name != "STEREOGRID_DATA"}
    return subprocess.run(
        [sys.executable, "-m", "experiments", "matchers", *map(str, arguments)],
        cwd=cwd,
        env={**clean, **(env or {})},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory, request):
    folder = tmp_path_factory.mktemp("matchers")
    for name in ("plane", "wide"):
        write_pair(folder / "pairs" / name, width=160 if name == "plane" else 240)
    (folder / "pairs" / "notes").mkdir()
    save_config(replace(CONFIG, most_pixels=160 * 90), folder / "config.toml")
    options = ("--config", folder / "config.toml", "--pairs", folder / "pairs", "--runs", folder / "runs")
    return folder, command(*options, cwd=request.config.rootpath)


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_command_ends_well_and_says_where_its_report_is(finished):
    folder, done = finished
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    report = (folder / "runs" / "latest").resolve() / "report.html"
    assert f"{report.parent.name}/report.html" in done.stdout
    assert re.search(r"plane +bm", done.stdout) and "obstacle_occupied_f1" in done.stdout


def test_every_score_of_every_matcher_pair_and_seed_has_a_line_with_its_unit(finished):
    latest = finished[0] / "runs" / "latest"
    pairs, maps = read(latest / "pairs.csv"), read(latest / "maps.csv")
    assert {(row["pair"], row["matcher"]) for row in pairs} == {
        (pair, name) for pair in ("plane", "wide / 2") for name in ("bm", "sgbm")
    }
    assert {(row["matcher"], row["seed"]) for row in maps} == {(n, s) for n in ("bm", "sgbm") for s in "12"}
    for name in ("auc", "occupied_f1", "obstacle_auc", "obstacle_occupied_f1", "disparity_density"):
        assert sum(row["score"] == name for row in maps) == 4
    assert all(row["unit"] and int(row["n"]) >= 0 for row in pairs + maps)


def test_the_made_plane_is_found_and_timed(finished):
    rows = {
        (r["matcher"], r["score"]): r
        for r in read(finished[0] / "runs" / "latest" / "pairs.csv")
        if r["pair"] == "plane"
    }
    for name in ("bm", "sgbm"):
        assert float(rows[name, "bad_1_0"]["value"]) < 2
        assert float(rows[name, "density"]["value"]) > 80
        assert float(rows[name, "cpu_s"]["value"]) > 0 and rows[name, "cpu_s"]["unit"] == "s"


def test_the_maps_are_maps_and_seeds_differ_though_not_much(finished):
    rows = read(finished[0] / "runs" / "latest" / "maps.csv")
    for name in ("bm", "sgbm"):
        auc = [float(row["value"]) for row in rows if row["matcher"] == name and row["score"] == "auc"]
        assert min(auc) > 0.9
        assert 0 < abs(auc[0] - auc[1]) < 0.02


def test_differences_are_those_of_the_seeds_with_intervals_around_them(finished):
    latest = finished[0] / "runs" / "latest"
    metrics = json.loads((latest / "metrics.json").read_text())
    assert metrics["reference"] == "bm" and set(metrics["differences"]) == {"sgbm"}
    for name in HEADLINE:
        by_seed = [
            [float(r["value"]) for r in read(latest / "maps.csv") if (r["matcher"], r["score"]) == (matcher, name)]
            for matcher in ("sgbm", "bm")
        ]
        expected = paired_difference(*by_seed, rng=np.random.default_rng(0))
        found = metrics["differences"]["sgbm"][name]
        assert found == {"mean": expected.mean, "low": expected.low, "high": expected.high, "n": 2}
        assert found["low"] <= found["mean"] <= found["high"]


def test_the_run_folder_can_be_read_back_and_its_report_stands_alone(finished):
    latest = finished[0] / "runs" / "latest"
    assert load_config(MatchersConfig, latest / "config.toml") == replace(CONFIG, most_pixels=160 * 90)
    assert all(OccupancyGrid.load(latest / f"map-{name}.sgrid").n_known > 1000 for name in ("bm", "sgbm"))
    with np.load(latest / "disparity-plane-bm.npz") as found:
        assert np.nanmedian(found["disparity_px"]) == pytest.approx(SHIFT_PX, abs=0.3)
        assert found["sigma_px"].shape == (90, 160)
    report = (latest / "report.html").read_text()
    assert stands_alone(report)
    pictures = {path.name for path in latest.glob("*.png")}
    assert pictures == {
        *("pairs-quality-time.png", "panels-plane.png", "panels-wide-by-2.png"),
        *("slices.png", "maps-quality-time.png"),
    }
    assert report.count("data:image/png;base64,") == len(pictures)


def test_the_markdown_names_its_command_and_has_a_row_a_matcher_and_pair(finished):
    text = (finished[0] / "runs" / "latest" / "results.md").read_text()
    assert "python -m experiments matchers --config" in text and "2 seeds" in text
    assert re.findall(r"^\| (.*?) \| (bm|sgbm) \| \d", text, re.MULTILINE) == [
        *(("plane", "bm"), ("", "sgbm")),
        *(("wide / 2", "bm"), ("", "sgbm")),
    ]
    assert re.search(r"^\| auc \| [+-]\d\.\d{4} \[[+-]\d\.\d{4}, [+-]\d\.\d{4}\] \|$", text, re.MULTILINE)


# What goes wrong, in this process: the command has been started as users do above.


def in_process(*arguments):
    return run_command(app, ["matchers", *map(str, arguments)])


@pytest.fixture
def drive(finished):
    return finished[0] / "runs" / "latest" / "drive.mcap"


def test_without_pairs_a_recorded_drive_is_mapped_again_and_the_report_says_so(finished, drive, tmp_path, monkeypatch):
    monkeypatch.delenv("STEREOGRID_DATA", raising=False)
    save_config(replace(CONFIG, n_seeds=1, contenders={"bm": {}}), tmp_path / "bm.toml")
    assert in_process("--config", tmp_path / "bm.toml", "--recording", drive, "--runs", tmp_path / "runs") == 0
    latest = tmp_path / "runs" / "latest"
    assert "No pairs of known disparity were given" in (latest / "report.html").read_text()
    assert not (latest / "pairs.csv").exists() and not (latest / "drive.mcap").exists()
    before, again = (
        [r for r in read(folder / "maps.csv") if (r["matcher"], r["seed"]) == ("bm", "1")]
        for folder in (finished[0] / "runs" / "latest", latest)
    )
    assert before == again  # the same drive, seed and matcher: the same scores


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--pairs", "nowhere"), "nowhere: no such folder of stereo pairs"),
        (("--pairs", "empty"), "no stereo pair with truth"),
        (("--recording", "nowhere.mcap"), r"nowhere\.mcap"),
        (("--config", "wrong.toml"), r"wrong\.toml.*bock_px"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, monkeypatch, capsys, options, reason):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "wrong.toml").write_text("[contenders.bm.options]\nbock_px = 3\n")
    assert in_process(*options) == 1
    error = capsys.readouterr().err
    assert re.fullmatch(rf"error: .*{reason}.*\n", error)
    assert not (tmp_path / "runs").exists() or not any((tmp_path / "runs").iterdir())


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"camera_faults": "foggy"}, "foggy.*mild"),
        ({"n_seeds": 0}, "n_seeds"),
        ({"most_pixels": -1}, "most_pixels"),
        ({"reference": "sgmb"}, "sgmb.*bm"),
        ({"contenders": {"sgmb": {}}, "reference": "sgmb"}, "no matcher named 'sgmb'"),
        ({"num_disparities": 0}, "num_disparities"),
    ],
)
def test_a_wrong_parameter_is_named_before_anything_is_done(wrong, named):
    with pytest.raises(StereogridError, match=named):
        MatchersConfig(**wrong)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [({"world": "moon"}, "moon.*corridor"), ({"every_m": 0.0}, "every_m"), ({"distance_m": -1.0}, "distance_m")],
)
def test_a_drive_that_cannot_be_is_refused(wrong, named):
    with pytest.raises(StereogridError, match=named):
        DriveConfig(**wrong)


def test_the_pairs_are_those_of_the_data_folder_where_there_is_one(tmp_path, monkeypatch):
    monkeypatch.setenv("STEREOGRID_DATA", str(tmp_path))
    assert default_pairs() is None
    (tmp_path / "stereo").mkdir()
    assert default_pairs() == tmp_path / "stereo"
    monkeypatch.delenv("STEREOGRID_DATA")
    assert default_pairs() is None
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STEREOGRID_DATA", "")
    assert default_pairs() is None
