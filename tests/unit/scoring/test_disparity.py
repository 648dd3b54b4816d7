"""Scores of disparities: on arrays small enough to be counted by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from stereogrid.errors import InvalidInputError
from stereogrid.observation import Disparity
from stereogrid.scoring.disparity import disparity_scores, filled, occlusion_f1, sigma_coverage

NAN = np.nan
rows = nps.arrays(
    np.float32, st.tuples(st.integers(1, 4), st.integers(1, 8)), elements=st.sampled_from([NAN, 1.0, 2.0, 3.0, 7.0])
)


def values(scores):
    return {score.name: score.value for score in scores}


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ([NAN, 5, NAN, NAN, 3, NAN], [5, 5, 3, 3, 3, 3]),  # edges take the one neighbour they have
        ([2, NAN, 9], [2, 2, 9]),  # the smaller, whichever side it is on
        ([9, NAN, 2], [9, 2, 2]),
        ([4, 5, 6], [4, 5, 6]),
    ],
)
def test_a_hole_takes_the_smaller_of_its_neighbours_on_the_row(row, expected):
    np.testing.assert_array_equal(filled(np.array([row], np.float32)), [expected])


def test_a_row_without_a_match_takes_the_smallest_of_the_image_and_an_image_without_any_is_zero():
    image = np.array([[NAN, NAN], [6, 3]], np.float32)
    np.testing.assert_array_equal(filled(image), [[3, 3], [6, 3]])
    np.testing.assert_array_equal(filled(np.full((2, 3), NAN, np.float32)), np.zeros((2, 3)))


@given(rows)
def test_filling_leaves_matches_as_they_are_and_agrees_with_a_search_pixel_by_pixel(image):
    result = filled(image)
    known = image[~np.isnan(image)]
    for y, x in np.ndindex(image.shape):
        left = [v for v in image[y, : x + 1][::-1] if not np.isnan(v)][:1]
        right = [v for v in image[y, x:] if not np.isnan(v)][:1]
        default = known.min() if known.size else 0
        assert result[y, x] == (image[y, x] if not np.isnan(image[y, x]) else min([*left, *right], default=default))


def test_bad_pixels_are_those_off_by_more_than_so_much_and_exactly_so_much_is_not_bad():
    truth = np.full((1, 8), 10.0)
    found = np.array([[10, 10.5, 11, 12, 12.5, 6, NAN, NAN]], np.float32)
    scores = values(disparity_scores(found, truth, np.ones((1, 8), bool)))
    assert scores["density"] == pytest.approx(75)
    assert scores["bad_0_5"] == pytest.approx(100 * 4 / 6)
    assert scores["bad_1_0"] == pytest.approx(100 * 3 / 6)
    assert scores["bad_2_0"] == pytest.approx(100 * 2 / 6)
    assert scores["mae"] == pytest.approx((0 + 0.5 + 1 + 2 + 2.5 + 4) / 6)
    # Both holes are filled with 6, which is off by 4.
    assert scores["bad_2_0_filled"] == pytest.approx(100 * 4 / 8)
    assert scores["mae_filled"] == pytest.approx((10 + 2 * 4) / 8)


def test_only_judged_pixels_count_though_all_may_fill_a_hole():
    truth = np.array([[3.0, 8.0, 8.0, NAN]])
    found = np.array([[3.0, NAN, 2.0, 99.0]], np.float32)
    judged = np.array([[False, True, False, False]])
    scores = disparity_scores(found, truth, judged)
    assert values(scores)["density"] == 0
    assert np.isnan(values(scores)["mae"]) and np.isnan(values(scores)["bad_1_0"])
    assert values(scores)["mae_filled"] == 6  # filled with 2
    assert {score.name: score.n for score in scores if score.name.endswith("_filled")} == dict.fromkeys(
        ("bad_0_5_filled", "bad_1_0_filled", "bad_2_0_filled", "mae_filled"), 1
    )


def test_every_share_is_in_percent_and_every_length_in_pixels():
    ones = np.ones((2, 2))
    scores = disparity_scores(ones.astype(np.float32), ones, ones.astype(bool))
    assert {score.name: score.unit for score in scores} == {
        "density": "%",
        **{f"bad_{px}{end}": "%" for px in ("0_5", "1_0", "2_0") for end in ("", "_filled")},
        "mae": "px",
        "mae_filled": "px",
    }


def test_arrays_that_do_not_fit_and_judged_pixels_without_a_truth_are_refused():
    found, truth, judged = np.ones((2, 3), np.float32), np.ones((2, 3)), np.ones((2, 3), bool)
    with pytest.raises(InvalidInputError, match=r"differ in size.*\(2, 3\).*\(2, 2\)"):
        disparity_scores(found, truth[:, :2], judged)
    truth[0, 0] = NAN
    with pytest.raises(InvalidInputError, match="must have a true disparity"):
        disparity_scores(found, truth, judged)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ([1, 1, NAN, NAN], 1.0),
        ([NAN, NAN, 1, 1], 0.0),
        ([NAN, NAN, NAN, NAN], 2 * 2 / (4 + 2)),
        ([1, NAN, NAN, 1], 2 * 1 / (2 + 2)),
    ],
)
def test_occlusion_f1_of_known_answers(found, expected):
    occluded = np.array([[False, False, True, True]])
    score = occlusion_f1(np.array([found], np.float32), occluded, np.ones((1, 4), bool))
    assert (score.value, score.unit, score.n) == (pytest.approx(expected), "1", 4)


def test_occlusion_f1_ignores_what_is_not_judged_and_is_undefined_where_nothing_is_occluded_or_said_to_be():
    found = np.array([[NAN, 1, NAN]], np.float32)
    occluded, judged = np.array([[True, False, False]]), np.array([[True, True, False]])
    assert occlusion_f1(found, occluded, judged).value == 1
    assert np.isnan(occlusion_f1(found, occluded, np.array([[False, True, False]])).value)


def test_sigma_coverage_counts_the_errors_within_one_and_two_sigma():
    truth = np.full((1, 5), 10.0)
    found = Disparity(np.array([[10.4, 10.6, 9.1, 11.1, NAN]]), np.full((1, 5), 0.5))
    scores = sigma_coverage(found, truth, np.ones((1, 5), bool))
    assert values(scores) == {"within_1_sigma": 0.25, "within_2_sigma": 0.75}
    assert {score.n for score in scores} == {4}


def test_the_rounding_of_the_truth_is_not_held_against_sigma():
    truth, judged = np.array([[10.0]]), np.ones((1, 1), bool)
    found = Disparity(np.array([[10.4]]), 0.3)
    assert values(sigma_coverage(found, truth, judged))["within_1_sigma"] == 0
    # sqrt(.3^2 + 1 / 12) = .416
    assert values(sigma_coverage(found, truth, judged, step_px=1.0))["within_1_sigma"] == 1


def test_a_right_sigma_of_a_rounded_truth_covers_as_a_normal_law_does():
    rng = np.random.default_rng(0)
    true = rng.uniform(5, 50, (200, 200))
    sigma = rng.uniform(0.5, 2, true.shape)
    found = Disparity((true + sigma * rng.standard_normal(true.shape)).clip(0.1), sigma)
    shares = values(sigma_coverage(found, np.round(true), np.ones(true.shape, bool), step_px=1.0))
    assert shares["within_1_sigma"] == pytest.approx(0.683, abs=0.01)
    assert shares["within_2_sigma"] == pytest.approx(0.954, abs=0.01)
