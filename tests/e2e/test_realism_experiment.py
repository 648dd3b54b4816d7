"""The comparison of simulated and real images, from the command to its run folder: .6 m of corridor, one drawn pair."""

import json
import re

import cv2
import numpy as np
import pytest
from drawn_pairs import shifted_pair

pytest.importorskip("pybullet", reason="the simulated drive needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone

from experiments.__main__ import app
from experiments.realism import RealismConfig
from experiments.realism_measures import MEASURES
from stereogrid.cli import run as run_command
from stereogrid.config import load_config, save_config

CONFIG = RealismConfig(worlds=("corridor",), presets=("ideal", "mild"), places=2, distance_m=0.6)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A folder of data with one pair, as Middlebury 3 lays it out."""
    folder = tmp_path_factory.mktemp("data")
    place = folder / "stereo" / "teddy"
    place.mkdir(parents=True)
    left, right = shifted_pair(9.0, shape=(120, 200))
    cv2.imwrite(str(place / "im0.png"), left)
    cv2.imwrite(str(place / "im1.png"), right)
    cv2.imwrite(str(place / "disp0.pfm"), np.full(left.shape, 9, np.float32))
    return folder


@pytest.fixture(scope="module")
def finished(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("realism")
    save_config(CONFIG, folder / "config.toml")
    arguments = ["--config", folder / "config.toml", "--data", data, "--runs", folder / "runs"]
    assert run_command(app, ["realism", *map(str, arguments)]) == 0
    return folder / "runs" / "latest"


def test_every_pair_is_measured_with_every_preset_and_the_real_one_beside_them(finished):
    pairs = json.loads((finished / "metrics.json").read_text())["pairs"]
    assert sorted((p["place"], p["cameras"]) for p in pairs) == sorted(
        [("teddy", "real"), *(("corridor", preset) for preset in CONFIG.presets for _ in range(2))]
    )
    assert all(set(MEASURES) <= set(pair) for pair in pairs)


def test_worse_cameras_match_less_and_see_two_shades(finished):
    pairs = json.loads((finished / "metrics.json").read_text())["pairs"]

    def mean(preset, name):
        return np.mean([pair[name] for pair in pairs if pair["cameras"] == preset])

    assert mean("ideal", "bm_density") > mean("mild", "bm_density")
    assert mean("ideal", "photo_gray") < mean("mild", "photo_gray")


def test_the_report_stands_alone_and_what_was_missing_is_said(finished):
    assert load_config(RealismConfig, finished / "config.toml") == CONFIG
    report = (finished / "report.html").read_text()
    assert stands_alone(report)
    assert report.count("data:image/png;base64,") == len(list(finished.glob("*.png"))) == 2
    assert "kitti_straight was not under --data" in report
    assert "| teddy | real | 1 |" in (finished / "tables.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--worlds", "corridor,moon"], "no world named 'moon'; choose from: .*corridor"),
        (["--data", "nowhere"], "nowhere: no such folder"),
    ],
)
def test_what_there_is_not_is_refused_in_one_line(arguments, named, tmp_path, capsys):
    assert run_command(app, ["realism", *arguments, "--runs", str(tmp_path / "runs")]) == 1
    assert re.fullmatch(f"error: .*{named}.*\n", capsys.readouterr().err)
    assert not (tmp_path / "runs").exists()
