"""What the paper's equations do exactly as printed. Each test shows one gap; docs/method.md cites them by name.

Eq. 7 is in test_geometry.py, Eqs. 4 to 6 are in test_camera.py, the corrected forms' own laws in test_sensor_model.py.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid import as_printed, sensor_model
from stereogrid.sensor_model import SensorModel, log_odds

probabilities = st.floats(0.01, 0.99)
sigmas_m = st.floats(1e-3, 3)
ranges_m = st.floats(0.3, 20)


@given(st.floats(1e-6, 20))
def test_eq2_as_printed_gives_impossible_probabilities(l_t):
    """1 - 1 / (1 - e^l) is above 1 for every l > 0 and below 0 for every l < 0: never a probability."""
    assert as_printed.probability(l_t) > 1
    assert as_printed.probability(-l_t) < 0
    assert 0.5 < sensor_model.probability(l_t) < 1
    assert 0 < sensor_model.probability(-l_t) < 0.5


def test_eq2_as_printed_divides_by_zero_where_nothing_is_known():
    assert np.isinf(as_printed.probability(0.0))
    assert as_printed.probability(1.0) == pytest.approx(1.582, abs=1e-3)
    assert sensor_model.probability(0.0) == 0.5


@given(st.floats(-8, 8), probabilities)
def test_eq3_as_printed_moves_the_belief_when_a_reading_only_repeats_the_prior(l_before, prior):
    """l + logit p + logit p0: a reading p = p0 adds 2 logit p0, again and again; corrected it adds nothing."""
    printed = as_printed.fuse(l_before, prior, prior)
    assert printed - l_before == pytest.approx(2 * log_odds(prior), abs=1e-9)
    assert sensor_model.fuse(l_before, prior, prior) == pytest.approx(l_before, abs=1e-12)


def test_eq3_as_printed_turns_a_prior_of_one_fifth_into_certainty_of_free_space():
    """Ten readings that say nothing new."""
    printed = corrected = log_odds(0.2)
    for _ in range(10):
        printed = as_printed.fuse(printed, 0.2, 0.2)
        corrected = sensor_model.fuse(corrected, 0.2, 0.2)
    assert printed == pytest.approx(log_odds(0.2) - 10 * 2.7726, abs=1e-3)
    assert sensor_model.probability(corrected) == pytest.approx(0.2)


@given(st.floats(-8, 8), probabilities, probabilities)
def test_eq3_as_printed_is_right_only_for_a_prior_of_one_half(l_before, p, prior):
    gap = as_printed.fuse(l_before, p, prior) - sensor_model.fuse(l_before, p, prior)
    assert gap == pytest.approx(2 * log_odds(prior), abs=1e-9)
    even = as_printed.fuse(l_before, p, 0.5) - sensor_model.fuse(l_before, p, 0.5)
    assert even == pytest.approx(0, abs=1e-12)


@given(sigmas_m, st.floats(0.01, 0.5), ranges_m)
def test_eq11_as_printed_exceeds_one_where_the_error_is_small_against_k(sigma_m, k_m, range_m):
    """The peak 0.5 + k / (dl sqrt(2 pi)) is above 1 exactly when dl < 0.798 k; the corrected one never is."""
    printed = as_printed.occupancy_probability(range_m, range_m, sigma_m, k_m=k_m, p_min=0.3)
    limit_m = k_m * np.sqrt(2 / np.pi)
    assert limit_m == pytest.approx(0.798 * k_m, rel=1e-3)
    if abs(sigma_m / limit_m - 1) > 1e-9:
        assert (printed > 1) == (sigma_m < limit_m)
    corrected = sensor_model.occupancy_probability(range_m, range_m, sigma_m, cell_m=k_m, model=SensorModel())
    assert 0.25 <= corrected <= 0.9
    if printed > 1:
        assert corrected > 0.5


def test_eq11_as_printed_claims_a_probability_of_almost_four_for_a_near_surface():
    """A wall at 1 m, 0.3 px, 50.04 px m: dz = 6 mm. With k = one cell of 5 cm the print says 3.8."""
    printed = as_printed.occupancy_probability(1.0, 1.0, 0.3 / 50.04, k_m=0.05, p_min=0.3)
    assert printed == pytest.approx(0.5 + 0.05 / (0.3 / 50.04 * 2.5066), rel=1e-4)
    assert printed > 3.8
    corrected = sensor_model.occupancy_probability(1.0, 1.0, 0.3 / 50.04, cell_m=0.05, model=SensorModel())
    assert corrected == pytest.approx(0.9, abs=1e-3)


@given(sigmas_m, st.floats(0.01, 0.5))
def test_eq12_as_printed_never_returns_to_a_prior_other_than_one_half(sigma_m, cell_m):
    """Behind the surface nothing is known. The print says 0.5 there, which through Eq. 3 is news; p0 is not."""
    far_behind_m = 5 + 10 * sigma_m + cell_m
    printed = as_printed.occupancy_probability(far_behind_m, 5.0, sigma_m, k_m=cell_m, p_min=0.05)
    assert printed == pytest.approx(0.5)
    assert sensor_model.fuse(0.0, printed, 0.2) == pytest.approx(1.386, abs=1e-3)
    model = SensorModel(p_free=0.05, prior=0.2)
    corrected = sensor_model.occupancy_probability(far_behind_m, 5.0, sigma_m, cell_m=cell_m, model=model)
    assert corrected == pytest.approx(0.2)
    assert sensor_model.fuse(0.0, corrected, 0.2) == pytest.approx(0, abs=1e-9)


@given(st.floats(0.05, 0.5), st.floats(0.005, 0.1), st.floats(0.25, 0.45))
def test_eq12_as_printed_frees_the_cell_that_holds_the_surface(cell_m, relative_sigma, offset):
    """The print asks the cell's centre: a sharp surface in the rear part of a cell makes that cell free."""
    sigma_m = relative_sigma * cell_m
    measured_m = 2.0 + offset * cell_m
    printed = as_printed.occupancy_probability(2.0, measured_m, sigma_m, k_m=cell_m, p_min=0.3)
    corrected = sensor_model.occupancy_probability(2.0, measured_m, sigma_m, cell_m=cell_m, model=SensorModel())
    share_in_cell = 0.5 - offset
    if offset > 4 * relative_sigma:
        assert printed < 0.5
    if share_in_cell > 3 * relative_sigma:
        assert corrected == pytest.approx(0.9, abs=2e-3)
    assert corrected > 0.6
