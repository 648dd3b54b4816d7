"""The main experiment, whole: what `make demo` promises."""

import hashlib
import json
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulated drive needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone

from experiments.corridor import IDEAL, NOISY, SHUFFLED, TRUE_DEPTH, CorridorConfig, run
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig, load_config
from stereogrid.errors import StereogridError
from stereogrid.grid import OccupancyGrid
from stereogrid.recording import open_recording


@contextmanager
def quiet_stage(what, total):
    class Step:
        def __call__(self):
            pass

        def to(self, share):
            assert 0 <= share <= 1

    yield Step()


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory):
    runs = tmp_path_factory.mktemp("corridor") / "runs"
    folder, outcomes = run(CorridorConfig(), quiet_stage, runs=runs, command="test")
    return folder, outcomes


def test_block_matching_with_true_poses_maps_the_corridor(whole_run):
    _, outcomes = whole_run
    assert outcomes[IDEAL].value("auc") >= 0.95
    assert outcomes[IDEAL].value("occupied_f1") >= 0.70


def test_true_depth_is_a_ceiling(whole_run):
    _, outcomes = whole_run
    ceiling, ideal = outcomes[TRUE_DEPTH], outcomes[IDEAL]
    for better_high in ("occupied_f1", "obstacle_occupied_f1"):
        assert ceiling.value(better_high) >= ideal.value(better_high)
    # Both see all there is; an error now and then hits a cell that a surface only touches.
    assert ceiling.value("coverage_occupied") > 0.995
    for better_low in ("brier", "brier_balanced", "log_loss", "accuracy_m"):
        assert ceiling.value(better_low) <= ideal.value(better_low)


def test_noise_costs_something_but_not_the_map(whole_run):
    _, outcomes = whole_run
    assert outcomes[SHUFFLED].value("auc") < outcomes[NOISY].value("auc") < outcomes[IDEAL].value("auc")


def test_shuffled_poses_know_nothing_of_the_obstacles(whole_run):
    _, outcomes = whole_run
    assert outcomes[SHUFFLED].value("obstacle_auc") == pytest.approx(0.5, abs=0.06)
    assert outcomes[SHUFFLED].value("obstacle_occupied_f1") < 0.1


def test_the_run_folder_holds_everything_and_its_report_stands_alone(whole_run):
    folder, outcomes = whole_run
    assert (folder.parent / "latest").resolve() == folder.resolve()
    metrics = json.loads((folder / "metrics.json").read_text())
    assert set(metrics["arms"]) == set(outcomes)
    assert metrics["facts"]["drive seed"] == "0" and metrics["facts"]["drive every_m"] == "0.25"
    assert metrics["arms"][IDEAL]["auc"]["value"] == pytest.approx(outcomes[IDEAL].value("auc"))
    assert load_config(CorridorConfig, folder / "config.toml") == CorridorConfig()
    grid = OccupancyGrid.load(folder / "map-ideal.sgrid")
    assert grid.sha256() == outcomes[IDEAL].mapped.grid.sha256()
    assert {"slice.png", "cubes.png", "disparity.png", "reliability-ideal.png"} <= {p.name for p in folder.iterdir()}
    report = (folder / "report.html").read_text()
    assert stands_alone(report)
    assert report.count("data:image/png;base64,") == len(list(folder.glob("*.png")))


def short(seed: int) -> CorridorConfig:
    return replace(CorridorConfig(), seed=seed, distance_m=1.5)


def digests(folder: Path) -> dict[str, str]:
    """Hashes of the images, the odometry and the maps of a run."""
    images, odometry = hashlib.sha256(), hashlib.sha256()
    for observation in open_recording(folder / "drive.mcap"):
        images.update(observation.left.tobytes() + observation.right.tobytes())
        odometry.update(np.float64(observation.stamp_s).tobytes() + observation.odometry.T_odom_base.tobytes())
    maps = {path.name: OccupancyGrid.load(path).sha256() for path in folder.glob("*.sgrid")}
    return {"images": images.hexdigest(), "odometry": odometry.hexdigest(), **maps}


def test_the_same_seed_gives_the_same_hashes_and_another_seed_does_not(tmp_path):
    first, again, other = (
        digests(run(short(seed), quiet_stage, runs=tmp_path / name)[0])
        for name, seed in (("first", 3), ("again", 3), ("other", 4))
    )
    assert first == again
    assert first["images"] != other["images"] and first["map-ideal.sgrid"] != other["map-ideal.sgrid"]


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"wheel_faults": "square"}, "no wheel faults named 'square'; choose from: good, none, worn"),
        ({"people": -1}, "people"),
        ({"camera_faults": "foggy"}, "foggy.*ideal, mild"),
        ({"every_m": -1.0}, "every_m"),
        ({"score_range_m": float("nan")}, "score_range_m"),
        ({"seed": -1}, "seed"),
        ({"mapping": MappingConfig(matcher=MatcherConfig("sgmb"))}, "sgmb.*bm, .*sgbm"),
        ({"mapping": MappingConfig(grid=GridConfig(cell_m=1e-4))}, "GB"),
    ],
)
def test_a_wrong_parameter_is_named_before_anything_is_done(wrong, named):
    with pytest.raises(StereogridError, match=named):
        CorridorConfig(**wrong)


def test_a_failed_run_leaves_earlier_results_and_nothing_of_its_own(tmp_path):
    before = run(short(0), quiet_stage, runs=tmp_path)[0]
    (tmp_path / "cut.mcap").write_bytes((before / "drive.mcap").read_bytes()[:200_000])
    with pytest.raises(StereogridError):
        run(short(0), quiet_stage, runs=tmp_path, recording=tmp_path / "cut.mcap")
    (tmp_path / "cut.mcap").unlink()
    with pytest.raises(StereogridError, match="nowhere"):
        run(short(0), quiet_stage, runs=tmp_path, recording=tmp_path / "nowhere.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([before.name, "latest"])
