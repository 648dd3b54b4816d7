"""A fit to repeated runs finds the motion error that made them, in whatever frames, and says what it cannot know."""

import json
import re

import numpy as np
import pytest
from marked_runs import MARKS_M, MARKS_RAD, noisy_run, noisy_runs

from stereogrid.errors import InvalidInputError
from stereogrid.motion import FitOptions, Growth, Measured, MotionError, Run, Runs, fit_motion
from stereogrid.motion.growth_fit import RunSums
from stereogrid.motion.legs import EXACT
from stereogrid.motion.parameters import parameters

ERROR = MotionError(
    along=Growth(2e-4, 0.01), across=Growth(1e-4, 0.004), heading=Growth(2e-4, 0.01), turn=Growth(1e-3, 0.03)
)
QUICK = FitOptions(resamples=100)
PARTS = ("along", "across", "heading", "turn")


def fitted(runs, options=QUICK, seed=0):
    return fit_motion(runs, np.random.default_rng(seed), options)


def numbers(fit):
    return np.array([(getattr(fit.error, part).a, getattr(fit.error, part).b) for part in PARTS])


@pytest.fixture(scope="module")
def twelve():
    return noisy_runs(ERROR, 12, np.random.default_rng(1), turns=12)


def test_noise_that_errs_as_said_is_fitted_as_said():
    fit = fitted(noisy_runs(ERROR, 200, np.random.default_rng(0), turns=200, steps=4))
    expected = np.array([(getattr(ERROR, part).a, getattr(ERROR, part).b) for part in PARTS])
    np.testing.assert_allclose(numbers(fit)[:, 0], expected[:, 0], rtol=0.15)
    np.testing.assert_allclose(numbers(fit)[:, 1], expected[:, 1], rtol=0.25)
    assert not fit.warnings


def test_what_the_heading_does_sideways_is_left_to_the_heading():
    """The whole way across has a d^3 / 3 + b^2 d^4 / 4 of the heading's growth; what is left for across is nothing."""
    heading = Growth(4e-4, 0.01)
    runs = noisy_runs(MotionError(heading=heading), 120, np.random.default_rng(2), steps=10)
    fit = fitted(runs)
    assert fit.parts["across"].sigma < 0.1 * np.sqrt(heading.a * 125 / 3 + heading.b**2 * 625 / 4)
    ends_m = [run.odo[-1, 1] for run in runs]
    found = fit.error.heading
    assert np.var(ends_m) == pytest.approx(found.a * 125 / 3 + found.b**2 * 625 / 4, rel=0.25)


def test_frames_do_not_matter_while_headings_are_known(twelve):
    def moved(values, yaw, x, y):
        turned = (values[:, 0] + 1j * values[:, 1]) * np.exp(1j * yaw)
        return np.stack([turned.real + x, turned.imag + y, values[:, 2] + yaw], axis=1)

    other = Runs(tuple(Run(r.name, moved(r.odo, 1.0, 3, -2), moved(r.true, -2.0, 50, 7)) for r in twelve))
    np.testing.assert_allclose(numbers(fitted(other)), numbers(fitted(twelve)), rtol=1e-6, atol=1e-12)


def test_headings_may_be_wrapped(twelve):
    def wrapped(values):
        return np.stack([*values[:, :2].T, (values[:, 2] + np.pi) % (2 * np.pi) - np.pi], axis=1)

    other = Runs(tuple(Run(r.name, wrapped(r.odo), wrapped(r.true)) for r in twelve))
    np.testing.assert_allclose(numbers(fitted(other)), numbers(fitted(twelve)), rtol=1e-9, atol=1e-15)


def test_a_wrong_scale_and_a_wrong_track_are_found_as_bias_and_no_spread():
    def biased(run):
        return Run(run.name, run.true * [1.02, 1.02, 1.05], run.true)

    fit = fitted(Runs(tuple(biased(run) for run in noisy_runs(MotionError(), 6, np.random.default_rng(3), turns=6))))
    assert fit.parts["along"].bias == pytest.approx(0.02, rel=1e-6)
    assert fit.parts["turn"].bias == pytest.approx(0.05, rel=1e-6)
    assert max(part.sigma for part in fit.parts.values()) < 1e-4
    assert any("along: the bias (0.02" in warning for warning in fit.warnings)


def test_a_bias_that_is_kept_is_in_b_and_no_longer_warned_of():
    runs = tuple(
        Run(r.name, r.true * [1.02, 1.02, 1.0], r.true) for r in noisy_runs(MotionError(), 6, np.random.default_rng(0))
    )
    fit = fitted(Runs(runs), FitOptions(keep_bias=True, resamples=100))
    assert fit.error.along.b == pytest.approx(0.02, rel=1e-6)
    assert fit.keeps_bias
    assert not any("bias (" in warning for warning in fit.warnings)


def test_measured_truth_is_told_from_the_robots_own_error():
    rng = np.random.default_rng(4)
    runs = []
    for run in noisy_runs(MotionError(along=Growth(b=0.01), heading=Growth(b=0.01)), 200, rng, steps=1):
        noise = rng.standard_normal(run.true.shape) * [0.004, 0.004, 0.01]
        runs.append(Run(run.name, run.odo, run.true + noise))
    knowing = fitted(Runs(tuple(runs)), FitOptions(Measured(0.004, 0.01), resamples=100))
    blind = fitted(Runs(tuple(runs)))
    for part in ("along", "across", "heading"):
        assert getattr(knowing.error, part).a < 0.15 * getattr(blind.error, part).a


def test_both_bootstraps_give_intervals_about_the_estimates_and_the_drawn_ones_reach_higher(twelve):
    upper = {}
    for name in ("drawn", "resampled"):
        fit = fitted(twelve, FitOptions(bootstrap=name, resamples=1000))
        assert all(each.low <= each.value * 1.05 + 1e-12 and each.value <= each.high for each in parameters(fit))
        upper[name] = np.array([part.sigma_bounds[1] for part in fit.parts.values()])
    assert np.all(upper["drawn"] > upper["resampled"])
    assert np.mean(upper["drawn"] / upper["resampled"]) > 1.1


def test_the_same_seed_gives_the_same_numbers(twelve):
    assert fitted(twelve) == fitted(twelve)
    assert fitted(twelve) != fitted(twelve, seed=1)


def test_the_relative_error_of_sigma_is_that_of_so_many_runs(twelve):
    assert fitted(Runs(twelve.runs[:10])).parts["along"].relative_error == pytest.approx(0.2357, abs=1e-4)


def test_the_legs_of_a_bent_drive_add_up_to_its_error_along_the_way_whatever_the_heading_does():
    """Odometry that bends by .1 rad a metre and has no other fault: nothing along, nothing across."""
    d = np.arange(6.0)
    odo = np.stack([np.sin(0.1 * d) / 0.1, (1 - np.cos(0.1 * d)) / 0.1, 0.1 * d], axis=1)
    run = Run("bent", odo, np.stack([d, 0 * d, 0 * d], axis=1))
    np.testing.assert_allclose(EXACT.heading(run)[0], 0.1, atol=1e-12)
    np.testing.assert_allclose(EXACT.across(run)[0], 0, atol=1e-12)
    # What is left is the chord of each metre's arc: d^2 / 24 of the bend.
    np.testing.assert_allclose(EXACT.along(run)[0], np.sinc(0.05 / np.pi) - 1, atol=1e-12)


def without_headings(run):
    bare = [np.stack([*values[:, :2].T, np.full(len(values), np.nan)], axis=1) for values in (run.odo, run.true)]
    return Run(run.name, *bare)


def test_without_headings_across_holds_all_of_the_way_across_and_that_is_said():
    runs = noisy_runs(ERROR, 100, np.random.default_rng(5), steps=4)
    fit = fitted(Runs(tuple(without_headings(run) for run in runs)))
    assert set(fit.parts) == {"along", "across"}
    assert fit.error.heading == fit.error.turn == Growth()
    assert fit.parts["across"].sigma == pytest.approx(np.std([run.odo[-1, 1] for run in runs]), rel=0.2)
    assert fit.warnings[0].startswith("no headings: heading and turn are not fitted")


def test_runs_of_one_mark_at_one_length_are_warned_of_and_all_is_taken_for_scale():
    rng = np.random.default_rng(6)
    fit = fitted(Runs(tuple(noisy_run(f"{n}", ERROR, (5.0,), rng, sign=(-1) ** n) for n in range(10))))
    assert fit.error.along.a == 0
    assert fit.error.along.sigma(5.0) == pytest.approx(ERROR.along.sigma(5.0), rel=0.7)
    assert any("random slip a and scale b cannot be told apart" in warning for warning in fit.warnings)


def test_runs_of_one_length_with_several_marks_need_no_warning(twelve):
    assert not fitted(twelve).warnings


@pytest.mark.parametrize(
    ("runs", "named"),
    [
        (lambda rng: noisy_runs(ERROR, 4, rng, turns=12), "4 straight runs tell a sigma to 41 %"),
        (lambda rng: noisy_runs(ERROR, 12, rng), "0 turns on the spot, fewer than 3: turn is not fitted"),
        (lambda rng: noisy_runs(ERROR, 0, rng, turns=12), "0 straight runs, fewer than 3: along"),
        (
            lambda rng: Runs(tuple(noisy_run(str(n), ERROR, MARKS_M, rng) for n in range(10))),
            "the straight runs all go one way",
        ),
        (
            lambda rng: Runs(tuple(noisy_run(str(n), ERROR, MARKS_RAD, rng, turn=True) for n in range(10))),
            "the turns all go one way",
        ),
        (
            lambda rng: Runs(tuple(noisy_run(str(n), ERROR, MARKS_M, rng, surface="ab"[n % 2]) for n in range(10))),
            r"runs on 2 surfaces \(a, b\) are fitted together",
        ),
        (
            lambda rng: Runs((*noisy_runs(ERROR, 10, rng), noisy_run("tiny", ERROR, (0.005,), rng))),
            "left out: run tiny is neither .* ends 0.005 m from its start .*are the units right",
        ),
    ],
)
def test_what_limits_a_fit_is_said(runs, named):
    warnings = fitted(runs(np.random.default_rng(7))).warnings
    assert any(re.search(named, each) for each in warnings)


@pytest.mark.parametrize("count", [1, 2])
def test_fewer_than_three_runs_are_refused(count):
    with pytest.raises(InvalidInputError, match=f"{count} straight runs and {count} turns .* at least 3"):
        fitted(noisy_runs(ERROR, count, np.random.default_rng(8), turns=count))


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"bootstrap": "none"}, "no bootstrap named 'none'; choose from: drawn, resampled"),
        ({"resamples": 9}, "resamples must be at least 100"),
        ({"level": 1.0}, "level must be between 0 and 1"),
    ],
)
def test_options_that_cannot_be_are_refused_by_name(options, named):
    with pytest.raises(InvalidInputError, match=named):
        FitOptions(**options)


@pytest.mark.parametrize("name", ["position_m", "heading_rad"])
def test_a_measuring_error_that_cannot_be_is_refused_by_name(name):
    with pytest.raises(InvalidInputError, match=f"{name} must be >= 0"):
        Measured(**{name: -1.0})


MM_AND_TICKS = [0.001, 0.001, 0.001534]
"""Of odometry as ARCOS tells it: mm, and 4096 ticks a turn."""
ROUNDED_M = 0.001 * np.sqrt(2 / 12)
"""Odometry and truth are whole millimetres."""


def test_a_simulator_of_others_is_found_to_err_by_its_scale_drawn_once_a_run(real_data):
    data = json.loads((real_data("arcos") / "odo_random_init.json").read_text())
    runs = []
    for number, readings in enumerate(np.array(each, dtype=float) for each in data["runs"]):
        marks = [0, *(int(np.argmax(readings[:, 3] >= mm)) for mm in range(1000, 5001, 1000))]
        odo, true = readings[marks, :3] * MM_AND_TICKS, readings[marks, 3:] * [0.001, 0.001, np.radians(1)]
        runs.append(Run(str(number), odo, true))
    fit = fitted(Runs(tuple(runs)), FitOptions(Measured(ROUNDED_M), resamples=1000))
    along = fit.parts["along"]
    assert 0.0043 <= along.growth.b <= 0.0052
    # No random walk: none at all is within the interval, and the most that is adds a hundredth of the variance.
    assert along.a_bounds[0] < 1e-9
    assert along.a_bounds[1] * 5 < 0.01 * along.sigma**2
    # Drawn uniformly within .75 % of the truth; its mean over ten runs is none.
    assert along.b_bounds[0] <= 0.0075 / np.sqrt(3) <= along.b_bounds[1]
    assert along.bias_bounds[0] <= 0 <= along.bias_bounds[1]
    assert fit.parts["heading"].sigma == 0


def test_sums_of_runs_keep_what_the_marks_tell():
    run = noisy_run("one", ERROR, MARKS_M, np.random.default_rng(9))
    sums = RunSums.of([EXACT.along(run)])
    assert sums.slope * 5 == pytest.approx(EXACT.along(run)[0].sum())
