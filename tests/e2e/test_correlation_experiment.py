"""The correlation experiment from pairs to files, on small drawn scenes."""

import csv
import json
from contextlib import contextmanager
from dataclasses import replace

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

import experiments.correlation
from experiments.__main__ import app
from experiments.correlation import run, write_lengths
from experiments.correlation_length import autocorrelation
from experiments.correlation_scenes import SLOW_WINDOW, STATIC, ShortDrive, View, matched, scene_errors, static_pairs
from experiments.sigma_scenes import plane_scenes, real_scenes
from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.matching.correlation import ErrorReach, error_reaches
from stereogrid.matching.sigma import GENERIC

CAMERA = StereoCamera(300, 199.5, 149.5, 0.1, 400, 300)
WALL_PX = 12.0
NOTHING = ErrorReach(1.0, 1.0, 0.0, 0.0)


@contextmanager
def no_bar(what, total):
    class Step:
        def __call__(self):
            pass

        def to(self, share):
            pass

    yield Step()


def seen(shift_px, seed):
    """A wall of disparity WALL_PX, from a place from which it appears shift_px further left, with noise."""
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.normal(size=(300, 600)).astype(np.float32), (0, 0), 1.2)
    texture = 128 + 40 * texture / texture.std()
    noise = np.random.default_rng(seed)
    left, right = (
        np.clip(texture[:, 100 + s + shift_px :][:, :400] + noise.normal(size=(300, 400)) * 2, 0, 255).astype(np.uint8)
        for s in (0, round(WALL_PX))
    )
    return left, right


def view(shift_px, seed):
    depth_m = CAMERA.depth_m(WALL_PX)
    T = np.eye(4)
    T[0, 3] = shift_px * depth_m / CAMERA.focal_px
    return View(*seen(shift_px, seed), np.full(CAMERA.shape, depth_m), T)


def drive():
    return ShortDrive(CAMERA, [view(6 * n, n) for n in range(5)], {0: view(0, 50)})


@pytest.fixture
def small(monkeypatch, tmp_path):
    """The experiment on two drawn scenes, one of which passes for a real one; returns where it would write."""
    drawn = list(plane_scenes(seed=3))[1:3]
    monkeypatch.setattr(experiments.correlation, "scenes", lambda data: [replace(drawn[0], group="venus"), drawn[1]])
    monkeypatch.setattr(experiments.correlation, "static_pairs", lambda data: [seen(0, n) for n in range(4)])
    monkeypatch.setattr(experiments.correlation, "short_drives", lambda: [drive()])
    monkeypatch.setattr(experiments.correlation, "LENGTHS", tmp_path / "lengths.json")
    return tmp_path / "lengths.json"


def test_a_run_leaves_lengths_curves_and_figures_and_writes_nothing_into_the_library(small, tmp_path):
    folder, found = run(tmp_path, no_bar, runs=tmp_path / "runs", names=["bm", "sgbm"])
    assert not small.exists()
    with (folder / "lengths.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [(line["matcher"], line["scenes"], line["real"]) for line in lines] == [
        (name, scene, real)
        for name in ("bm", "sgbm")
        for scene, real in (("planes, faint", "True"), ("planes, plain", "False"))
    ]
    held = json.loads((folder / "metrics.json").read_text())
    assert set(held["matchers"]) == {"bm", "sgbm"}
    assert held["matchers"]["bm"]["correlation_px"] == pytest.approx(found["bm"].mean(real=True), abs=1e-3)
    assert held["rho"]["bm"]["planes, faint"][0] == 1
    for name in ("rho.png", "motion.png"):
        assert (folder / name).stat().st_size > 10_000
    for each in found.values():
        # Windows make errors go together; noise that is new in every frame makes new ones.
        assert each.mean(real=True) > 3
        assert each.mean("looks_8", real=True) < 10
        assert 0 <= each.temporal_share <= 1
        assert 0 < each.motion.at_rest < 1


def test_the_numbers_of_all_matchers_are_written_with_the_most_cautious_for_any_other(small, tmp_path, monkeypatch):
    monkeypatch.setattr(experiments.correlation, "MATCHERS", {"bm": None, "sgbm": None})
    _, found = run(tmp_path, no_bar, runs=tmp_path / "runs", write=True)
    held = json.loads(small.read_text())["matchers"]
    assert set(held) == {"bm", "sgbm", GENERIC}
    assert held[GENERIC]["correlation_px"] == max(held[name]["correlation_px"] for name in ("bm", "sgbm"))
    assert held[GENERIC]["temporal_share"] == min(held[name]["temporal_share"] for name in ("bm", "sgbm"))
    assert held["bm"]["correlation_px"] == pytest.approx(found["bm"].reach.correlation_px)


def test_written_numbers_replace_those_of_their_names_only(tmp_path, monkeypatch):
    path = tmp_path / "lengths.json"
    path.write_text("{}")
    monkeypatch.setattr(experiments.correlation, "LENGTHS", path)
    write_lengths({"bm": replace(NOTHING, decorrelation_px=np.inf)})
    held = json.loads(path.read_text())["matchers"]
    assert set(held) == {*error_reaches(), "bm"}
    assert held["bm"]["decorrelation_px"] is None
    assert held["sgbm"]["correlation_px"] == error_reaches()["sgbm"].correlation_px


@pytest.mark.parametrize("name", ["onnx", "sgmb"])
def test_a_matcher_that_is_not_measured_is_refused_with_the_choices(name, tmp_path):
    with pytest.raises(InvalidInputError, match=rf"no matcher with a table named '{name}'.* choose from: bm, gc"):
        run(tmp_path, no_bar, runs=tmp_path / "runs", names=[name])


def test_a_missing_rig_is_refused_in_a_line_and_leaves_no_run(tmp_path):
    with pytest.raises(RecordingError, match=r"euroc_static: expected cam0/ and cam1/"):
        run(tmp_path, no_bar, runs=tmp_path / "runs", names=["bm"])
    assert [each for each in (tmp_path / "runs").iterdir() if each.is_dir()] == []


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "cam0_sensor.yaml: missing"),
        ("%YAML:1.0\nintrinsics: [1, 2]\n", "cam0_sensor.yaml: intrinsics, resolution or T_BS do not have"),
    ],
)
def test_a_rig_without_a_whole_calibration_is_refused_naming_the_file(tmp_path, text, reason):
    folder = tmp_path / STATIC
    for side in ("cam0", "cam1"):
        (folder / side).mkdir(parents=True)
        for n in range(3):
            cv2.imwrite(str(folder / side / f"{n}.png"), np.zeros((8, 8), np.uint8))
    if text:
        (folder / "cam0_sensor.yaml").write_text(text)
    with pytest.raises(RecordingError, match=reason):
        static_pairs(tmp_path)


def test_the_rig_that_stands_still_is_rectified(real_data):
    pairs = static_pairs(real_data(str(STATIC)).parents[1])
    assert len(pairs) == 12
    assert pairs[0][0].shape == (480, 752)
    disparity_px, _ = matched("sgbm", *pairs[0], 64)
    assert np.isfinite(disparity_px).mean() > 0.7


LENGTH_PX = {
    ("bm", "teddy"): 27.2,
    ("bm", "motorcycle / 2"): 8.9,
    ("sgbm", "teddy"): 26.9,
    ("sgbm", "motorcycle / 2"): 15.9,
}
"""As `python -m experiments correlation --data ../shared/data` found them."""


@pytest.mark.parametrize(("name", "row"), LENGTH_PX)
def test_the_lengths_on_real_pairs_are_what_they_were(real_data, name, row):
    real = real_scenes(real_data("stereo").parent)
    scene = next(each for each in real if each.row == row)
    # Other OpenCV versions round differently.
    assert autocorrelation(scene_errors(name, scene)).length_px == pytest.approx(LENGTH_PX[name, row], rel=0.1)


def test_slow_matchers_see_the_middle_only(monkeypatch):
    monkeypatch.setattr("experiments.correlation_scenes.SLOW", ("bm",))
    monkeypatch.setattr("experiments.correlation_scenes.SLOW_WINDOW", (100, 200))
    disparity_px, sigma_px = matched("bm", *seen(0, 0), 24)
    known = ~np.isnan(disparity_px)
    assert known[100:200, 140:300].mean() > 0.8
    assert not known[:100].any()
    assert not known[:, :100].any()
    np.testing.assert_array_equal(known, ~np.isnan(sigma_px))
    assert SLOW_WINDOW[0] * SLOW_WINDOW[1] < 100_000


def test_the_command_has_help_with_an_example():
    shown = CliRunner().invoke(app, ["correlation", "--help"])
    assert shown.exit_code == 0
    assert "Example: python -m experiments correlation --data ../shared/data --write" in shown.output
