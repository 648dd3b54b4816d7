"""What a sweep is made of: its settings, its table, its figure, and drives that are made once."""

import ast
import csv
import math
import resource
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="sweeps drive through simulated worlds")
pytest.importorskip("distributed", reason="sweeps need the extra sweep")
pytest.importorskip("pyarrow", reason="sweeps need the extra sweep")

from pyarrow import parquet as pq

from experiments import kept, kept_drives
from experiments.drive_experiment import DriveExperimentConfig
from experiments.drives import DriveConfig
from experiments.kept import KeptTexts
from experiments.kept_drives import drive_key, kept_drive, remove_halves
from experiments.parallel import silent_stage
from experiments.sweep_cluster import Place, check_makings, guarded, opened
from experiments.sweep_config import SweepConfig, UnitConfig, load_sweep
from experiments.sweep_figure import seeds_of, sweep_figure
from experiments.sweep_report import best_table, fewest_seeds, first_and_best, higher_is_better, values_of, write_sweep
from experiments.sweep_table import Made, rows_of, write_tables
from experiments.sweep_unit import CODE, attempt, files_of, makings
from stereogrid.config import MatcherConfig, load_config, save_config
from stereogrid.errors import ConfigError, InvalidInputError
from stereogrid.report.environment import PACKAGES
from stereogrid.scoring import SCORE_NAMES, Score

GRID = """
worlds = ["corridor", "office"]
seeds = { from = 1, to = 3 }
[base]
distance_m = 2.0
mapping.grid.cell_m = 0.1
[vary]
"mapping.matcher.name" = ["bm", "sgbm"]
mapping.grid.cell_m = [0.05, 0.1]
[[together]]
"mapping.model.max_range_m" = [4, 5.0]
score_range_m = [4, 5]
"""


def sweep_of(tmp_path: Path, text: str) -> SweepConfig:
    (tmp_path / "sweep.toml").write_text(text)
    return load_sweep(tmp_path / "sweep.toml")


@pytest.fixture
def grid(tmp_path: Path) -> SweepConfig:
    return sweep_of(tmp_path, GRID)


def scores_like(config: SweepConfig, failed: int = -1) -> list[Made]:
    """sgbm is better by 0.1 for every seed, and smaller cells by 0.01; the map of that number failed."""
    made = []
    for unit in config.units():
        better = 0.1 * (unit.config.mapping.matcher.name == "sgbm") + 0.01 * (unit.config.mapping.grid.cell_m < 0.07)
        noise = np.random.default_rng(unit.seed).normal(0, 0.02)
        scores = (Score("occupied_f1", 0.5 + better + noise, "1", 7), Score("accuracy_m", math.nan, "m", 0))
        made.append(Made(unit, scores))
    if failed >= 0:
        made[failed] = Made(made[failed].unit, error="MapTooLargeError: too large, as was meant")
    return made


def test_every_value_meets_every_other_in_every_world_with_every_seed(grid):
    units = list(grid.units())
    assert len(units) == 2 * 2 * 2 * 2 * 3
    met = {
        (c.mapping.matcher.name, c.mapping.grid.cell_m, c.score_range_m, c.world, c.noise_seed)
        for c in (unit.config for unit in units)
    }
    assert len(met) == len(units)
    assert [unit.seed for unit in units] == sorted(unit.seed for unit in units)  # whole seeds first
    assert {unit.config.distance_m for unit in units} == {2.0} and {unit.config.seed for unit in units} == {0}


def test_a_group_varies_together_and_its_numbers_have_the_parameters_types(grid):
    pairs = {(unit.config.mapping.model.max_range_m, unit.config.score_range_m) for unit in grid.units()}
    assert pairs == {(4.0, 4.0), (5.0, 5.0)}
    assert all(type(unit.config.score_range_m) is float for unit in grid.units())


def test_the_reference_is_the_base_where_it_is_listed_and_else_the_first(grid):
    assert grid.reference.label == "matcher.name = bm, grid.cell_m = 0.1, model.max_range_m, score_range_m = 5.0, 5"


def test_what_the_base_leaves_out_is_the_corridor_experiments(grid):
    assert grid.base.mapping.matcher == DriveExperimentConfig().mapping.matcher and grid.base.mapping.grid.cell_m == 0.1
    assert grid.base.mapping.model.max_range_m == 5.0


def test_a_sample_is_of_settings_and_holds_the_reference(tmp_path):
    drawn = sweep_of(tmp_path, "sample = 3\n" + GRID)
    again = sweep_of(tmp_path, "sample = 3\n" + GRID)
    other = sweep_of(tmp_path, "sample = 3\nsample_seed = 3\n" + GRID)
    assert len(drawn.settings) == 3 and drawn.reference in drawn.settings
    assert drawn.settings == again.settings != other.settings
    assert len(list(drawn.units())) == 3 * 2 * 3


def test_a_seed_paints_new_worlds_only_where_that_is_wanted(tmp_path):
    units = list(sweep_of(tmp_path, "seeds = [1, 2]\nnew_worlds = true").units())
    assert [unit.config.drive.seed for unit in units] == [1, 2]
    units = list(sweep_of(tmp_path, "seeds = [1, 2]").units())
    assert [unit.config.drive.seed for unit in units] == [0, 0]


def test_a_sweep_that_was_written_is_the_one_that_is_read(grid, tmp_path):
    save_config(grid, tmp_path / "config.toml")
    assert load_sweep(tmp_path / "config.toml") == grid == load_config(SweepConfig, tmp_path / "config.toml")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[vary]\n"mapping.matcher.nam" = ["bm"]', "unknown key 'mapping.matcher.nam'; did you mean 'name'"),
        (
            '[vary]\n"mapping.matcher.name" = ["bm", "sgmb"]',
            "name = sgmb, corridor, seed 1: no mapping.matcher.name named 'sgmb'; did",
        ),
        ("[vary]\nmapping.grid.cell_m = [0.05, -1]", "cell_m = -1, .*must be positive and finite"),
        ('[vary]\nmapping.grid.cell_m = ["a"]', "'mapping.grid.cell_m' must be float, not 'a'"),
        ("[vary]\nmapping.grid.cell_m = []", "mapping.grid.cell_m is an empty list"),
        ("[vary]\nmapping.grid.cell_m = 0.1", "mapping.grid.cell_m must be a list of values"),
        ("[vary]\nmapping.grid.cell_m = [0.1, 0.1]", "mapping.grid.cell_m lists 0.1 twice"),
        ("[vary]\nnoise_seed = [1, 2]", "'noise_seed' cannot be varied: it is set by seeds"),
        (
            '[vary]\n"mapping.grid" = [{cell_m = 0.1}]\n"mapping.grid.cell_m" = [0.1]',
            "mapping.grid.cell_m' is varied twice",
        ),
        ("[[together]]\npeople = [1, 2]\nevery_m = [1]", "equally many values, not people: 2, every_m: 1"),
        ("[vary]\nmapping.grid.cell_m = [2026-01-01]", "'mapping.grid.cell_m' must be float, not datetime.date"),
        ("seeds = [2026-01-01]", r"'seeds\[0\]' must be int, not datetime.date"),
        ("seeds = [12345678901234567890]", "seeds lists 12345678901234567890, beyond what a table holds"),
        ("[vary]\npeople = [12345678901234567890]", "people lists 12345678901234567890, beyond"),
        ("[base]\nnoise_seed = 12345678901234567890", "seeds lists 12345678901234567890, beyond"),
        (
            "[[together]]\npeople = [1, 2, 1]\nevery_m = [0.5, 0.5, 0.5]",
            r"together of people, every_m lists \[1, 0.5\] twice",
        ),
        ("vary = { mapping = {} }", "mapping must be a list of values, or .*, not {}"),
        ("[vary]\nobstacles_m = [[0.1, 2], [0.1, 2.0]]", r"obstacles_m lists \[0.1, 2.0\] twice"),
        ("seeds = { from = 1, to = 300000 }", "are 300,000 maps, more than most_units = 500"),
        ("seeds = { from = 1, to = 3000000000000 }", "'seeds' would have more than 1,000,000 values"),
        ("seeds = { from = 1 }", "'seeds' must be like {from = 1, to = 20}"),
        ("seeds = { from = 1, to = 2000 }", "are 2,000 maps, more than most_units = 500: raise it"),
        ("seeds = [-1]", "noise_seed must be >= 0"),
        ('worlds = ["corridr"]', "no world named 'corridr'; did you mean 'corridor'"),
        ("worlds = []", "worlds is an empty list"),
        ('wurlds = ["office"]', "unknown key 'wurlds'; did you mean 'worlds'"),
        ("[base]\ndistance = 3", "unknown key 'base.distance'; did you mean 'distance_m'"),
        ('[base]\narm = "loud"', "no base.arm named 'loud'; choose from: ideal"),
        ('score = "f1"', "no score named 'f1'; did you mean 'occupied_f1'"),
    ],
)
def test_what_cannot_be_run_is_refused_by_name_before_anything_is(text, says, tmp_path):
    with pytest.raises(ConfigError, match=says) as caught:
        sweep_of(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "sweep.toml")) and "\n" not in str(caught.value)


def test_values_that_need_each_other_are_not_judged_alone(tmp_path):
    text = '[vary]\n"mapping.matcher.name" = ["onnx"]\n"mapping.matcher.network" = ["a.toml", "b.toml"]'
    with pytest.raises(ConfigError, match=r"a\.toml") as caught:  # which is not there
        sweep_of(tmp_path, text)
    assert "takes none" not in str(caught.value)


def test_parquet_and_csv_hold_the_same_rows_and_numbers_are_numbers(grid, tmp_path):
    results = scores_like(grid, failed=4)
    write_tables(tmp_path, rows_of(grid, results))
    table = pq.read_table(tmp_path / "sweep.parquet")
    with (tmp_path / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    read = table.to_pylist()
    assert table.column_names == list(rows[0]) and len(read) == len(rows) == 2 * 47 + 1
    for parquet, text in zip(read, rows, strict=True):
        assert {name: "" if value is None else str(value) for name, value in parquet.items()} == text
    types = {each.name: str(each.type) for each in table.schema}
    assert types == {
        "mapping.matcher.name": "string",
        "mapping.grid.cell_m": "double",
        "mapping.model.max_range_m": "double",
        "score_range_m": "double",
        "world": "string",
        "seed": "int64",
        "status": "string",
        "error": "string",
        "score": "string",
        "value": "double",
        "unit": "string",
        "n": "int64",
    }
    assert [row["error"] for row in rows if row["status"] == "failed"] == ["MapTooLargeError: too large, as was meant"]


def test_lists_and_sections_are_json_in_the_table(tmp_path):
    config = sweep_of(
        tmp_path, "[vary]\nobstacles_m = [[0.1, 2.0], [0.2, 2.0]]\nmapping.grid = [{cell_m = 0.1}, {cell_m = 0.2}]"
    )
    row = rows_of(config, scores_like(sweep_of(tmp_path, "seeds = { from = 1, to = 5 }"))[:1])[0]
    assert row["obstacles_m"] == "[0.15, 2.4]" and row["mapping.grid"].startswith('{"cell_m": 0.05, "fusion"')


def test_the_best_stand_first_beside_the_paired_difference_from_the_reference(grid):
    table = best_table(grid, values_of(scores_like(grid)))
    of_corridor = [row for row in table.rows if row[0] == "corridor"]
    assert [row[1:3] for row in of_corridor[:2]] == [["sgbm", "0.05"], ["sgbm", "0.05"]]
    assert of_corridor[0][5].startswith("+0.1100 [+0.1100, +0.1100]")  # the seed's noise falls out
    assert next(row for row in of_corridor if row[5] == "reference")[1:3] == ["bm", "0.1"]
    over_all = [row for row in table.rows if row[0] == "these worlds"]
    assert over_all and table.caption == "Best by occupied_f1, 3 seeds"
    assert not any("*" in row[5] for row in table.rows)  # three seeds cannot tell


def test_a_setting_that_fails_on_the_hard_seed_is_not_the_best(tmp_path):
    """Seed 3 is hard for all. sgbm, a little worse than bm on every seed, fails there: its mean is the largest."""
    config = sweep_of(tmp_path, 'seeds = [1, 2, 3]\n[vary]\n"mapping.matcher.name" = ["bm", "gc", "sgbm", "kz2"]')
    worth = {"bm": 0.5, "gc": 0.6, "sgbm": 0.49, "kz2": 0.3}
    made = []
    for unit in config.units():
        name, hard = unit.config.mapping.matcher.name, unit.seed == 3
        score = Score("occupied_f1", worth[name] - 0.4 * hard, "1", 7)
        fails = hard and name in ("sgbm", "kz2")
        made.append(Made(unit, error="too large") if fails else Made(unit, (score,)))
    values = values_of(made)
    table = best_table(config, values)
    assert [row[1] for row in table.rows] == ["gc", "bm", "sgbm", "kz2"]
    assert "those of which every map was made, then the others by their difference" in table.note
    assert list(first_and_best(config, values)) == ["matcher.name = bm", "matcher.name = gc"]


def test_a_score_that_should_be_small_is_ranked_from_the_other_end(tmp_path):
    config = sweep_of(tmp_path, 'score = "accuracy_m"\nseeds = [1, 2]\n[vary]\nmapping.grid.cell_m = [0.1, 0.2, 0.3]')
    made = [Made(u, (Score("accuracy_m", u.config.mapping.grid.cell_m, "m", 1),)) for u in config.units()]
    made[0] = Made(made[0].unit, error="too large")  # of the smallest cells
    assert [row[1] for row in best_table(config, values_of(made)).rows] == ["0.2", "0.3", "0.1"]


@pytest.mark.parametrize(("matchers", "fewest"), [('"bm", "sgbm"', 6), ('"bm", "sgbm", "gc", "kz2"', 7)])
def test_a_star_needs_as_many_seeds_as_the_note_says(matchers, fewest, tmp_path):
    assert fewest_seeds(matchers.count(",")) == fewest
    for n, star in ((fewest - 1, False), (fewest, True)):
        text = f'seeds = {{ from = 1, to = {n} }}\n[vary]\n"mapping.matcher.name" = [{matchers}]'
        config = sweep_of(tmp_path, text)
        table = best_table(config, values_of(scores_like(config)))
        assert table.rows[0][1] == "sgbm" and table.rows[0][3].endswith(" *") == star
        assert f"fewer than {fewest} seeds" in table.note


def test_each_score_has_a_better_side():
    low = {name for name in SCORE_NAMES if not higher_is_better(name)}
    assert {"log_loss_balanced_all", "ece_width", "accuracy_p95_m", "chamfer_m", "unsafe_occupied", "entropy"} <= low
    high = {"auc_all_tolerant", "obstacle_occupied_f1", "coverage_free", "surface_f1_5_cm", "occupied_iou"}
    assert all(map(higher_is_better, high)) and not low & high


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_the_figure_shows_a_mean_for_each_choice(n, grid, tmp_path):
    kept_axes = dict(list(grid.vary.items())[: min(n, 2)])
    config = SweepConfig(
        grid.base, kept_axes, grid.together if n == 3 else (), worlds=("corridor", "office"), seeds=(1, 2, 3)
    )
    values = values_of(scores_like(config))
    figure = sweep_figure(config, values)
    assert len(figure.axes) == 2 * (2 if n == 3 else 1)
    lines = [line for line in figure.axes[0].lines if line.get_linestyle() == "-" and line.get_marker() != "None"]
    assert len(lines) == (2 if n >= 2 else 1)
    for c, line in enumerate(lines):
        for x, y in enumerate(line.get_ydata()):
            seeds = seeds_of(config, values, "corridor", (x, c, 0))
            assert y == pytest.approx(np.mean(list(seeds.values())))


def test_what_else_varies_is_averaged_in_the_figure(grid):
    config = SweepConfig(grid.base, {**grid.vary, "people": [0, 1], "every_m": [0.2, 0.3]}, seeds=(1, 2))
    made = (Made(unit, (Score("occupied_f1", 0.5 + unit.config.every_m, "1", 1),)) for unit in config.units())
    values = values_of(list(made))
    assert seeds_of(config, values, "corridor", (0, 0, 0)) == pytest.approx({1: 0.75, 2: 0.75})


def test_a_sweep_of_failures_alone_has_a_report_that_lists_them(tmp_path):
    config = sweep_of(tmp_path, "seeds = [1, 2]")
    results = [Made(unit, error=f"no luck {unit.seed}") for unit in config.units()]
    assert write_sweep(tmp_path, config, results, facts={}) == []
    report = (tmp_path / "report.html").read_text()
    assert "no luck 1" in report and "no luck 2" in report and "2 of them failed" in report


def test_two_who_need_a_drive_at_once_drive_it_once(tmp_path, monkeypatch):
    driven, real = [], kept_drives.record

    def counting(drive, path, stage):
        driven.append(path.name)
        assert not (tmp_path / path.name.removeprefix(".half-")).exists()
        return real(drive, path, stage)

    monkeypatch.setattr(kept_drives, "record", counting)
    drive = DriveConfig(every_m=0.25, distance_m=0.25, width_px=64, height_px=48)
    with ThreadPoolExecutor(2) as pool:
        paths = [each.result() for each in [pool.submit(kept_drive, drive, tmp_path, silent_stage) for _ in range(2)]]
    assert len(driven) == 1 and paths[0] == paths[1] and paths[0].stat().st_size
    half = tmp_path / f".half-{paths[0].name}"
    half.touch()
    remove_halves(tmp_path)
    assert not half.exists() and paths[0].exists()


def test_a_drive_is_made_anew_where_what_records_it_changed(tmp_path, monkeypatch):
    for folder in ("sim", "stereogrid"):
        shutil.copytree(kept.ROOT / folder, tmp_path / folder)
    monkeypatch.setattr(kept, "ROOT", tmp_path)
    before = drive_key(DriveConfig())
    assert drive_key(DriveConfig()) == before != drive_key(DriveConfig(every_m=0.3))
    monkeypatch.setattr(kept_drives, "package_version", lambda name: "9" if name == "pybullet" else version(name))
    other_versions = drive_key(DriveConfig())
    (tmp_path / "stereogrid" / "recording" / "mcap.py").write_text("")
    assert len({before, other_versions, drive_key(DriveConfig())}) == 3


def test_another_network_under_the_same_name_makes_other_scores(tmp_path):
    pytest.importorskip("onnx")
    from tiny_networks import write_network

    network = tmp_path / "net.toml"
    inputs = 'inputs = [{name = "left", image = "left"}, {name = "right", image = "right"}]'
    network.write_text(f'weights = "net.onnx"\n{inputs}\n')
    write_network(tmp_path / "net.onnx")
    matcher = MatcherConfig("onnx", network=str(network))
    before = files_of(matcher)
    assert before.keys() == {"network", "weights"} and files_of(matcher) == before
    write_network(tmp_path / "net.onnx", sign=-1)
    after = files_of(matcher)
    assert after["network"] == before["network"] and after["weights"] != before["weights"]
    network.write_text(f"# other\n{network.read_text()}")
    assert files_of(matcher)["network"] != before["network"]
    # A worker on a computer that has other files says so.
    config = UnitConfig(mapping=replace(UnitConfig().mapping, matcher=matcher))
    assert "other files of the network" in guarded(asdict(config), "none", makings(), before)["error"]
    assert files_of(MatcherConfig()) == {}


def test_versions_that_scores_depend_on_are_all_told():
    assert {"numpy", "scipy", "numba", "onnxruntime", "pybullet"} <= set(PACKAGES)
    assert f"scipy {version('scipy')}" in makings()["versions"]


def test_a_full_disk_is_no_maps_fault(tmp_path):
    """The drive does not fit: the unit is neither made nor failed, and the sweep ends with one line."""
    config = sweep_of(tmp_path, "[base]\ndistance_m = 0.25\nwidth_px = 64\nheight_px = 48")
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, limits[1]))  # which are open
    try:
        result = attempt(asdict(config.base), str(tmp_path / "drives"))
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    assert result.keys() == {"stopped"} and "Too many open files" in result["stopped"]


def test_a_failure_is_kept_until_it_is_dropped(tmp_path):
    store = KeptTexts(tmp_path / "failed")
    assert store.get("a") is None
    store.keep("a", "no luck: é")
    assert KeptTexts(tmp_path / "failed").get("a") == "no luck: é"
    store.drop("a")
    store.drop("a")
    assert store.get("a") is None


def test_the_key_of_a_unit_is_of_all_the_code_of_the_experiments_that_makes_its_scores():
    """What its modules import from their neighbours is in the key; but for bars, keys, and what writes reports."""
    named = {each for each in CODE if each.startswith("experiments/")}
    used = set()
    for path in named:
        for node in ast.walk(ast.parse((kept.ROOT / path).read_text())):
            if isinstance(node, ast.ImportFrom) and node.level == 1:
                used.add(f"experiments/{node.module}.py")
    besides = {"drive_report", "kept", "kept_drives", "parallel", "sweep_config"}
    assert used - named == {f"experiments/{each}.py" for each in besides}
    assert all((kept.ROOT / each).exists() for each in (*CODE, *kept.NO_SCORE_DEPENDS_ON))


def test_a_worker_with_other_code_or_other_libraries_is_refused_in_one_line():
    ours = {"code": "a", "versions": "numpy 2"}
    check_makings(ours, dict(ours), "worker")
    with pytest.raises(InvalidInputError, match="worker tcp://x has another checkout"):
        check_makings(ours, ours | {"code": "b"}, "worker tcp://x")
    with pytest.raises(InvalidInputError, match="worker has numpy 1; we have numpy 2"):
        check_makings(ours, ours | {"versions": "numpy 1"}, "worker")


def test_a_scheduler_that_does_not_answer_is_given_up_in_one_line(monkeypatch):
    monkeypatch.setattr("experiments.sweep_cluster.GIVE_UP_S", 0.5)
    address = "tcp://127.0.0.1:9"
    refused = pytest.raises(InvalidInputError, match=f"no dask scheduler answers at {address}")
    with refused as caught, opened(Place(scheduler=address), Path("drives")):
        pass
    assert "\n" not in str(caught.value)


def test_a_cluster_takes_no_options_of_this_machine():
    with pytest.raises(InvalidInputError, match="a cluster has its own workers"):
        Place(scheduler="tcp://a:1", workers=2)
    with pytest.raises(InvalidInputError, match="must be 0 or more"):
        Place(workers=-1)
