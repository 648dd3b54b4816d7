"""The command from a recording to a run folder, and from bad input to one line."""

import json
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
import typer
from rgbd_folders import write_frames

from experiments import __main__ as experiments
from stereogrid import cli, map_report
from stereogrid.camera import StereoCamera
from stereogrid.commands.chosen import chosen_config
from stereogrid.config import MappingConfig, load_config, save_config
from stereogrid.exporting import EXPORTS
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.matching import MATCHERS
from stereogrid.motion import Growth, MotionError
from stereogrid.observation import Observation, Odometry, Truth
from stereogrid.recording import open_recording
from stereogrid.recording.mcap import McapWriter

CAMERA = StereoCamera(focal_px=80, cx_px=59.5, cy_px=47.5, baseline_m=0.1, width_px=120, height_px=96)
HEIGHT_M, WALL_M, SQUARE_M = 0.4, 1.8, 0.02
T_BASE_CAM = from_rotation(R_BASE_OPTICAL, [0.0, 0.0, HEIGHT_M])
FIGURES = {"slice.png", "cubes.png", "disparity.png", "trajectory.png"}
FILES = {"map.sgrid", "config.toml", "run.toml", "metrics.json", "trajectory.tum", "report.html"} | FIGURES


def view(T_world_cam, shift_m):
    """What an eye shift_m to the right of the camera sees: a wall across x and a floor, in squares of random grey."""
    eye = T_world_cam[:3, 3] + T_world_cam[:3, 0] * shift_m
    # Four rays a pixel, so that squares do not flicker.
    picture = np.zeros(CAMERA.shape)
    for du, dv in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
        rays = (CAMERA.ray_directions + np.array([du, dv, 0]) / CAMERA.focal_px) @ T_world_cam[:3, :3].T
        to_wall = (WALL_M - eye[0]) / rays[..., 0]
        to_floor = np.where(rays[..., 2] < 0, -eye[2] / np.minimum(rays[..., 2], -1e-9), np.inf)
        points = eye + rays * np.minimum(to_wall, to_floor)[..., None]
        i, j, k = np.moveaxis(np.floor(points / SQUARE_M + 1e-6).astype(np.int64), -1, 0)
        picture += (i * 73856093 ^ j * 19349663 ^ k * 83492791) % 251 / 4
    return picture.astype(np.uint8)


def observations(n=4):
    for number in range(n):
        T_odom_base = from_rotation(np.eye(3), [0.03 * number, 0.01 * number, 0])
        T = T_odom_base @ T_BASE_CAM
        left, right = view(T, 0.0), view(T, CAMERA.baseline_m)
        yield Observation(10 + 0.1 * number, left, right, Odometry(T_odom_base), T, Truth(T))


def box(low, high):
    low, high = np.array(low), np.array(high)
    return trimesh.creation.box(high - low, trimesh.transformations.translation_matrix((low + high) / 2))


def write_kitti(folder, n=3):
    for side in ("image_0", "image_1"):
        (folder / side).mkdir(parents=True)
    for number, each in enumerate(observations(n)):
        cv2.imwrite(str(folder / "image_0" / f"{number:06d}.png"), each.left)
        cv2.imwrite(str(folder / "image_1" / f"{number:06d}.png"), each.right)
    lines = [" ".join(map(str, P.ravel())) for P in CAMERA.P]
    (folder / "calib.txt").write_text("".join(f"P{i}: {line}\n" for i, line in enumerate(lines)))
    poses = [from_rotation(np.eye(3), [0, 0, 0.03 * i])[:3].ravel() for i in range(n)]
    (folder / "poses.txt").write_text("".join(" ".join(map(str, pose)) + "\n" for pose in poses))
    return folder


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "drive.mcap"
    world = trimesh.util.concatenate(box([WALL_M, -3, -0.2], [WALL_M + 0.1, 3, 3]), box([-1, -3, -0.1], [3, 3, 0]))
    with McapWriter(path, CAMERA, T_BASE_CAM, truth_mesh_ply=world.export(file_type="ply")) as writer:
        for each in observations():
            writer.write(each)
    return path


def command(*arguments, cwd):
    """The command as a user runs it, in another process and folder."""
    line = [sys.executable, "-m", "stereogrid.cli", *map(str, arguments)]
    return subprocess.run(line, cwd=cwd, capture_output=True, text=True, timeout=120)


@pytest.fixture(scope="module")
def first_run(drive, tmp_path_factory):
    cwd = tmp_path_factory.mktemp("work")
    done = command("map", drive, "--out", "mine.sgrid", "--cell", "0.04", "--range", "3", cwd=cwd)
    assert done.returncode == 0, done.stderr
    return cwd, done


def test_a_motion_error_from_repeated_runs_takes_the_place_of_the_configs(drive, tmp_path):
    fitted = MotionError(way="linear", along=Growth(1e-3, 0.01), heading=Growth(1e-4, 0.02))
    save_config(fitted, tmp_path / "motion.toml")
    save_config(MappingConfig(motion_error=MotionError(position_m=0.5)), tmp_path / "config.toml")
    options = ["--config", "config.toml", "--motion", "motion.toml", "--cell", "0.08", "--no-score"]
    done = command("map", drive, *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert load_config(MappingConfig, tmp_path / "runs" / "latest" / "config.toml").motion_error == fitted
    for text, message in (
        ("[sideways]\na = 1\n", "motion.toml: unknown key 'sideways'.*"),
        ("", "motion.toml: tells of no error, so way = 'rss' has nothing to go by"),
    ):
        (tmp_path / "motion.toml").write_text(text)
        done = command("map", drive, *options, cwd=tmp_path)
        assert done.returncode == 1
        assert re.fullmatch(f"error: {message}\n", done.stderr)


def numbers_of(table):
    """{name: value} of the rows of a printed table of scores."""
    rows = (re.split(r"\s+", line.strip()) for line in table.splitlines())
    return {row[0]: row[1] for row in rows if len(row) >= 3}


def test_mapping_fills_one_run_folder_and_points_latest_at_it(first_run):
    cwd, _ = first_run
    assert {each.name for each in cwd.iterdir()} == {"runs", "mine.sgrid"}
    runs = cwd / "runs"
    assert len(list(runs.iterdir())) == 2
    latest = (runs / "latest").resolve()
    assert latest.parent == runs.resolve()
    assert re.fullmatch(r"\d{8}-\d{6}-drive", latest.name)
    assert {each.name for each in latest.iterdir()} == FILES | {"reliability.png"}
    assert (cwd / "mine.sgrid").read_bytes() == (latest / "map.sgrid").read_bytes()
    for name in FIGURES | {"reliability.png"}:
        assert np.ptp(cv2.imread(str(latest / name))) > 100


def test_the_map_holds_the_wall_and_the_floor_where_they_are(first_run):
    cwd, done = first_run
    grid = OccupancyGrid.load(cwd / "mine.sgrid")
    assert grid.cell_m == 0.04
    along = np.stack(np.meshgrid([0.0], np.linspace(-0.5, 0.5, 30), np.linspace(0.3, 0.7, 15)), -1).reshape(-1, 3)
    assert np.nanmean(grid.probability(along + np.array([WALL_M + 0.01, 0, 0])) > 0.5) > 0.7
    assert np.nanmean(grid.probability(along + np.array([WALL_M - 0.5, 0, 0])) < 0.5) > 0.95
    metrics = json.loads((cwd / "runs" / "latest" / "metrics.json").read_text())
    height = metrics["scores"]["camera_height_m"]
    assert height["unit"] == "m"
    assert height["value"] == pytest.approx(HEIGHT_M, abs=grid.cell_m)
    assert metrics["scores"]["known_cells"]["value"] == grid.n_known
    assert 0.5 < metrics["scores"]["disparity_density"]["value"] <= 1
    assert float(numbers_of(done.stdout)["camera_height_m"]) == pytest.approx(height["value"], abs=1e-3)
    assert metrics["command"].startswith("stereogrid map ")
    report = (cwd / "runs" / "latest" / "report.html").read_text()
    assert grid.sha256() in report
    assert report.count("data:image/png;base64,") == len(FIGURES) + 1
    trajectory = np.loadtxt(cwd / "runs" / "latest" / "trajectory.tum")
    assert trajectory.shape == (4, 8)
    assert trajectory[:, :4] == pytest.approx(
        np.array([[10 + 0.1 * n, 0.03 * n, 0.01 * n, HEIGHT_M] for n in range(4)])
    )


def test_a_map_of_a_recording_with_its_truth_is_scored_unless_it_is_not_to_be(first_run, drive, tmp_path, monkeypatch):
    cwd, done = first_run
    metrics = json.loads((cwd / "runs" / "latest" / "metrics.json").read_text())
    assert metrics["scores"]["auc"]["value"] > 0.9
    assert float(numbers_of(done.stdout)["auc"]) == pytest.approx(metrics["scores"]["auc"]["value"], abs=1e-3)
    assert "within 3 m" in metrics["scored"]
    monkeypatch.chdir(tmp_path)
    options = ["--cell", "0.04", "--range", "3", "--runs"]
    assert cli.run(cli.app, ["map", str(drive), *options, "bare", "--no-score"]) == 0
    assert "auc" not in json.loads(Path("bare/latest/metrics.json").read_text())["scores"]
    assert {each.name for each in Path("bare/latest").iterdir()} == FILES

    # Where the rays cannot be cast, the report says what is missing; who asks for scores is told at once.
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    assert cli.run(cli.app, ["map", str(drive), *options, "auto"]) == 0
    assert "pip install stereogrid[score]" in Path("auto/latest/report.html").read_text()
    assert cli.run(cli.app, ["map", str(drive), *options, "asked", "--score"]) == 1
    assert list(Path("asked").iterdir()) == []


def test_scores_that_are_asked_for_without_a_truth_are_refused_before_anything_is_mapped(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    street = write_kitti(tmp_path / "street")
    assert cli.run(cli.app, ["map", str(street), "--score"]) == 1
    assert re.fullmatch(r"error: the recording carries no true mesh .*\n", capfd.readouterr().err)
    assert not list(Path("runs").iterdir())


def test_the_config_of_a_run_repeats_it_to_the_same_map(first_run, drive, tmp_path, monkeypatch, capsys):
    cwd, _ = first_run
    config = cwd / "runs" / "latest" / "config.toml"
    assert load_config(MappingConfig, config).grid.cell_m == 0.04
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["map", str(drive), "--config", str(config), "--runs", "again"]) == 0
    again = OccupancyGrid.load("again/latest/map.sgrid")
    assert again.sha256() == OccupancyGrid.load(cwd / "mine.sgrid").sha256()
    assert Path("again/latest/config.toml").read_text() == config.read_text()
    assert Path("again/latest/map.sgrid").read_bytes() == (cwd / "mine.sgrid").read_bytes()
    assert cli.run(cli.app, ["map", str(drive), "--config", str(config), "--cell", "0.05", "--runs", "again"]) == 0
    assert OccupancyGrid.load("again/latest/map.sgrid").cell_m == 0.05
    assert capsys.readouterr().err == ""


def test_a_map_is_scored_against_the_truth_in_its_recording(first_run, drive, monkeypatch, capsys):
    cwd, _ = first_run
    monkeypatch.chdir(cwd)
    assert cli.run(cli.app, ["score", "mine.sgrid", str(drive), "--range", "2"]) == 0
    scores = numbers_of(capsys.readouterr().out)
    assert float(scores["auc"]) > 0.9
    assert float(scores["accuracy_m"]) < 0.1
    assert {each.name for each in cwd.iterdir()} == {"runs", "mine.sgrid"}


def test_info_says_what_a_recording_and_a_map_hold(first_run, drive, capsys):
    cwd, _ = first_run
    assert cli.run(cli.app, ["info", str(drive)]) == 0
    shown = capsys.readouterr().out
    assert f"mcap: 4 observations in 0.300 s (10.00 Hz), path {3 * np.hypot(0.03, 0.01):.2f} m" in shown
    assert "camera: 120 x 96 px, focal length 80.00 px (73 degrees wide), centre (59.50, 47.50) px" in shown
    assert f"mount: left camera in base at (0.000, 0.000, {HEIGHT_M:.3f}) m" in shown
    assert "truth: poses of 4 observations, mesh" in shown
    assert cli.run(cli.app, ["info", str(cwd / "mine.sgrid")]) == 0
    shown = capsys.readouterr().out
    assert f"{OccupancyGrid.load(cwd / 'mine.sgrid').n_known:,} known cells" in shown


@pytest.mark.parametrize("suffix", EXPORTS)
def test_a_map_is_exported_in_the_format_of_the_suffix(first_run, tmp_path, monkeypatch, capfd, suffix):
    cwd, _ = first_run
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["export", str(cwd / "mine.sgrid"), f"mine{suffix}"]) == 0
    assert Path(f"mine{suffix}").stat().st_size > 100
    assert capfd.readouterr().err == ""


def test_the_options_of_an_export_reach_its_format(first_run, tmp_path, monkeypatch):
    cwd, _ = first_run
    monkeypatch.chdir(tmp_path)
    grid = str(cwd / "mine.sgrid")
    assert cli.run(cli.app, ["export", grid, "text.pcd", "--ascii", "--threshold", "0.8"]) == 0
    rows = Path("text.pcd").read_text().splitlines()
    assert "DATA ascii" in rows
    assert all(float(row.split()[3]) > 0.8 for row in rows[11:])
    assert cli.run(cli.app, ["export", grid, "cubes.ply", "--cubes"]) == 0
    assert len(trimesh.load("cubes.ply").faces) > 100
    assert cli.run(cli.app, ["export", grid, "flat.pgm", "--low", "0.2", "--high", "0.6"]) == 0
    assert {0, 254} <= set(np.unique(cv2.imread("flat.pgm", cv2.IMREAD_UNCHANGED)).tolist())


@pytest.mark.parametrize("suffix", [".ot", ".bt"])
def test_a_map_of_octomaps_is_scored_told_and_exported_like_one_of_ours(
    first_run, drive, tmp_path, monkeypatch, capsys, suffix
):
    cwd, _ = first_run
    monkeypatch.chdir(tmp_path)
    ours, theirs = str(cwd / "mine.sgrid"), f"theirs{suffix}"
    assert cli.run(cli.app, ["export", ours, theirs]) == 0
    assert cli.run(cli.app, ["info", theirs]) == 0
    assert f"{OccupancyGrid.load(ours).n_known:,} known cells" in capsys.readouterr().out
    scores = []
    for path in (ours, theirs):
        assert cli.run(cli.app, ["score", path, str(drive), "--range", "2"]) == 0
        scores.append(numbers_of(capsys.readouterr().out))
    if suffix == ".ot":
        assert scores[0] == scores[1]
    assert scores[0]["coverage"] == scores[1]["coverage"]
    assert float(scores[1]["auc"]) > 0.8
    assert cli.run(cli.app, ["export", theirs, "again.ply"]) == 0


def test_a_kitti_folder_is_known_from_its_path(tmp_path, monkeypatch, capsys):
    folder = write_kitti(tmp_path / "street")
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["map", str(folder), "--cell", "0.05"]) == 0
    assert {each.name for each in Path("runs/latest").iterdir()} == FILES
    assert Path("runs/latest").resolve().name.endswith("-street")
    assert "camera_height_m" in capsys.readouterr().out


def test_measured_depths_are_mapped_as_they_are_unless_a_matcher_is_named(tmp_path, monkeypatch, capsys):
    folder = write_frames(tmp_path / "room", n=2)
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["map", str(folder), "--cell", "0.1"]) == 0
    assert load_config(MappingConfig, "runs/latest/config.toml").matcher.name == "recorded"
    assert json.loads(Path("runs/latest/metrics.json").read_text())["scores"]["disparity_density"]["value"] > 0.99
    recording = open_recording(folder)
    assert chosen_config(recording.camera, None, recording=recording, matcher="sgbm").matcher.name == "sgbm"
    assert (
        chosen_config(recording.camera, Path("runs/latest/config.toml"), recording=recording).matcher.name == "recorded"
    )
    assert cli.run(cli.app, ["info", str(folder)]) == 0
    assert "virtual rig of 0.06 m" in capsys.readouterr().out


def test_the_default_config_can_be_written_and_used(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["config", "my.toml"]) == 0
    assert load_config(MappingConfig, "my.toml") == MappingConfig()


def test_a_config_is_printed_written_made_for_a_camera_and_checked(drive, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["config"]) == 0
    printed = capsys.readouterr().out
    assert "# Edge of a cell. [m; positive]\ncell_m = 0.05\n" in printed
    assert cli.run(cli.app, ["config", "my.toml"]) == 0
    assert Path("my.toml").read_text() == printed
    assert cli.run(cli.app, ["config", "suits.toml", "--for", str(drive)]) == 0
    assert load_config(MappingConfig, "suits.toml") == MappingConfig.for_camera(CAMERA)
    assert "[m; positive; default 8.0]\nmax_range_m = 1.63" in Path("suits.toml").read_text()
    assert cli.run(cli.app, ["config", "--check", "my.toml"]) == 0
    assert capsys.readouterr().out == "my.toml: written\nsuits.toml: written\nmy.toml: fine\n"
    Path("my.toml").write_text(printed.replace("cell_m = 0.05", "cell_m = 0"))
    assert cli.run(cli.app, ["config", "--check", "my.toml"]) == 1
    assert capsys.readouterr().err == "error: my.toml: grid.cell_m must be positive and finite, not 0.0\n"


def test_the_config_of_an_experiment_is_printed_too(capsys):
    assert cli.run(experiments.app, ["config", "outdoor"]) == 0
    assert '[corridor, entrance, office, outdoor, warehouse]\nworld = "outdoor"\n' in capsys.readouterr().out
    assert cli.run(experiments.app, ["config", "indoor"]) == 1
    assert (
        "no experiment with a config named 'indoor'; did you mean 'outdoor'? choose from: budget, "
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("grid.cel_m=0.1", "unknown key 'grid.cel_m'; did you mean 'cell_m'?"),
        ("grid.cell_m=-1", "grid.cell_m must be positive and finite, not -1.0"),
        ("grid.cell_m", "'grid.cell_m': expected section.key=value, as in grid.cell_m=0.1"),
        ("matcher.name=sgmb", "no matcher.name named 'sgmb'; did you mean 'sgbm'?"),
    ],
)
def test_a_wrong_setting_is_refused_before_anything_is_mapped(drive, tmp_path, monkeypatch, capsys, setting, said):
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["map", str(drive), "--set", setting]) == 1
    assert said in capsys.readouterr().err
    assert not Path("runs").exists()


def test_the_help_of_map_names_every_matcher(capsys):
    cli.run(cli.app, ["map", "--help"])
    shown = capsys.readouterr().out
    assert all(re.search(rf"\b{name}\b", shown) for name in MATCHERS)


COMMANDS = ("map", "score", "info", "trajectory", "export", "config")


@pytest.mark.parametrize("arguments", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_has_an_example(arguments, capsys):
    assert cli.run(cli.app, arguments) == 0
    shown = capsys.readouterr().out
    assert "Usage" in shown
    assert arguments == ["--help"] or "Example: stereogrid" in shown


# Bad input: one line, exit code 1, and nothing new in runs/


def kitti(change):
    """A KITTI folder of which change(folder) spoils one thing."""

    def make(folder, drive):
        change(write_kitti(folder / "street"))
        return ["map", folder / "street"]

    return make


def replace_line(name, line, text):
    def change(folder):
        lines = (folder / name).read_text().splitlines()
        lines[line] = text
        (folder / name).write_text("\n".join(lines) + "\n")

    return change


def pose_row(**changes):
    numbers = np.eye(4)[:3].ravel().tolist()
    for place, value in changes.items():
        numbers[int(place[1:])] = value
    return " ".join(map(str, numbers))


def crop_right(folder):
    path = str(folder / "image_1" / "000001.png")
    cv2.imwrite(path, cv2.imread(path, cv2.IMREAD_GRAYSCALE)[:, :-1])


def remove_folder(folder):
    for path in (folder / "image_1").iterdir():
        path.unlink()
    (folder / "image_1").rmdir()


def text_file(name, text, *arguments):
    """The command with a file of this name and text in the working folder."""

    def make(folder, drive):
        (folder / name).write_text(text)
        return [drive if argument == "DRIVE" else argument for argument in arguments]

    return make


def line(*arguments):
    return lambda folder, drive: [drive if argument == "DRIVE" else argument for argument in arguments]


def truncated(folder, drive):
    (folder / "cut.mcap").write_bytes(drive.read_bytes()[:3000])
    return ["map", "cut.mcap"]


def damaged_map(folder, drive):
    content = bytearray(OccupancyGrid(0.1).save(folder / "bad.sgrid").read_bytes())
    content[40] ^= 1
    (folder / "bad.sgrid").write_bytes(content)
    return ["score", "bad.sgrid", drive]


def no_truth(folder, drive):
    OccupancyGrid(0.1).save(folder / "map.sgrid")
    return ["score", "map.sgrid", write_kitti(folder / "street")]


def exporting(out, *options):
    """The command that exports a map of one occupied cell to out, beside a folder.bt."""

    def make(folder, drive):
        OccupancyGrid.from_cells(0.1, np.array([[1, 2, 3]]), [2.0]).save(folder / "map.sgrid")
        (folder / "folder.bt").mkdir()
        return ["export", "map.sgrid", out, *options]

    return make


P_RIGHT = "P1: 80 0 59.5 {} 0 80 47.5 0 0 0 1 0"
BAD_INPUT = {
    "a path that does not exist": (line("map", "nowhere.mcap"), r"nowhere\.mcap: no such file"),
    "a file of no known kind": (text_file("a.txt", "hello", "map", "a.txt"), r"a\.txt: .*choose from mcap: .*kitti: "),
    "an empty folder": (line("map", "."), "no known kind"),
    "a text file named mcap": (text_file("a.mcap", "hello", "map", "a.mcap"), r"a\.mcap"),
    "a recording cut short before its first observation": (truncated, r"cut\.mcap"),
    "no folder of right images": (kitti(remove_folder), "image_1"),
    "one right image missing": (
        kitti(lambda folder: (folder / "image_1" / "000001.png").unlink()),
        r"image_1: 1 images are missing: 000001\.png",
    ),
    "a calibration of the wrong shape": (
        kitti(replace_line("calib.txt", 1, P_RIGHT.format("-8")[:-2])),
        r"calib\.txt:2: 11 numbers, expected 12",
    ),
    "images of different size": (kitti(crop_right), r"000001\.png: the image is 119 x 96 px"),
    "a pose with a NaN": (kitti(replace_line("poses.txt", 1, pose_row(_3="nan"))), r"poses\.txt:2: .*NaN"),
    "a pose that is not rigid": (kitti(replace_line("poses.txt", 2, pose_row(_0=1.1))), r"poses\.txt:3: .*not rigid"),
    "a mirrored pose": (kitti(replace_line("poses.txt", 0, pose_row(_0=-1))), r"poses\.txt:1: .*not rigid"),
    "too few poses": (kitti(replace_line("poses.txt", 2, "")), r"poses\.txt: 2 poses for 3 images"),
    "a baseline of zero": (kitti(replace_line("calib.txt", 1, P_RIGHT.format(0))), "baseline_m must be positive"),
    "a negative baseline": (kitti(replace_line("calib.txt", 1, P_RIGHT.format(8))), r"baseline_m .*not -0\.1"),
    "a cell of zero": (line("map", "DRIVE", "--cell", "0"), "cell_m must be positive and finite, not 0"),
    "a negative cell": (line("map", "DRIVE", "--cell", "-0.1"), r"cell_m .*not -0\.1"),
    "a cell that is no number": (line("map", "DRIVE", "--cell", "nan"), "cell_m .*not nan"),
    "a cell far too small": (
        line("map", "DRIVE", "--cell", "0.0002"),
        r"one view .*needs [\d,.]+ GB, the limit is 4 GB",
    ),
    "a cell of almost nothing": (line("map", "DRIVE", "--cell", "1e-200"), "GB, the limit is 4 GB"),
    "a negative range": (line("map", "DRIVE", "--range", "-1"), "max_range_m"),
    "an unknown key": (
        text_file("my.toml", "[grid]\ncel_m = 0.1\n", "map", "DRIVE", "--config", "my.toml"),
        r"my\.toml: unknown key 'grid\.cel_m'; did you mean 'cell_m'.*choose from: cell_m, fusion",
    ),
    "an unknown section": (
        text_file("my.toml", "[camera]\nx = 1\n", "map", "DRIVE", "--config", "my.toml"),
        r"my\.toml: unknown key 'camera'.*matcher, model",
    ),
    "a value of the wrong kind": (
        text_file("my.toml", '[grid]\ncell_m = "big"\n', "map", "DRIVE", "--config", "my.toml"),
        r"my\.toml: 'grid\.cell_m' must be float, not 'big'",
    ),
    "a config that is no TOML": (
        text_file("my.toml", "[grid\ncell_m", "map", "DRIVE", "--config", "my.toml"),
        r"my\.toml: ",
    ),
    "a config that is not there": (line("map", "DRIVE", "--config", "my.toml"), r"my\.toml: cannot be read"),
    "an unknown fusion rule": (
        text_file("my.toml", '[grid]\nfusion = "mean"\n', "map", "DRIVE", "--config", "my.toml"),
        "'mean'; choose from: cell, sum_of_rays",
    ),
    "a clamp of one number": (
        text_file("my.toml", "[grid]\nclamp = 6.0\n", "map", "DRIVE", "--config", "my.toml"),
        r"my\.toml: 'grid\.clamp' must be a list, not 6\.0",
    ),
    "a clamp of three numbers": (
        text_file("my.toml", "[grid]\nclamp = [-6.0, 0.0, 6.0]\n", "map", "DRIVE", "--config", "my.toml"),
        "clamp must be a lowest and a highest log-odds",
    ),
    "a clamp upside down": (
        text_file("my.toml", "[grid]\nclamp = [6.0, -6.0]\n", "map", "DRIVE", "--config", "my.toml"),
        r"clamp must be .* around the prior's 0, or None; not 6\.0, -6\.0",
    ),
    "an unknown matcher": (
        line("map", "DRIVE", "--matcher", "sgmb"),
        r"no matcher named 'sgmb'; did you mean 'sgbm'\? choose from: bm, .*sgbm",
    ),
    "disparities that the recording does not carry": (
        line("map", "DRIVE", "--matcher", "recorded"),
        r"drive\.mcap: carries no disparities of its own, .*'recorded'; choose from: bm, gc",
    ),
    "disparities that are no multiple of 16": (line("map", "DRIVE", "--num-disparities", "13"), "num_disparities .*13"),
    "more disparities than columns": (line("map", "DRIVE", "--num-disparities", "128"), "120x96 px is too small"),
    "an unknown source of poses": (line("map", "DRIVE", "--poses", "gps"), "'gps'"),
    "an out in no folder": (line("map", "DRIVE", "--out", "nowhere/map.sgrid"), "nowhere: no such folder"),
    "an out that is a folder": (
        lambda folder, drive: [(folder / "a.sgrid").mkdir() or "map", drive, "--out", "a.sgrid"],
        "a.sgrid: is a folder",
    ),
    "an out that cannot be written": (line("map", "DRIVE", "--out", "/proc/map.sgrid"), r"/proc/map\.sgrid: cannot be"),
    "runs that are a file": (
        text_file("file", "", "map", "DRIVE", "--runs", "file"),
        "file: results cannot be written",
    ),
    "scoring a damaged map": (damaged_map, r"bad\.sgrid: not a sound map file"),
    "scoring without a truth": (no_truth, "no true mesh"),
    "scoring a map that is not there": (line("score", "no.sgrid", "DRIVE"), r"no\.sgrid: cannot be read"),
    "scoring a damaged map of OctoMap's": (
        text_file("a.bt", "# Octomap OcTree binary file\nid OcTree\n", "score", "a.bt", "DRIVE"),
        r"a\.bt: not a sound OctoMap file: its header has no line 'data'",
    ),
    "exporting to no known format": (
        exporting("map.obj"),
        r"map\.obj: no format has the suffix '\.obj'; choose from: \.bt, \.glb, \.ot, \.pcd",
    ),
    "exporting to no suffix": (exporting("map"), r"suffix ''; choose from: \.bt"),
    "exporting to a folder": (exporting("runs"), r"runs: no format has"),
    "exporting to a folder with a suffix": (exporting("folder.bt"), r"folder\.bt: is a folder"),
    "exporting into no folder": (exporting("nowhere/map.bt"), "nowhere: no such folder"),
    "exporting where nothing can be written": (exporting("/proc/map.bt"), r"/proc/map\.bt: cannot be written"),
    "exporting with another format's option": (
        exporting("map.bt", "--cubes"),
        r"\.bt has no option 'cubes'; it has none",
    ),
    "exporting heights without a cell": (
        exporting("map.pgm", "--low", "9", "--high", "10"),
        "no known cell lies between 9 and 10 m",
    ),
    "exporting what is not there": (line("export", "no.sgrid", "map.bt"), r"no\.sgrid: cannot be read"),
    "exporting a recording": (line("export", "DRIVE", "map.bt"), r"drive\.mcap: not a sound map file"),
    "info on nothing": (line("info", "nowhere"), "nowhere: no such file"),
}


@pytest.mark.parametrize("what", BAD_INPUT)
def test_bad_input_gets_one_line_and_leaves_earlier_results_as_they_were(what, drive, tmp_path, monkeypatch, capfd):
    make, culprit = BAD_INPUT[what]
    monkeypatch.chdir(tmp_path)
    earlier = tmp_path / "runs" / "20240101-000000-earlier"
    earlier.mkdir(parents=True)
    (earlier / "map.sgrid").write_text("an earlier result")
    (tmp_path / "runs" / "latest").symlink_to(earlier.name)
    arguments = [str(argument) for argument in make(tmp_path, drive)]
    before = sorted(tmp_path.rglob("*"))
    code = cli.run(cli.app, arguments)
    shown = capfd.readouterr()
    assert code == 1
    assert len(shown.err.splitlines()) == 1, shown.err
    assert shown.err.startswith("error: ")
    assert re.search(culprit, shown.err), shown.err
    assert shown.out.strip() == ""
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "runs" / "latest" / "map.sgrid").read_text() == "an earlier result"


def test_in_a_process_of_its_own_bad_input_ends_with_exit_code_1(drive, tmp_path):
    done = command("map", drive, "--cell", "0", cwd=tmp_path)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "Traceback" not in done.stderr + done.stdout
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_fails_half_way_leaves_no_hidden_folder(drive, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(map_report, "write_report", lambda *a, **k: (_ for _ in ()).throw(KeyboardInterrupt))
    try:
        code = cli.run(cli.app, ["map", str(drive), "--cell", "0.05", "--out", "mine.sgrid"])
    except KeyboardInterrupt:
        code = 130
    assert code == 130
    assert list((tmp_path / "runs").iterdir()) == []
    assert not (tmp_path / "mine.sgrid").exists()
    assert "Traceback" not in capfd.readouterr().err


# A map that outgrows its memory limit


def far_apart(folder, n):
    """A KITTI folder whose observations share no cell: the map grows by as much with each."""
    write_kitti(folder, n)
    rows = [pose_row(_11=10.0 * number) for number in range(n)]
    (folder / "poses.txt").write_text("\n".join(rows) + "\n")
    return folder


def map_within(limit_gb, street, *arguments):
    """The exit code of mapping at 10 cm up to 3 m with that limit."""
    grid = f"[grid]\ncell_m = 0.1\nmemory_limit_gb = {limit_gb}\n"
    Path("tiny.toml").write_text(f"[model]\nmax_range_m = 3.0\n[matcher]\nnum_disparities = 16\n{grid}")
    return cli.run(cli.app, ["map", str(street), "--config", "tiny.toml", *arguments])


def test_growth_beyond_the_memory_limit_ends_with_an_error_that_names_it_and_the_map_so_far_is_saved(
    tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    n, limit_gb = 12, 0.0005
    street = far_apart(tmp_path / "street", n)
    assert map_within(limit_gb, street, "--out", "mine.sgrid") == 1
    shown = capfd.readouterr()
    assert len(shown.err.splitlines()) == 1
    assert shown.out.strip() == ""
    folder = Path("runs/latest").resolve()
    said = re.fullmatch(
        r"error: the map would grow to [\d.]+ GB, its limit is 0\.0005 GB: stopped after (\d+) of 12 observations; "
        r"the map so far is saved in (\S+) and mine\.sgrid\n",
        shown.err,
    )
    assert said, shown.err
    n_mapped = int(said[1])
    assert 1 <= n_mapped < n
    assert Path(said[2]).resolve() == folder
    assert {each.name for each in folder.iterdir()} == FILES
    assert Path("mine.sgrid").read_bytes() == (folder / "map.sgrid").read_bytes()
    metrics = json.loads((folder / "metrics.json").read_text())
    assert shown.err.startswith(f"error: {metrics['stopped']}; ")
    assert metrics["scores"]["disparity_density"]["n"] == n_mapped
    assert metrics["stopped"] in (folder / "report.html").read_text().replace("&#x27;", "'")
    assert not list(Path("runs").glob(".*"))

    # It is the map that the observations before make where there is room.
    beginning = far_apart(tmp_path / "beginning", n_mapped)
    assert map_within(1.0, beginning, "--runs", "roomy") == 0
    assert OccupancyGrid.load("mine.sgrid").sha256() == OccupancyGrid.load("roomy/latest/map.sgrid").sha256()
    assert "stopped" not in json.loads(Path("roomy/latest/metrics.json").read_text())
    assert OccupancyGrid.load("mine.sgrid").n_bytes <= limit_gb * 1e9


def test_where_not_even_the_first_observation_fits_there_is_nothing_to_save(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    street = far_apart(tmp_path / "street", 3)
    assert map_within(1e-5, street, "--out", "mine.sgrid") == 1
    assert re.fullmatch(r"error: .*the limit is 1e-05 GB.*\n", capfd.readouterr().err)
    assert not Path("runs").exists()
    assert not Path("mine.sgrid").exists()


# A real street


def test_the_road_of_a_real_street_lies_as_far_under_the_camera_as_it_was_mounted(
    real_data, tmp_path, monkeypatch, capsys
):
    street = real_data("sequences/kitti_straight").resolve()
    monkeypatch.chdir(tmp_path)
    assert cli.run(cli.app, ["map", str(street)]) == 0
    metrics = json.loads(Path("runs/latest/metrics.json").read_text())
    assert metrics["scores"]["camera_height_m"]["value"] == pytest.approx(1.65, abs=0.04)
    assert float(numbers_of(capsys.readouterr().out)["camera_height_m"]) == pytest.approx(1.65, abs=0.04)


@pytest.mark.parametrize(("cause", "ending"), [(KeyboardInterrupt(), 130), (ValueError("a bug"), None)])
def test_an_interrupt_amid_a_compiled_kernel_is_an_interrupt_and_a_bug_stays_a_bug(cause, ending, capsys):
    app = typer.Typer(pretty_exceptions_enable=False)

    @app.command()
    def work() -> None:
        """As Numba reports what arrives while it loads arguments."""
        raise SystemError("returned a result with an exception set") from cause

    if ending is None:
        with pytest.raises(SystemError):
            cli.run(app, [])
    else:
        assert cli.run(app, []) == ending
        assert capsys.readouterr().err == "interrupted; earlier results are as they were\n"
