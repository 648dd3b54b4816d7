"""The README's Python and the scripts in examples/ do what they say, on a small drive."""

import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_drives import SMALL, small_drive

import stereogrid as sg
from stereogrid.recording import FileRecording

ROOT = Path(__file__).parents[2]
PYTHON_BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> FileRecording:
    return sg.open_recording(small_drive(tmp_path_factory.mktemp("drive") / "drive.mcap"))


def example(name: str, *arguments: Path) -> str:
    """What a script prints."""
    line = [sys.executable, str(ROOT / "examples" / name), *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_readmes_python_runs_from_top_to_bottom(
    drive: FileRecording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drive.mcap").symlink_to(drive.path)
    observations = list(drive)
    known = {
        "my_observations": [(each.left, each.right, each.T_world_cam) for each in observations],
        "origins_m": [[0.5, 0.0, 0.4]],
        "directions": [[1.0, 0.0, 0.0]],
        "other": sg.OccupancyGrid(cell_m=0.05),
    }
    blocks = PYTHON_BLOCK.findall((ROOT / "README.md").read_text())
    # The README's camera is a webcam's; the drive was seen by a small one.
    code = "\n".join(blocks).replace("focal_px=834, cx_px=319.5, cy_px=239.5, baseline_m=0.06", "**SMALL")
    code = code.replace("**SMALL, width_px=640, height_px=480", "**SMALL")
    exec(compile(code, "README.md", "exec"), known | {"SMALL": asdict(SMALL)})
    assert {each.name for each in tmp_path.iterdir()} == {"drive.mcap", "slice.png", "map.sgrid", "map.ot"}
    assert sg.OccupancyGrid.load(tmp_path / "map.sgrid").n_known > 1000
    assert cv2.imread(str(tmp_path / "slice.png")).std() > 10


def test_the_ten_lines_are_ten() -> None:
    (first, *_) = PYTHON_BLOCK.findall((ROOT / "README.md").read_text())
    assert len([line for line in first.splitlines() if line.strip()]) <= 10


def test_your_own_images_become_a_map(drive: FileRecording, tmp_path: Path) -> None:
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        for number, each in enumerate(drive):
            cv2.imwrite(str(tmp_path / side / f"{number:03d}.png"), getattr(each, side))
    np.savetxt(tmp_path / "poses.txt", [T[:3].ravel() for T in drive.poses])
    places = [tmp_path / name for name in ("left", "right", "poses.txt", "map.sgrid")]
    printed = example("own_images.py", *places)
    assert printed.count("% matched") == len(drive)
    grid = sg.OccupancyGrid.load(tmp_path / "map.sgrid")
    # The floor is where it is.
    levels, counts = np.unique(grid.occupied_centres(0.6)[:, 2].round(2), return_counts=True)
    assert abs(levels[counts.argmax()]) <= grid.cell_m
    assert (tmp_path / "map.png").stat().st_size > 5000


def test_your_own_matcher_makes_a_map_as_good_as_its_model(drive: FileRecording) -> None:
    printed = example("own_matcher.py", drive.path)
    areas = dict(re.findall(r"^(\w+) +AUC (\S+),", printed, re.MULTILINE))
    assert areas.keys() == {"yours", "sgbm"}
    assert all(0.8 < float(area) <= 1 for area in areas.values())


def test_somebodys_octomap_gets_the_scores_of_the_same_map_of_ours(drive: FileRecording, tmp_path: Path) -> None:
    grid, matcher = sg.OccupancyGrid(cell_m=0.1), sg.matcher("bm", num_disparities=48)
    for each in drive:
        grid.integrate(drive.camera, matcher.match(each.left, each.right), each.T_world_cam)
    sg.export(grid, tmp_path / "map.ot")
    printed = example("score_octomap.py", tmp_path / "map.ot", drive.path)
    ours = sg.MapTruth.of_recording(drive, 0.1, max_range_m=5.0).score(grid, prior=0.5)
    by_name = {score.name: score for score in ours}
    found = dict(re.findall(r"^(\w+) +(\S+) ", printed, re.MULTILINE))
    for name in ("auc", "occupied_f1", "completeness_m"):
        assert abs(float(found[name]) - by_name[name].value) < 0.01


@pytest.mark.parametrize("script", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.name)
def test_an_example_is_short_and_says_how_it_is_run(script: Path) -> None:
    text = script.read_text()
    assert len(text.splitlines()) <= 50
    assert f"python examples/{script.name} " in text.split('"""')[1]
