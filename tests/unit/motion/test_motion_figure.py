"""The figure shows what was fitted: a panel a part, every run, and a band that holds most of them."""

import numpy as np
import pytest
from marked_runs import noisy_runs

from stereogrid.figures import motion_figure
from stereogrid.motion import FitOptions, Growth, MotionError, Run, Runs, fit_motion

ERROR = MotionError(along=Growth(2e-4, 0.01), heading=Growth(2e-4, 0.01), turn=Growth(1e-3, 0.03))


def drawn(runs, **options):
    return motion_figure(runs, fit_motion(runs, np.random.default_rng(0), FitOptions(resamples=100, **options)))


def lines(axes, label):
    return [line for line in axes.get_lines() if line.get_label() == label]


@pytest.mark.parametrize("keep_bias", [False, True])
def test_every_part_has_a_panel_with_all_its_runs_most_of_them_in_the_band(keep_bias):
    runs = noisy_runs(ERROR, 30, np.random.default_rng(1), turns=20, steps=2)
    figure = drawn(runs, keep_bias=keep_bias)
    assert [len(axes.get_lines()) - 2 for axes in figure.axes] == [30, 30, 30, 20]
    for axes in figure.axes:
        (band,) = axes.collections
        corners = band.get_paths()[0].vertices
        low, high = (pick(corners[np.isclose(corners[:, 0], corners[:, 0].max()), 1]) for pick in (np.min, np.max))
        ends = [line.get_ydata()[-1] for line in axes.get_lines() if line.get_marker() == "o"]
        assert np.mean([low <= end <= high for end in ends]) >= 0.85
        (bias,) = lines(axes, "bias")
        middle = 0.0 if keep_bias else bias.get_ydata()[-1]
        assert (low + high) / 2 == pytest.approx(middle, abs=1e-6 * high)


def test_what_was_not_fitted_has_no_panel():
    bare = [values.copy() for run in noisy_runs(ERROR, 5, np.random.default_rng(2)) for values in (run.odo, run.true)]
    for values in bare:
        values[:, 2] = np.nan
    runs = Runs(tuple(Run(str(n), *pair) for n, pair in enumerate(zip(bare[::2], bare[1::2], strict=True))))
    titles = [axes.get_title() for axes in drawn(runs).axes]
    assert [title.split(" ")[0].rstrip(",") for title in titles] == ["along", "across"]
