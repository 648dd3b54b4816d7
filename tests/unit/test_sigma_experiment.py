"""The fit of sigma covers what it should on errors of known spread, and its drawn scenes are what they say."""

import csv
import json
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import check_grad

import experiments.sigma
from experiments.sigma import Row, coverage_figure, fit_and_test, write_tables
from experiments.sigma_fit import Coverage, Sample, _loss, coverage, fit, hats
from experiments.sigma_scenes import PLANES_FAULTS, Scene, draw_planes, plane_scenes
from stereogrid.matching.sigma import KNOTS, SMALLEST_PX, SigmaTable, rows, sigma_tables
from stereogrid.matching.sigma_cues import CUES

NOTHING = np.zeros((1, 1), np.uint8)


def scene(group="planes", step_px=0.0):
    return Scene(group, f"{group}, row", NOTHING, NOTHING, NOTHING * 1.0, NOTHING > 0, 16, step_px)


def sample(rng, group="planes", n=3000, scale=1.0, step_px=0.0, tails=False):
    """Errors whose standard deviation is scale * sqrt(roughness * shift); hidden ones are a hundred times larger."""
    cue = np.stack([np.exp(rng.uniform(np.log(KNOTS[c][0] + 0.01), np.log(KNOTS[c][-1]), n)) for c in CUES])
    spread = scale * np.sqrt(cue[CUES.index("roughness_px")] * cue[CUES.index("shift_px")])
    error = spread * (rng.standard_t(3, n) if tails else rng.normal(size=n))
    visible = np.arange(n) % 10 > 0
    rounding = rng.uniform(-step_px / 2, step_px / 2, n)
    error_px = np.abs(error + rounding) * np.where(visible, 1, 100)
    return Sample(scene(group, step_px), cue.astype(np.float32), error_px, visible)


def test_fitted_sigmas_cover_68_and_95_percent_of_normal_errors_and_follow_their_spread():
    rng = np.random.default_rng(0)
    table = fit([sample(rng), sample(rng)])
    fresh = sample(rng, n=20_000)
    sigma_px = fresh.sigma_px(table)
    found = coverage(fresh, sigma_px)
    assert (found.one, found.two) == (pytest.approx(68, abs=2), pytest.approx(95, abs=1.5))
    spread = np.sqrt(fresh.cues[CUES.index("roughness_px")] * fresh.cues[CUES.index("shift_px")])
    smooth = spread > 2 * SMALLEST_PX
    assert np.median(np.abs(np.log(sigma_px / spread)[smooth])) < 0.15


def test_the_rounding_of_the_truth_does_not_spoil_the_fit():
    exact, rounded = (fit([sample(np.random.default_rng(1), step_px=step, scale=2)]) for step in (0.0, 0.4))
    fresh = sample(np.random.default_rng(2), n=20_000, scale=2)
    medians = [np.median(fresh.sigma_px(table)) for table in (exact, rounded)]
    assert medians[1] == pytest.approx(medians[0], rel=0.15)


def test_long_tails_are_shared_between_the_two_shares():
    """Student's t with 3 degrees has 95 % at 3.2 of its 68 % / 1.06: no scale has both shares right."""
    rng = np.random.default_rng(3)
    table = fit([sample(rng, tails=True)])
    fresh = sample(rng, n=20_000, tails=True)
    found = coverage(fresh, fresh.sigma_px(table))
    assert found.one > 67
    assert found.two < 96


@given(st.floats(0, 3), st.floats(0.04, 2), st.floats(0, 1), st.sampled_from([1, 2]))
def test_taking_the_rounding_from_an_error_is_widening_sigma_by_it(error, sigma, step, times):
    one = Sample(scene(step_px=step), np.zeros((len(CUES), 1), np.float32), np.array([error]), np.array([True]))
    from experiments.sigma_fit import _without_rounding

    widened = error <= times * np.hypot(sigma, step / np.sqrt(12))
    reduced = _without_rounding(one, np.array([0]), times)[0] <= times * sigma
    if abs(error - times * np.hypot(sigma, step / np.sqrt(12))) > 1e-9:
        assert widened == reduced


def test_coverage_counts_what_it_says():
    cue = np.zeros((len(CUES), 4), np.float32)
    one = Sample(scene(step_px=np.sqrt(12)), cue, np.array([0.5, 1.2, 2.5, 9.0]), np.array([True, True, True, False]))
    sigma_px = np.ones(4)
    assert coverage(one, sigma_px, rounding=False) == Coverage(pytest.approx(100 / 3), pytest.approx(200 / 3), 3, 1.0)
    assert coverage(one, sigma_px) == Coverage(pytest.approx(200 / 3), 100.0, 3, 1.0)
    assert coverage(one, sigma_px, hidden=True) == Coverage(50.0, 75.0, 4, 1.0)


def test_the_gradient_of_the_loss_is_its_slope():
    rng = np.random.default_rng(4)
    one = sample(rng, n=400)
    hat, weight = hats(one.cues), np.full(400, 1 / 400)
    log_error = np.log(np.stack([one.error_px, one.error_px / 2]))
    for _ in range(3):
        at = rng.normal(-0.4, 0.3, hat.shape[1])
        slope = check_grad(
            lambda p: _loss(p, hat, log_error, weight)[0], lambda p: _loss(p, hat, log_error, weight)[1], at
        )
        assert slope < 1e-4


def test_the_hats_of_a_pixel_give_the_log_sigma_that_the_library_looks_up():
    rng = np.random.default_rng(5)
    one = sample(rng, n=500)
    chosen = SigmaTable({cue: tuple(rng.uniform(-0.5, 0.5, len(KNOTS[cue]))) for cue in CUES})
    np.testing.assert_allclose(np.exp(hats(one.cues) @ rows(chosen.log_sigma).ravel()), one.sigma_px(chosen), rtol=1e-4)


def test_a_fold_never_fits_to_what_it_is_tested_on(monkeypatch):
    fitted = []

    def spy(samples, start=None):
        fitted.append({each.scene.group for each in samples})
        return SigmaTable({cue: (-1.0,) * len(KNOTS[cue]) for cue in CUES})

    monkeypatch.setattr(experiments.sigma, "fit", spy)
    rng = np.random.default_rng(6)
    groups = ["venus", "teddy", "planes", "corridor 0"]
    samples = [sample(rng, group, n=50) for group in groups] + [sample(rng, "tsukuba", n=50, step_px=1.0)]
    _, found = fit_and_test("bm", samples)
    assert fitted[0] == set(groups)
    assert fitted[1:5] == [set(groups) - {group} for group in groups]
    assert fitted[5:] == [set(groups), {"venus", "teddy"}, {"planes", "corridor 0"}]
    assert [r.scenes for r in found if r.fitted_on == "real"] == ["planes, row", "corridor 0, row"]
    assert [r.scenes for r in found if r.fitted_on == "synthetic"] == ["venus, row", "teddy, row", "tsukuba, row"]


@pytest.mark.parametrize("seed", range(3))
def test_drawn_planes_show_in_the_right_image_what_their_disparity_says(seed):
    (left, right), truth_px = draw_planes(np.random.default_rng(seed))
    assert truth_px.min() > 0
    from experiments.pairs import seen_by_both

    visible = seen_by_both(truth_px)[0]
    row, column = np.nonzero(visible)
    there = column - truth_px[visible]
    seen = np.array([np.interp(t, np.arange(left.shape[1]), right[r]) for t, r in zip(there, row, strict=True)])
    error = np.abs(seen - left[visible])
    # Straight lines between pixels do not follow the finest texture, and edges are mixed.
    assert np.median(error) < 2
    assert np.mean(error > 12) < 0.08


def test_the_same_planes_are_seen_with_every_noise():
    seen = list(plane_scenes(seed=3))
    assert len({each.row for each in seen}) == len(PLANES_FAULTS)
    np.testing.assert_array_equal(seen[0].truth_px, seen[1].truth_px)
    assert np.abs(seen[0].left.astype(int) - seen[len(PLANES_FAULTS) - 1].left).mean() > 1


@contextmanager
def no_bar(what, total):
    class Step:
        def __call__(self):
            pass

        def to(self, share):
            pass

    yield Step()


def test_a_run_leaves_rows_and_a_figure_and_changes_no_table_unless_told_to(tmp_path, monkeypatch):
    monkeypatch.setattr(experiments.sigma, "scenes", lambda data: list(plane_scenes(seed=3))[:2])
    monkeypatch.setattr(experiments.sigma, "TABLES", tmp_path / "sigma_tables.json")
    monkeypatch.setattr(experiments.sigma, "_fold", lambda name, fitted_on, samples, table, held: [])
    monkeypatch.setattr(
        experiments.sigma, "coverage_figure", lambda rows: coverage_figure([Row("bm", "", "a", *[0.0] * 7)])
    )
    folder, found = experiments.sigma.run(tmp_path, no_bar, runs=tmp_path / "runs", names=["bm"])
    assert not (tmp_path / "sigma_tables.json").exists()
    with (folder / "coverage.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(found) == 2
    assert json.loads((folder / "metrics.json").read_text())["rows"][0]["scenes"] == "planes, clean"
    assert (folder / "coverage.png").exists()


def test_written_tables_replace_those_of_their_names_only(tmp_path, monkeypatch):
    path = tmp_path / "sigma_tables.json"
    path.write_text("{}")
    monkeypatch.setattr(experiments.sigma, "TABLES", path)
    new = SigmaTable({cue: (-1.0,) * len(KNOTS[cue]) for cue in CUES})
    write_tables({"bm": new})
    held = json.loads(path.read_text())["tables"]
    assert set(held) == {*sigma_tables(), "bm"}
    assert held["bm"]["gradient"] == [-1.0] * len(KNOTS["gradient"])
    assert held["sgbm"]["gradient"] == list(sigma_tables()["sgbm"].log_sigma["gradient"])
