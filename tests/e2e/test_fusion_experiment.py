"""The fusion experiment, from the command to its run folder: a drive of 1 m, one world of frames, no real data."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulated drive needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone

from experiments.__main__ import app
from experiments.drives import DriveConfig
from experiments.frames import FramesConfig
from experiments.fusion import FusionConfig
from experiments.fusion_arms import CLAMPS, OF_INDEPENDENT, OF_MATCHERS, USUAL_CLAMP
from stereogrid.cli import run as run_command
from stereogrid.config import GridConfig, load_config, save_config
from stereogrid.scoring.paired import paired_difference

CONFIG = FusionConfig(
    matchers=("bm",),
    n_seeds=2,
    drive=DriveConfig(every_m=0.5, distance_m=0.5),
    grid=GridConfig(cell_m=0.2),
    frames=FramesConfig(width_px=80, n=2),
    frame_seeds=1,
    frame_cells_m=(0.2,),
)
WORLDS = {
    "Corridor, bm": (OF_MATCHERS, "measured", 2),
    "Independent noise, cells of 0.2 m": (OF_INDEPENDENT, "1 px", 1),
    "Clamps: corridor, bm": (CLAMPS, USUAL_CLAMP, 2),
}


def in_process(*arguments):
    return run_command(app, ["fusion", *map(str, arguments)])


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fusion")
    save_config(CONFIG, folder / "config.toml")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("STEREOGRID_DATA", raising=False)
        assert in_process("--config", folder / "config.toml", "--runs", folder / "runs") == 0
    return folder / "runs" / "latest"


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_every_arm_of_every_world_has_its_scores(finished):
    rows = read(finished / "scores.csv")
    for world, (arms, _, units) in WORLDS.items():
        auc = {(r["arm"], r["repeat"]): float(r["value"]) for r in rows if (r["world"], r["score"]) == (world, "auc")}
        assert len(auc) == len(arms) * units
        assert {arm for arm, _ in auc} == set(arms)
        assert min(auc.values()) > 0.5
    assert {row["world"] for row in rows} == set(WORLDS)


def test_differences_are_those_of_the_seeds(finished):
    metrics = json.loads((finished / "metrics.json").read_text())["worlds"]
    assert {name: world["reference"] for name, world in metrics.items()} == {n: w[1] for n, w in WORLDS.items()}
    world = metrics["Corridor, bm"]
    auc = {arm: [seed["auc"]["value"] for seed in seeds.values()] for arm, seeds in world["scores"].items()}
    expected = paired_difference(auc["sum of rays"], auc["measured"], rng=np.random.default_rng(0))
    assert world["differences"]["sum of rays"]["auc"]["mean"] == expected.mean
    alone = metrics["Independent noise, cells of 0.2 m"]["differences"]["sum of rays"]["auc"]
    assert alone["low"] is None and alone["n"] == 1  # no interval from a single world


def test_the_sum_of_rays_is_another_map(finished):
    rows = read(finished / "scores.csv")
    found = {
        r["arm"]: r["value"] for r in rows if (r["world"], r["repeat"], r["score"]) == ("Corridor, bm", "1", "auc")
    }
    assert found["sum of rays"] != found["one look"]


def test_the_run_folder_can_be_read_back_and_its_report_stands_alone(finished):
    assert load_config(FusionConfig, finished / "config.toml") == CONFIG
    report = (finished / "report.html").read_text()
    assert stands_alone(report)
    pictures = {path.name for path in finished.glob("*.png")}
    assert pictures == {"simulated.png", "clamps.png"}
    assert report.count("data:image/png;base64,") == len(pictures)


def test_what_was_missing_is_said_in_report_and_markdown(finished):
    for name in ("report.html", "results.md"):
        text = (finished / name).read_text()
        assert text.count("was not there, and is left out") == 2
    assert "python -m experiments" in text and "2 seeds of the image noise" in text
    assert len(re.findall(r"^\| score \|", text, re.MULTILINE)) == 2 * len(WORLDS)


def test_the_same_drive_and_seeds_give_the_same_scores_again(finished, tmp_path):
    save_config(replace(CONFIG, n_seeds=1, clamps_of="", frame_seeds=0), tmp_path / "less.toml")
    options = ("--config", tmp_path / "less.toml", "--recording", finished / "drive.mcap", "--runs", tmp_path / "runs")
    assert in_process(*options) == 0
    before, again = (
        [r for r in read(folder / "scores.csv") if (r["world"], r["repeat"]) == ("Corridor, bm", "1")]
        for folder in (finished, tmp_path / "runs" / "latest")
    )
    assert before == again


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--data", "nowhere"), "nowhere: no such folder of data"),
        (("--recording", "nowhere.mcap"), r"nowhere\.mcap"),
        (("--config", "wrong.toml"), r"wrong\.toml.*most_pears.*most_pairs"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, monkeypatch, capsys, options, reason):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wrong.toml").write_text("[street]\nmost_pears = 3\n")
    assert in_process(*options) == 1
    assert re.fullmatch(rf"error: .*{reason}.*\n", capsys.readouterr().err)
    assert not (tmp_path / "runs").exists() or not any((tmp_path / "runs").iterdir())
