"""The outdoor experiment, from the command to its run folder, on 1.5 m of a hillside in place of the whole green."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulated drive needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone

from experiments.__main__ import app
from experiments.drive_report import IDEAL, KNOWN_TILT, NOISY, SHUFFLED, TRUE_DEPTH
from experiments.outdoor import OutdoorConfig
from sim.scene.scene import Sky, World
from sim.scene.solids import Paint, box
from sim.scene.terrain import Terrain
from sim.scene.textures import Texture, noise, to_image
from sim.worlds.world import WORLDS
from stereogrid.cli import run as run_command
from stereogrid.config import load_config
from stereogrid.grid import OccupancyGrid
from stereogrid.recording import open_recording

SLOPE = 0.12
NAMES = ("ideal", "noisy", "noisy-known-tilt", "true-depth", "shuffled-poses")


def hillside(seed):
    """Ground that climbs ahead of the robot, with a wall, a post and a hedge on it."""
    rng = np.random.default_rng(seed)
    x = -4 + 0.5 * np.arange(33)
    # Level where the robot starts, then a slope.
    rise = SLOPE * np.clip(x - 0.5, 0, None)
    hill = Terrain(np.tile(rise, (17, 1)), (-4.0, -4.0), 0.5, "grass")
    things = (
        box("wall", (6.03, -3, -0.2), (6.23, 3, 3.5), Paint("stone")),
        box("post", (3.03, 0.52, -0.2), (3.15, 0.64, 1.9), Paint("stone")),
        box("hedge", (3.53, -2.03, -0.2), (4.63, -0.73, 1.4), Paint("grass")),
    )
    grass, stone = (to_image(0.45 + 0.12 * noise(rng, (512, 512), power=0.7, finest_px=2)) for _ in range(2))
    textures = {"grass": Texture(grass, (2.0, 2.0)), "stone": Texture(stone, (2.0, 2.0))}
    waypoints = np.array([[0.0, 0], [4, 0]])
    return World("outdoor", seed, (hill.solid(), *things), textures, (), waypoints, sky=Sky(), terrain=hill)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("outdoor")
    (folder / "my.toml").write_text("distance_m = 2.5\nevery_m = 0.5\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(WORLDS, "outdoor", hillside)
        arguments = ["--config", folder / "my.toml", "--runs", folder / "runs"]
        assert run_command(app, ["outdoor", *map(str, arguments)]) == 0
    return folder / "runs" / "latest"


@pytest.fixture(scope="module")
def scores(finished):
    arms = json.loads((finished / "metrics.json").read_text())["arms"]
    return {arm: {name: score["value"] for name, score in of_arm.items()} for arm, of_arm in arms.items()}


def test_every_arm_is_mapped_and_scored(finished, scores):
    assert list(scores) == [IDEAL, NOISY, KNOWN_TILT, TRUE_DEPTH, SHUFFLED]
    maps = {path.name: OccupancyGrid.load(path) for path in finished.glob("*.sgrid")}
    assert set(maps) == {f"map-{name}.sgrid" for name in NAMES}
    assert all(grid.n_known > 1000 for grid in maps.values())


def test_the_hillside_is_mapped_and_its_obstacles_are_told_from_the_ground(scores):
    assert scores[IDEAL]["auc"] > 0.95
    assert scores[IDEAL]["obstacle_auc"] > 0.95
    assert scores[TRUE_DEPTH]["obstacle_occupied_f1"] > scores[IDEAL]["obstacle_occupied_f1"] > 0.4
    assert scores[SHUFFLED]["obstacle_occupied_f1"] < 0.2


def test_a_robot_that_knows_its_tilt_maps_the_hill_better_than_one_that_believes_it_level(scores):
    assert scores[KNOWN_TILT]["auc"] > scores[NOISY]["auc"] + 0.05
    assert scores[KNOWN_TILT]["accuracy_m"] < scores[NOISY]["accuracy_m"]


def test_the_config_is_saved_whole_and_the_report_stands_alone(finished):
    saved = load_config(OutdoorConfig, finished / "config.toml")
    assert saved == OutdoorConfig(distance_m=2.5, every_m=0.5)
    assert (saved.world, saved.mapping.grid.cell_m, saved.known_tilt) == ("outdoor", 0.1, True)
    report = (finished / "report.html").read_text()
    assert stands_alone(report)
    assert "0.25 to 2.4 m above the ground" in report
    assert report.count("data:image/png;base64,") == len(list(finished.glob("*.png"))) == 6


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('world = "moon"', "no world named 'moon'; choose from: corridor, .*outdoor"),
        ("obstacles_m = [2.0, 1.0]", "obstacles_m must be two heights"),
        ("obstacles_m = [1.0]", "obstacles_m must be two heights"),
        ('camera_faults = "foggy"', "foggy.*choose from: .*ideal"),
        ("distance = 3", "unknown key 'distance'; did you mean 'distance_m'"),
    ],
)
def test_a_wrong_parameter_is_named_in_one_line(text, named, tmp_path, capsys):
    (tmp_path / "my.toml").write_text(text)
    assert run_command(app, ["outdoor", "--config", str(tmp_path / "my.toml"), "--runs", str(tmp_path / "runs")]) == 1
    assert re.fullmatch(f"error: .*{named}.*\n", capsys.readouterr().err)
    assert not (tmp_path / "runs").exists()


def across_the_path(world):
    """The world with a wall that the robot runs into after 1.5 m."""
    wall = box("barrier", (1.9, -1.5, -0.5), (2.0, 1.5, 1.0), Paint("stone"))
    return replace(world, solids=(*world.solids, wall))


def test_a_robot_that_is_stuck_ends_the_drive_and_not_the_experiment(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(WORLDS, "outdoor", lambda seed: across_the_path(hillside(seed)))
    (tmp_path / "my.toml").write_text("every_m = 0.5\nwheel_faults = 'worn'\n")
    arguments = ["outdoor", "--config", str(tmp_path / "my.toml"), "--runs", str(tmp_path / "runs")]
    assert run_command(app, arguments) == 0
    said = capsys.readouterr().err
    assert "stuck at x = 1." in said and "going on with the drive up to there" in said
    folder = (tmp_path / "runs" / "latest").resolve()
    facts = json.loads((folder / "metrics.json").read_text())["facts"]
    assert "stuck at x = 1." in facts["drive ended early"]
    assert len(open_recording(folder / "drive.mcap")) >= 2


def test_a_robot_that_never_moved_leaves_one_line_and_no_run(tmp_path, monkeypatch, capsys):
    boxed = box("barrier", (0.34, -1.5, -0.5), (0.6, 1.5, 1.0), Paint("stone"))
    monkeypatch.setitem(WORLDS, "outdoor", lambda seed: replace(hillside(seed), solids=(*hillside(seed).solids, boxed)))
    assert run_command(app, ["outdoor", "--runs", str(tmp_path / "runs")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "stuck" in line and "before there was anything to map" in line and "keeps" not in line
    assert not [path for path in (tmp_path / "runs").iterdir() if path.is_dir()]
