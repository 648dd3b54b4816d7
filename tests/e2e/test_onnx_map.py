"""`stereogrid map --matcher onnx --network net.toml`: a user's network maps a recording."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from stereogrid import cli
from stereogrid.camera import StereoCamera
from stereogrid.commands import chosen
from stereogrid.config import MappingConfig, MatcherConfig, load_config
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.observation import Observation, Odometry
from stereogrid.recording.mcap import McapWriter

CAMERA = StereoCamera(focal_px=80, cx_px=59.5, cy_px=47.5, baseline_m=0.2, width_px=120, height_px=96)
T_BASE_CAM = from_rotation(R_BASE_OPTICAL, [0.0, 0.0, 0.5])
SHIFT_PX = 8


@pytest.fixture
def drive(tmp_path):
    """Two looks at a wall that faces the camera, focal * baseline / SHIFT_PX = 2 m ahead."""
    noise = cv2.GaussianBlur(np.random.default_rng(0).normal(size=(96, 160)), (0, 0), 1.2)
    wide = np.clip(128 + 40 * noise / noise.std(), 0, 255).astype(np.uint8)
    left, right = (np.ascontiguousarray(wide[:, start : start + 120]) for start in (0, SHIFT_PX))
    with McapWriter(tmp_path / "drive.mcap", CAMERA, T_BASE_CAM) as writer:
        for n in range(2):
            writer.write(Observation(float(n), left, right, Odometry(np.eye(4)), T_BASE_CAM))
    return tmp_path / "drive.mcap"


@pytest.fixture
def network(tmp_path):
    pytest.importorskip("onnxruntime")
    pytest.importorskip("onnx")
    from tiny_networks import write_network

    write_network(tmp_path / "net.onnx")
    path = tmp_path / "net.toml"
    path.write_text(
        'weights = "net.onnx"\ninputs = [{name = "left", image = "left"}, {name = "right", image = "right"}]'
    )
    return path


def test_a_network_maps_a_wall_where_it_is_and_its_run_can_be_repeated(drive, network, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = ["map", "drive.mcap", "--matcher", "onnx", "--network", "net.toml", "--cell", "0.1", "--range", "4"]
    assert cli.run(cli.app, [*asked, "--out", "map.sgrid"]) == 0
    grid = OccupancyGrid.load("map.sgrid")
    np.testing.assert_array_less(0.5, grid.probability(np.array([[2.05, 0.05, 0.55], [2.05, -0.25, 0.45]])))
    np.testing.assert_array_less(grid.probability(np.array([[1.05, 0.05, 0.55], [1.55, 0.05, 0.55]])), 0.5)
    config = load_config(MappingConfig, tmp_path / "runs" / "latest" / "config.toml")
    assert config.matcher.network == str(network.resolve())
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    assert cli.run(cli.app, ["map", str(drive), "--config", str(tmp_path / "runs" / "latest" / "config.toml")]) == 0
    assert OccupancyGrid.load("runs/latest/map.sgrid").sha256() == grid.sha256()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--matcher", "onnx"], "error: the matcher 'onnx' needs a network: the TOML file that describes it\n"),
        (["--matcher", "bm", "--network", "net.toml"], "error: network is for the matcher 'onnx'; 'bm' takes none\n"),
        (["--network", "none.toml"], "none.toml: cannot be read (No such file or directory)\n"),
    ],
)
def test_what_does_not_go_together_gets_one_line(drive, tmp_path, monkeypatch, capfd, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["map", "drive.mcap", *arguments]) == 1
    said = capfd.readouterr().err
    assert said.startswith("error: ")
    assert said.endswith(message)
    assert said.count("\n") == 1
    assert not (tmp_path / "runs").exists()


def test_another_matcher_on_the_command_line_does_not_keep_the_networks_file():
    held = MatcherConfig("onnx", 48, "/nets/net.toml")
    assert chosen._chosen_matcher(held, "bm", None, None) == MatcherConfig("bm", 48)
    assert chosen._chosen_matcher(held, "onnx", None, 64) == MatcherConfig("onnx", 64, "/nets/net.toml")
    assert chosen._chosen_matcher(held, None, None, None) == held
    assert chosen._chosen_matcher(MatcherConfig(), None, Path("/nets/net.toml"), None).name == "onnx"
