"""The benchmark's rows survive their JSON, and its tables compare what can be compared."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from experiments.frames import PERIOD_M, FramesConfig, make_frames
from experiments.grid_bench import (
    GrowthRow,
    PipelineRow,
    SpeedRow,
    bench_tables,
    number,
    plain,
    read_rows,
    run,
)
from experiments.grid_contenders import GRIDS, StereogridMap, along
from stereogrid.errors import RecordingError
from stereogrid.geometry import transform

OURS = SpeedRow("stereogrid", 0.1, 320, 8.0, 20, 600.0, 3_000_000, 500_000, 50_000.0)
THEIRS = SpeedRow("octomap", 0.1, 320, 8.0, 20, 20.0, 6_000_000)
GROWTH = [GrowthRow("stereogrid", 0.05, length_m, 300.0, 9.0, int(4e5 * length_m), 100) for length_m in (10.0, 100.0)]
PIPELINE = PipelineRow("both", 0.05, 640, 25.0, 38.0, 55.0, 300)
ROWS = [THEIRS, OURS, replace(OURS, cell_m=0.05), *GROWTH, PIPELINE]


@pytest.fixture
def bench_json(tmp_path):
    """As pytest-benchmark writes it, with a row of somebody else's."""
    benchmarks = [{"extra_info": plain(row)} for row in ROWS] + [{"extra_info": {}}]
    path = tmp_path / "bench.json"
    path.write_text(json.dumps({"datetime": "2026-11-25T00:00:00", "benchmarks": benchmarks}))
    return path


def test_rows_come_back_from_their_json(bench_json):
    assert read_rows(bench_json) == ROWS


@pytest.mark.parametrize(
    "text", ["", "[]", '{"benchmarks": []}', '{"benchmarks": [{"extra_info": {"kind": "speed"}}]}']
)
def test_what_is_no_benchmark_is_refused_by_name(tmp_path, text):
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(RecordingError, match=r"other\.json"):
        read_rows(path)
    with pytest.raises(RecordingError, match=r"none\.json"):
        read_rows(tmp_path / "none.json")


def test_the_ratio_is_that_of_the_same_case_and_a_dash_without_the_other():
    speed, growth, pipeline = bench_tables(ROWS)
    lines = {row[0]: dict(zip(speed.header, row, strict=True)) for row in speed.rows}
    assert lines["0.1"]["times"] == "30"
    assert lines["0.1"]["10^6 cells/s"] == "30"
    assert lines["0.1"]["bytes a known cell"] == "6"
    assert lines["0.05"]["OctoMap fps"] == lines["0.05"]["times"] == "-"
    assert [row[3] for row in growth.rows] == ["4", "40"]
    assert pipeline.rows == [["both", "25", "38", "55", "300"]]


def test_numbers_have_three_digits():
    assert [number(v) for v in (None, 0.01234, 9.876, 99.94, 123.4, 12345.6)] == [
        "-",
        "0.0123",
        "9.88",
        "99.9",
        "123",
        "12,346",
    ]


def test_a_run_leaves_json_csv_tables_and_figure(bench_json, tmp_path):
    folder, _ = run(bench_json, runs=tmp_path / "runs", picture=tmp_path / "picture.png")
    assert {path.name for path in folder.iterdir()} == {
        "bench.json",
        "bench.csv",
        "tables.md",
        "grid-bench.png",
        "run.toml",
    }
    assert read_rows(folder / "bench.json") == ROWS
    with (folder / "bench.csv").open(newline="") as file:
        assert [line["kind"] for line in csv.DictReader(file)] == [plain(row)["kind"] for row in ROWS]
    text = (folder / "tables.md").read_text()
    assert all(table.markdown in text for table in bench_tables(ROWS))
    picture = (tmp_path / "picture.png").read_bytes()
    assert picture == (folder / "grid-bench.png").read_bytes()
    assert len(picture) < 300_000


@pytest.mark.parametrize("kept", [[OURS], GROWTH, [PIPELINE]])
def test_a_part_of_the_rows_is_laid_out_too(tmp_path, kept):
    path = tmp_path / "part.json"
    path.write_text(json.dumps({"benchmarks": [{"extra_info": plain(row)} for row in kept]}))
    folder, tables = run(path, runs=tmp_path / "runs")
    assert len(tables) == 1
    assert (folder / "grid-bench.png").exists() == (kept != [PIPELINE])


def test_a_repeated_drive_goes_on_where_the_period_ends():
    frames = make_frames(FramesConfig(width_px=32, n=10, spacing_m=PERIOD_M / 10))
    steps = list(along(frames, 0.0, 90.0))
    assert len(steps) == 30
    np.testing.assert_allclose([T[0, 3] for _, T in steps], np.arange(30) * 3.0, atol=1e-9)
    np.testing.assert_array_equal(steps[23][0].disparity_px, frames.disparities_px[3])
    assert [T[0, 3] for _, T in along(frames, 60.0, 66.0)] == pytest.approx([60.0, 63.0])


@pytest.mark.parametrize("name", GRIDS)
def test_a_contender_finds_the_walls_and_counts_its_bytes(name):
    if name == "octomap":
        pytest.importorskip("octomap")
    frames = make_frames(FramesConfig(width_px=160, n=3))
    grid = GRIDS[name](0.1, 8.0)
    before = grid.n_bytes
    for disparity, T_world_cam in frames:
        grid.add(grid.prepared(frames.camera, disparity, T_world_cam))
    assert grid.n_bytes > before
    near = np.nan_to_num(frames.disparities_px[0]) > frames.camera.disparity_px(4.0)
    points = transform(frames.poses[0], frames.camera.back_project(np.where(near, frames.disparities_px[0], np.nan)))[
        ::50
    ]
    if isinstance(grid, StereogridMap):
        assert np.nanmean(grid.grid.probability(points) > 0.5) > 0.5
        assert 0 < grid.grid.n_known < grid.n_updates() <= 3 * grid.grid.n_known
    else:
        found = [grid.tree.search(point) for point in points]
        assert np.mean([node.getOccupancy() > 0.5 for node in found]) > 0.5
