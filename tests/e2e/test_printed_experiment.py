"""The print against the correction, from the command to its run folder and in its parts."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulated drive needs pybullet (Python 3.10 or 3.11)")

from reports import stands_alone
from small_drives import SMALL, small_drive

from experiments.__main__ import app
from experiments.printed import PrintedConfig
from experiments.printed_arms import (
    ALL,
    AT_LOWER,
    AT_UPPER,
    CORRECTED,
    CUT_OFF,
    FORMS,
    LOST,
    LOW_CORRECTED,
    LOW_PRINTED,
    PRINTED,
    CutOff,
    clamp_scores,
    eq11_peaks,
    with_prior,
)
from stereogrid.cli import run as run_command
from stereogrid.config import GridConfig, MatcherConfig, load_config, save_config
from stereogrid.errors import StereogridError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.observation import Disparity
from stereogrid.scoring import FREE, OCCUPIED, CellLabels
from stereogrid.sensor_model import SensorModel, likelihood_ratios, log_odds

CONFIG = PrintedConfig(n_seeds=2)
CONFIG = replace(CONFIG, mapping=replace(CONFIG.mapping, matcher=MatcherConfig("bm", 32), grid=GridConfig(cell_m=0.1)))
FORWARD = from_rotation(R_BASE_OPTICAL)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("printed")
    save_config(CONFIG, folder / "config.toml")
    drive = small_drive(folder / "drive.mcap")
    options = ("--config", folder / "config.toml", "--recording", drive, "--runs", folder / "runs")
    assert run_command(app, ["printed", *map(str, options)]) == 0
    return folder / "runs" / "latest"


@pytest.fixture(scope="module")
def values(finished):
    with (finished / "scores.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {(r["arm"], r["seed"], r["score"]): float(r["value"]) for r in rows if r["value"]}


def test_every_arm_is_scored_with_every_seed(values):
    assert {key[:2] for key in values} == {(arm, seed) for arm in (*FORMS, CUT_OFF) for seed in ("1", "2")}


def test_the_print_ranks_worse_than_the_correction_with_every_seed_and_prior(values):
    for seed in ("1", "2"):
        assert values[PRINTED, seed, "auc"] < values[CORRECTED, seed, "auc"]
        assert values[LOW_PRINTED, seed, "auc"] < values[LOW_CORRECTED, seed, "auc"]
        assert values[ALL, seed, "unsafe_occupied"] > values[CORRECTED, seed, "unsafe_occupied"]


def test_eq2_cut_off_calls_the_same_cells_occupied(values):
    for seed in ("1", "2"):
        assert values[CUT_OFF, seed, "occupied_f1"] == values[CORRECTED, seed, "occupied_f1"]


def test_no_cell_of_a_real_map_has_a_probability_by_eq2_as_printed(finished):
    table = json.loads((finished / "metrics.json").read_text())["tables"]["Eq. 2 as printed"]
    shares = {row["its probability"]: float(row["share of cells"]) for row in table}
    assert shares["in [0, 1]"] == 0
    assert sum(shares.values()) == pytest.approx(1, abs=1e-4)


def test_the_report_stands_alone_and_the_run_can_be_read_back(finished):
    report = (finished / "report.html").read_text()
    assert stands_alone(report)
    assert report.count("data:image/png;base64,") == 1
    assert load_config(PrintedConfig, finished / "config.toml") == CONFIG


@pytest.mark.parametrize("prior", [0.1, 0.2, 0.5])
def test_with_another_prior_a_reading_is_worth_as_much(prior):
    model = SensorModel()
    assert likelihood_ratios(with_prior(model, prior)) == pytest.approx(likelihood_ratios(model))
    assert with_prior(model, prior).prior == prior


def gain(form, cells_m, prior, fusion):
    """What one look at a wall 3 m ahead adds to the log-odds of cells at cells_m (N, 3)."""
    model = replace(with_prior(SensorModel(), prior), form=form)
    grid = OccupancyGrid(0.05, model=model, fusion=fusion, clamp=None)
    disparity_px = np.full(SMALL.shape, SMALL.disparity_px(3.0), np.float32)
    grid.integrate(SMALL, Disparity(disparity_px, 0.1, correlation_px=np.inf), FORWARD)
    p = grid.probability(cells_m)
    assert not np.isnan(p).any()
    return log_odds(p) - log_odds(prior)


@pytest.mark.parametrize("prior", [0.5, 0.2])
def test_far_before_the_surface_the_print_differs_by_twice_the_log_odds_of_the_prior(prior):
    """Nothing at a prior of .5; -2.77 nat a reading at .2. Of one update a cell: rays differ in number only."""
    before_m = np.stack([np.arange(1.025, 2.2, 0.05), *np.full((2, 24), 0.025)], axis=1)
    gap = gain("printed", before_m, prior, "cell") - gain("corrected", before_m, prior, "cell")
    assert gap == pytest.approx(2 * log_odds(prior), abs=0.01)


def test_at_the_surface_the_print_is_certain_where_the_correction_is_not():
    at_m = np.array([[2.975, 0.025, 0.025], [3.025, 0.025, 0.025]])
    printed, corrected = (gain(form, at_m, 0.5, "cell") for form in ("printed", "corrected"))
    assert (corrected <= log_odds(SensorModel().p_occupied) + 0.01).all()
    assert printed[0] != pytest.approx(corrected[0], abs=0.1)


def test_with_a_prior_of_one_half_rays_that_only_pass_agree_too():
    before_m = np.array([[1.525, 0.025, 0.025], [2.025, 0.025, 0.025]])
    printed, corrected = (gain(form, before_m, 0.5, "sum_of_rays") for form in ("printed", "corrected"))
    assert printed == pytest.approx(corrected, abs=0.01) and (corrected < -5).all()


def row_of_cells(log_odds_of, **options):
    cells = np.stack([np.arange(len(log_odds_of)), *np.zeros((2, len(log_odds_of)), int)], axis=1)
    return OccupancyGrid.from_cells(1.0, cells, log_odds_of, **options)


def test_shares_at_the_clamps_are_counted_among_the_touched_cells_in_view():
    grid = row_of_cells([-6.0, -6.0, -5.9, 0.0, 6.0])
    label = np.array([FREE, OCCUPIED, OCCUPIED, FREE, OCCUPIED, FREE]).reshape(6, 1, 1)
    visible = np.array([1, 1, 1, 1, 1, 1], bool).reshape(6, 1, 1)  # the last one was never touched
    scores = clamp_scores(grid, CellLabels(1.0, np.zeros(3, np.int64), label), visible)
    assert {s.name: s.value for s in scores} == pytest.approx({AT_LOWER: 2 / 5, AT_UPPER: 1 / 5, LOST: 1 / 3})


def test_a_map_without_clamps_has_no_share_at_them():
    grid = row_of_cells([-6.0, 2.0], clamp=None)
    labels = CellLabels(1.0, np.zeros(3, np.int64), np.zeros((2, 1, 1), np.uint8))
    assert all(np.isnan(s.value) for s in clamp_scores(grid, labels, np.ones((2, 1, 1), bool)))


def test_what_is_left_of_eq2_is_the_sign():
    grid = row_of_cells([-3.0, -0.1, 0.0, 0.1, 3.0])
    points = np.stack([np.arange(6) + 0.5, *np.full((2, 6), 0.5)], axis=1)
    assert CutOff(grid).probability(points) == pytest.approx([0, 0, 0.5, 1, 1, np.nan], nan_ok=True)


def test_eq11_exceeds_one_on_every_ray_whose_error_is_below_the_limit_and_on_no_other():
    cell_m, depth_m = 0.05, np.array([1.2, 2.4, 3.6])
    d = np.repeat(SMALL.disparity_px(depth_m)[:, None], SMALL.width_px, axis=1).astype(np.float32)
    d = np.vstack([d, np.full((SMALL.height_px - 3, SMALL.width_px), np.nan, np.float32)])
    wanted_m = np.where(depth_m < 2, 0.5, 2.0) * cell_m  # of dl, but for the slant of the rays: below, above the limit
    sigma_px = np.full(SMALL.shape, 1.0, np.float32)
    sigma_px[:3] = (wanted_m * SMALL.focal_baseline_px_m / depth_m**2)[:, None]
    peaks = eq11_peaks(SMALL, [Disparity(d, sigma_px)] * 2, cell_m=cell_m, edges_m=np.array([0, 1, 2.2, 5.0]))
    assert list(peaks.rays[:2]) == [0, 2 * SMALL.width_px]
    assert np.isnan(peaks.above_one[0]) and list(peaks.above_one[1:]) == [1, 0]
    assert (peaks.largest[2] < 1) and peaks.largest[1] <= 0.5 + 1 / (0.5 * np.sqrt(2 * np.pi))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [({"n_seeds": 0}, "n_seeds"), ({"camera_faults": "foggy"}, "foggy"), ({"obstacles_m": (1.0,)}, "two")],
)
def test_a_wrong_parameter_is_named_before_anything_is_done(wrong, named):
    with pytest.raises(StereogridError, match=named):
        PrintedConfig(**wrong)
