"""The inverse sensor model's laws: Eqs. 2, 3 and 8 to 13 corrected. What the print does is in test_as_printed.py."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.special import ndtr

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.sensor_model import (
    REACH_BEHIND_SIGMAS,
    REACH_SIGMAS,
    SensorModel,
    depth_interval_m,
    depth_sigma_m,
    fuse,
    kernel_parameters,
    likelihood_ratio,
    likelihood_ratios,
    log_odds,
    occupancy_probability,
    odds,
    probability,
    range_and_sigma_m,
    reach_behind,
    widened_sigma_px,
)

CAMERA = StereoCamera(focal_px=834, cx_px=319.5, cy_px=239.5, baseline_m=0.06, width_px=640, height_px=480)

probabilities = st.floats(0.001, 0.999)
sigmas_m = st.floats(1e-4, 5)
cells_m = st.floats(0.005, 1)
ranges_m = st.floats(0.2, 50)
depths_m = st.floats(0.2, 30)
sigmas_px = st.floats(0.02, 2)
models = (
    st.lists(st.floats(0.01, 0.99), min_size=3, max_size=3, unique=True)
    .map(sorted)
    .map(lambda p: SensorModel(p_free=p[0], prior=p[1], p_occupied=p[2]))
)


@given(st.floats(-12, 12))
def test_eq2_log_odds_and_probability_are_inverse(l_t):
    assert log_odds(probability(l_t)) == pytest.approx(l_t, abs=1e-9)


@given(st.floats(-700, 700), st.floats(-700, 700))
def test_eq2_more_log_odds_are_never_less_probable_and_signs_mirror(a, b):
    low, high = sorted((a, b))
    assert probability(low) <= probability(high)
    assert probability(a) + probability(-a) == pytest.approx(1)
    assert 0 < probability(-abs(a)) <= 0.5


def test_eq2_known_probabilities():
    np.testing.assert_allclose(probability([0, np.log(9), -np.log(9)]), [0.5, 0.9, 0.1])
    assert probability(-50.0) == pytest.approx(np.exp(-50), rel=1e-9)
    assert probability(1e4) == 1


@given(probabilities, st.lists(probabilities, min_size=1, max_size=6), st.randoms(use_true_random=False))
def test_eq3_does_not_depend_on_the_order_of_the_readings(prior, readings, random):
    shuffled = random.sample(readings, len(readings))
    forward = backward = log_odds(prior)
    for p, q in zip(readings, shuffled, strict=True):
        forward, backward = fuse(forward, p, prior), fuse(backward, q, prior)
    assert forward == pytest.approx(backward, abs=1e-9)


@given(probabilities, probabilities)
def test_eq3_the_first_reading_alone_is_the_belief(prior, p):
    assert probability(fuse(log_odds(prior), p, prior)) == pytest.approx(p)


@given(probabilities, probabilities, probabilities)
def test_eq3_is_bayes_rule_for_independent_readings(prior, p, q):
    """By the odds: O(m|z1, z2) = O(m|z1) O(m|z2) / O(m)."""
    expected = odds(p) * odds(q) / odds(prior)
    fused = fuse(fuse(log_odds(prior), p, prior), q, prior)
    assert np.exp(fused) == pytest.approx(expected, rel=1e-9)


@given(depths_m, sigmas_px)
def test_eq8_is_the_slope_of_depth_over_disparity(depth_m, sigma_px):
    d, step = CAMERA.disparity_px(depth_m), 1e-5
    slope = (CAMERA.depth_m(d * (1 - step)) - CAMERA.depth_m(d * (1 + step))) / (2 * step * d)
    assert depth_sigma_m(CAMERA, depth_m, sigma_px) == pytest.approx(slope * sigma_px, rel=1e-6)


def test_eq8_known_error():
    """834 px x 60 mm and 0.3 px: 6 mm at 1 m, 15 cm at 5 m."""
    np.testing.assert_allclose(depth_sigma_m(CAMERA, [1, 5], 0.3), [0.005995, 0.149880], atol=1e-6)


@given(depths_m, sigmas_px)
def test_eq8_first_order_lies_within_the_skewed_exact_interval(depth_m, sigma_px):
    d = CAMERA.disparity_px(depth_m)
    assume(sigma_px < 0.99 * d)
    near, far = depth_interval_m(CAMERA, d, sigma_px)
    assert CAMERA.disparity_px(near) - d == pytest.approx(sigma_px)
    assert d - CAMERA.disparity_px(far) == pytest.approx(sigma_px)
    first_order = depth_sigma_m(CAMERA, depth_m, sigma_px)
    assert depth_m - near <= first_order <= far - depth_m


@given(depths_m)
def test_eq8_understates_the_far_side_by_a_fifth_where_a_fifth_of_the_disparity_is_uncertain(depth_m):
    """Exact: far - z = z r / (1 - r) with r = dd / d; first order: z r. At r = 0.2 that is .25 z against .2 z."""
    d = CAMERA.disparity_px(depth_m)
    _, far = depth_interval_m(CAMERA, d, 0.2 * d)
    assert far - depth_m == pytest.approx(0.25 * depth_m)
    assert depth_sigma_m(CAMERA, depth_m, 0.2 * d) == pytest.approx(0.2 * depth_m)


@given(depths_m, st.floats(1, 5))
def test_eq8_the_far_end_is_infinite_where_the_disparity_could_be_zero(depth_m, ratio):
    d = CAMERA.disparity_px(depth_m)
    near, far = depth_interval_m(CAMERA, d, ratio * d)
    assert np.isinf(far)
    assert 0 < near < depth_m


points = st.tuples(st.floats(-10, 10), st.floats(-10, 10), st.floats(0.3, 30)).map(np.array)


@given(points, sigmas_px)
def test_eq9_and_eq10_are_the_length_of_the_ray_and_its_stretch_with_depth(p, sigma_px):
    depth_sigma = depth_sigma_m(CAMERA, p[2], sigma_px)
    (range_m,), (range_sigma,) = range_and_sigma_m([p], depth_sigma)
    assert range_m == pytest.approx(np.sqrt(p @ p))
    # The pixel is known: an error of depth moves the point along its ray.
    moved = p * (1 + depth_sigma / p[2])
    assert np.linalg.norm(moved) - range_m == pytest.approx(range_sigma, rel=1e-6)
    assert range_sigma >= depth_sigma * (1 - 1e-12)


def test_eq9_and_eq10_known_ray():
    """(3, 4, 12) m is 13 m away; 1.2 m of depth are 1.3 m of range."""
    range_m, sigma_m = range_and_sigma_m([[3, 4, 12]], 1.2)
    np.testing.assert_allclose([range_m, sigma_m], [[13], [1.3]])


@given(models, ranges_m, ranges_m, sigmas_m, cells_m)
def test_eq11_stays_within_its_claims_for_every_range_error_and_cell(model, range_m, measured_m, sigma_m, cell_m):
    hit, passed = likelihood_ratios(model)
    ratio = likelihood_ratio(range_m, measured_m, sigma_m, cell_m=cell_m, model=model)
    assert ratio > 0
    assert passed - 1e-12 * hit <= ratio <= hit * (1 + 1e-12)
    p = occupancy_probability(range_m, measured_m, sigma_m, cell_m=cell_m, model=model)
    assert 0 < model.p_free - 1e-12 <= p <= model.p_occupied + 1e-12 < 1


@given(models)
def test_eq11_the_surest_ratios_lead_from_the_prior_to_the_claims(model):
    hit, passed = likelihood_ratios(model)
    assert passed < 1 < hit
    assert fuse(0.0, model.p_occupied, model.prior) == pytest.approx(np.log(hit), abs=1e-9)
    assert fuse(0.0, model.p_free, model.prior) == pytest.approx(np.log(passed), abs=1e-9)


@given(models, ranges_m, ranges_m, sigmas_m, cells_m)
def test_eq12_is_the_posterior_of_the_prior_under_the_likelihood_ratio(model, range_m, measured_m, sigma_m, cell_m):
    """Bayes' rule by the odds: what Eq. 3 adds is the logarithm of the ratio, whatever the prior."""
    ratio = likelihood_ratio(range_m, measured_m, sigma_m, cell_m=cell_m, model=model)
    p = occupancy_probability(range_m, measured_m, sigma_m, cell_m=cell_m, model=model)
    assert p / (1 - p) == pytest.approx(ratio * odds(model.prior), rel=1e-9)
    assert fuse(0.0, p, model.prior) == pytest.approx(np.log(ratio), abs=1e-9)


@given(models, sigmas_m, cells_m)
def test_eq11_the_cell_that_is_read_weighs_hit_passed_and_hidden_by_their_probabilities(model, sigma_m, cell_m):
    """Centred on the reading: in it with Phi(h) - Phi(-h), and as often in front of it as behind."""
    within = 2 * ndtr(cell_m / (2 * sigma_m)) - 1
    hit, passed = likelihood_ratios(model)
    ratio = likelihood_ratio(4.0, 4.0, sigma_m, cell_m=cell_m, model=model)
    assert ratio == pytest.approx(within * hit + (1 - within) * (passed + 1) / 2, rel=1e-9)


def test_eq11_known_peak():
    """A cell as wide as two sigmas holds the surface with 68.27 %: 9 x .6827 + (1/3 + 1) / 2 x .3173 = 6.356 to 1."""
    model = SensorModel(p_free=0.25, p_occupied=0.9)
    assert likelihood_ratio(4.0, 4.0, 0.1, cell_m=0.2, model=model) == pytest.approx(6.355745, abs=1e-6)
    assert occupancy_probability(4.0, 4.0, 0.1, cell_m=0.2, model=model) == pytest.approx(0.864052, abs=1e-6)


@given(models, st.floats(-0.45, 0.45), cells_m)
def test_eq11_a_thin_reading_claims_its_whole_cell_wherever_in_it_the_surface_lies(model, place, cell_m):
    hit, _ = likelihood_ratios(model)
    ratio = likelihood_ratio(4.0, 4.0 + place * cell_m, cell_m / 200, cell_m=cell_m, model=model)
    assert ratio == pytest.approx(hit, rel=1e-9)


@given(models, st.floats(0.001, 0.2), cells_m)
def test_eq11_a_sharper_reading_is_never_less_sure_of_its_own_cell(model, sigma_m, cell_m):
    sharp, blunt = (occupancy_probability(4.0, 4.0, s, cell_m=cell_m, model=model) for s in (sigma_m, 2 * sigma_m))
    assert sharp >= blunt


@pytest.mark.parametrize("cell_m", [0.02, 0.1, 0.6])
@pytest.mark.parametrize("model", [SensorModel(), SensorModel(p_free=0.05, prior=0.2, p_occupied=0.7)])
def test_eq12_is_the_mean_over_the_places_where_the_surface_may_lie(model, cell_m):
    """Draw the surface around the reading: A where the cell holds it, F where it is passed, 1 where it is hidden."""
    hit, passed = likelihood_ratios(model)
    measured_m, sigma_m, n = 3.0, 0.1, 200_000
    surface_m = np.random.default_rng(5).normal(measured_m, sigma_m, n)
    for range_m in measured_m + np.array([-0.5, -0.2, -0.1, 0, 0.07, 0.15, 0.3, 0.5]):
        near, far = range_m - cell_m / 2, range_m + cell_m / 2
        each = np.select([surface_m < near, surface_m < far], [1.0, hit], passed)
        ratio = likelihood_ratio(range_m, measured_m, sigma_m, cell_m=cell_m, model=model)
        # Four standard errors of the mean; where all draws agree, three draws of n could have missed the rest.
        assert ratio == pytest.approx(each.mean(), abs=4 * each.std() / np.sqrt(n) + 3 * hit / n)


def shares(near_m, far_m, measured_m, sigma_m):
    """How far the ratio of the cell from near_m to far_m is A, F and 1: it is linear in A and F, so three models tell.

    Shapes broadcast; (3, ...).
    """

    def ratio(p_free, p_occupied):
        model = SensorModel(p_free=p_free, p_occupied=p_occupied)
        return likelihood_ratio((near_m + far_m) / 2, measured_m, sigma_m, cell_m=far_m - near_m, model=model)

    # Odds of .1, .2, 4 and 9.
    base = ratio(1 / 11, 0.8)
    in_it = (ratio(1 / 11, 0.9) - base) / 5
    behind_it = (ratio(1 / 6, 0.8) - base) / 0.1
    return np.array([in_it, behind_it, base - 4 * in_it - 0.1 * behind_it])


@given(sigmas_m, st.floats(-1, 1), st.integers(1, 12), st.floats(0.01, 0.3))
def test_eq11_a_coarse_cell_holds_the_reading_of_its_parts(sigma_m, offset_m, n_parts, part_m):
    """It holds the surface where one of them does, is passed where the last is, and hidden where the first is."""
    edges_m = 5 + part_m * np.arange(n_parts + 1)
    hit, passed, hidden = shares(edges_m[:-1], edges_m[1:], 5 + offset_m, sigma_m)
    whole = shares(edges_m[0], edges_m[-1], 5 + offset_m, sigma_m)
    np.testing.assert_allclose(whole, [hit.sum(), passed[-1], hidden[0]], atol=1e-9)


@given(ranges_m, ranges_m, sigmas_m, cells_m)
def test_eq11_the_three_shares_are_a_distribution(range_m, measured_m, sigma_m, cell_m):
    found = shares(range_m - cell_m / 2, range_m + cell_m / 2, measured_m, sigma_m)
    assert found.sum() == pytest.approx(1, abs=1e-9)
    assert (found >= -1e-9).all()


def test_eq11_the_cells_of_a_ray_share_one_surface():
    """The surface lies in exactly one cell: over a ray the hit parts sum to 1, whatever the error."""
    edges_m = 0.05 * np.arange(401)
    for sigma_m in (0.01, 0.07, 0.5):
        hit, _, _ = shares(edges_m[:-1], edges_m[1:], 10.012, sigma_m)
        assert hit.sum() == pytest.approx(1, abs=1e-9)


@given(models, sigmas_m, cells_m, st.floats(-8, 8), st.floats(1e-6, 1))
def test_eq12_has_no_step_anywhere(model, sigma_m, cell_m, u, step):
    """The print's jump of P_occ at l_p is gone: the slope is at most (A - F) phi(0) / dl."""
    hit, passed = likelihood_ratios(model)
    at_m = 50 + u * sigma_m
    before, after = likelihood_ratio([at_m, at_m + step * sigma_m], 50.0, sigma_m, cell_m=cell_m, model=model)
    assert abs(after - before) <= (hit - passed) * step / np.sqrt(2 * np.pi) + 1e-12 * hit


@given(models, sigmas_m, cells_m)
def test_eq12_is_free_well_in_front_and_the_prior_well_behind(model, sigma_m, cell_m):
    reach_m = cell_m / 2 + 7 * sigma_m
    front, behind = occupancy_probability([60 - reach_m, 60 + reach_m], 60.0, sigma_m, cell_m=cell_m, model=model)
    assert front == pytest.approx(model.p_free, abs=1e-9)
    assert behind == pytest.approx(model.prior, abs=1e-9)
    assert fuse(0.0, behind, model.prior) == pytest.approx(0, abs=1e-6)
    assert fuse(0.0, front, model.prior) == pytest.approx(log_odds(model.p_free) - log_odds(model.prior), abs=1e-6)


@given(models, sigmas_m, cells_m)
def test_eq12_rises_to_one_peak_at_or_behind_the_surface_and_falls_from_there(model, sigma_m, cell_m):
    """Where the slopes of both ends of the cell balance: u = ln((A - F) / (A - 1)) / (2 h).

    It lies behind the surface because a cell in front loses to F, one behind only falls back to 1.
    """
    hit, passed = likelihood_ratios(model)
    peak = np.log((hit - passed) / (hit - 1)) / (cell_m / sigma_m)
    assert peak > 0
    u = np.unique(np.concatenate([np.linspace(-8, 8, 201), np.linspace(-1, 1, 21) + peak, [peak]]))
    p = occupancy_probability(60 + u * sigma_m, 60.0, sigma_m, cell_m=cell_m, model=model)
    assert (np.diff(p[u <= peak]) >= -1e-12).all()
    assert (np.diff(p[u >= peak]) <= 1e-12).all()


@given(depths_m, sigmas_px, st.floats(0, 0.5))
def test_eq13_linear_adds_eps_to_the_depth_error_as_the_paper_does(depth_m, sigma_px, eps_m):
    d = CAMERA.disparity_px(depth_m)
    wide = widened_sigma_px(CAMERA, d, sigma_px, motion_sigma_m=eps_m, motion_rule="linear")
    assert depth_sigma_m(CAMERA, depth_m, wide) == pytest.approx(depth_sigma_m(CAMERA, depth_m, sigma_px) + eps_m)


@given(depths_m, sigmas_px, st.floats(0, 0.5))
def test_eq13_rss_adds_the_variances_and_is_never_wider_than_linear(depth_m, sigma_px, eps_m):
    d = CAMERA.disparity_px(depth_m)
    wide = widened_sigma_px(CAMERA, d, sigma_px, motion_sigma_m=eps_m)
    stereo_m = depth_sigma_m(CAMERA, depth_m, sigma_px)
    total_m = depth_sigma_m(CAMERA, depth_m, wide)
    assert total_m == pytest.approx(np.sqrt(stereo_m**2 + eps_m**2))
    assert max(stereo_m, eps_m) * (1 - 1e-9) <= total_m <= (stereo_m + eps_m) * (1 + 1e-9)


@pytest.mark.parametrize("motion", ["rss", "linear"])
def test_eq13_without_motion_is_eq8(motion):
    np.testing.assert_array_equal(
        widened_sigma_px(CAMERA, [3.0, 30.0], [0.3, 0.4], motion_sigma_m=0.0, motion_rule=motion), [0.3, 0.4]
    )


def coverage(eps_claimed_m, motion, *, eps_true_m=0.05, sigma_px=0.3, n=40_000):
    """Share of simulated hits whose true depth lies within 1.96 dz of the measured one.

    A camera stands eps_true_m (one sigma) from where it is thought to be, along its axis, and reads the
    disparity of points 1.5 to 3 m away with an error of sigma_px.
    """
    rng = np.random.default_rng(11)
    z_m = rng.uniform(1.5, 3, n)
    d = CAMERA.disparity_px(z_m - rng.normal(0, eps_true_m, n)) + rng.normal(0, sigma_px, n)
    wide = widened_sigma_px(CAMERA, d, np.full(n, sigma_px), motion_sigma_m=eps_claimed_m, motion_rule=motion)
    measured_m = CAMERA.depth_m(d)
    return float(np.mean(np.abs(measured_m - z_m) <= 1.96 * depth_sigma_m(CAMERA, measured_m, wide)))


def test_eq13_covers_95_percent_of_hits_with_eps_and_far_fewer_without():
    assert coverage(0.05, "rss") == pytest.approx(0.95, abs=0.01)
    assert coverage(0.0, "rss") < 0.8


def test_eq13_without_motion_error_eps_of_zero_covers_95_percent():
    assert coverage(0.0, "rss", eps_true_m=0.0) == pytest.approx(0.95, abs=0.01)


def test_eq13_linear_is_a_bound_that_covers_more_than_it_claims():
    assert coverage(0.05, "linear") > 0.97


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"p_free": 0.6}, "p_free 0.6, prior 0.5, p_occupied 0.9"),
        ({"p_free": 0.0}, "expected 0 < p_free"),
        ({"p_occupied": 1.0}, "p_occupied < 1"),
        ({"prior": np.nan}, "prior nan"),
        ({"max_range_m": 0.0}, "max_range_m must be positive and finite, not 0.0"),
        ({"max_range_m": np.inf}, "max_range_m must be positive and finite, not inf"),
        ({"form": "literal"}, "no form of the sensor model named 'literal'; choose from: corrected, printed"),
    ],
)
def test_a_sensor_model_that_cannot_be_is_refused_with_the_choices(changes, reason):
    with pytest.raises(InvalidInputError, match=reason):
        SensorModel(**changes)


def test_the_kernels_get_the_numbers_of_the_model():
    model = SensorModel(p_free=0.2, prior=0.4, p_occupied=0.8, form="printed")
    assert kernel_parameters(model) == (0.2, 0.8, 0.4, True, REACH_SIGMAS, REACH_SIGMAS)
    assert kernel_parameters(SensorModel())[3:] == (False, REACH_SIGMAS, REACH_BEHIND_SIGMAS)
    assert (reach_behind(model), reach_behind(SensorModel())) == (REACH_SIGMAS, REACH_BEHIND_SIGMAS)
