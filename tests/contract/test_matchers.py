"""What every matcher obeys: MATCHERS is the list, and a new entry is tested by being in it."""

import cv2
import numpy as np
import pytest

from stereogrid.errors import InvalidInputError
from stereogrid.matching import MATCHERS, matcher
from stereogrid.matching.correlation import error_correlation_px
from stereogrid.observation import Disparity, Matcher

NUM_DISPARITIES = 32
SHAPE = (48, 120)
BORDER_PX = 8
"""A window may stick out of the image: this much along the edges need not be matched."""


def shifted_pair(disparity_px, shape=SHAPE, seed=0):
    """A textured plane that faces the cameras: right(x) = left(x + d), drawn 8 times finer than the pixels."""
    height, width = shape
    rng = np.random.default_rng(seed)
    fine = cv2.GaussianBlur(rng.normal(size=(height, (width + 64) * 8)).astype(np.float32), (0, 0), 10, sigmaY=1.2)
    grey = np.clip(np.rint(128 + 50 * fine / fine.std()), 0, 255).astype(np.uint8)
    columns = np.arange(width) * 8
    return np.ascontiguousarray(grey[:, columns]), np.ascontiguousarray(grey[:, columns + round(8 * disparity_px)])


SET_APART = {"onnx": "what it does is up to the network that a user brings; see tests/unit/matching/test_onnx.py"}


@pytest.fixture(params=sorted(set(MATCHERS) - set(SET_APART)))
def name(request):
    return request.param


@pytest.fixture
def chosen(name):
    return matcher(name, num_disparities=NUM_DISPARITIES)


def visible(disparity_px, shape=SHAPE):
    """The pixels of the left image that the right one shows, its edges apart."""
    seen = np.zeros(shape, bool)
    seen[BORDER_PX:-BORDER_PX, int(np.ceil(disparity_px)) + BORDER_PX : -BORDER_PX] = True
    return seen


def test_it_is_a_matcher(chosen):
    assert isinstance(chosen, Matcher)


@pytest.mark.parametrize("d", [1.0, 3.0, 5.25, 7.5, 12.5, 20.75, 31.0])
def test_a_known_shift_is_recovered_between_pixels_too(chosen, d):
    found = chosen.match(*shifted_pair(d)).disparity_px[visible(d)]
    error = (found - d)[~np.isnan(found)]
    assert error.size / found.size > 0.9
    # Pixel locking pulls by up to a quarter of a pixel; a wrong unit, sign or offset would be 0.5 and more.
    assert abs(np.median(error)) <= 0.25
    assert np.mean(np.abs(error) > 1) < 0.01


def test_disparity_grows_with_the_shift_in_steps_below_a_pixel(chosen):
    shifts = np.arange(10, 12.01, 0.25)
    found = [np.nanmean(chosen.match(*shifted_pair(d)).disparity_px[visible(d)]) for d in shifts]
    assert (np.diff(found) > 0).all()
    np.testing.assert_allclose(found, shifts, atol=0.25)


def test_what_comes_back_is_float32_of_the_image_size_positive_and_nan_where_nothing_matched(chosen):
    for shape in (SHAPE, (47, 121), (33, 97)):
        found = chosen.match(*shifted_pair(6.0, shape))
        assert isinstance(found, Disparity)
        for array in (found.disparity_px, found.sigma_px):
            assert (array.shape, array.dtype) == (shape, np.float32)
            assert (array[~np.isnan(array)] > 0).all()
            assert np.isfinite(array[~np.isnan(array)]).all()
        assert found.disparity_px[found.valid].max() <= NUM_DISPARITIES


def test_sigma_is_missing_exactly_where_disparity_is(chosen):
    rng = np.random.default_rng(1)
    left, right = shifted_pair(6.0)
    right[:, 60:] = rng.integers(0, 256, right[:, 60:].shape)
    found = chosen.match(left, right)
    assert 0 < found.density < 1
    np.testing.assert_array_equal(np.isnan(found.sigma_px), np.isnan(found.disparity_px))


def test_how_far_its_errors_go_together_is_told_with_every_pair_even_where_nothing_matches(chosen, name):
    covered = np.full(SHAPE, 90, np.uint8)
    for pair in (shifted_pair(6.0), (covered, covered)):
        assert chosen.match(*pair).correlation_px == error_correlation_px(name) < np.inf


def test_no_columns_are_lost_to_the_search_range(chosen):
    """Left of column num_disparities only short shifts fit into the image, but those are found."""
    found = chosen.match(*shifted_pair(2.0)).valid[BORDER_PX:-BORDER_PX]
    assert found[:, 2 + BORDER_PX : NUM_DISPARITIES].mean() > 0.9
    assert found[:, -NUM_DISPARITIES:-BORDER_PX].mean() > 0.9


@pytest.mark.parametrize("d", [2.0, 12.0, 31.0])
def test_no_match_lies_outside_the_right_image(chosen, d):
    found = chosen.match(*shifted_pair(d)).disparity_px
    column = np.broadcast_to(np.arange(SHAPE[1]), SHAPE)
    assert (found <= column)[~np.isnan(found)].all()


def test_what_the_right_image_does_not_show_is_not_trusted(chosen):
    """The first d columns of the left image are out of the right one's view."""
    found = chosen.match(*shifted_pair(20.0)).valid[:, :20]
    assert found.mean() < 0.1


def test_images_in_the_wrong_order_do_not_match(chosen):
    left, right = shifted_pair(12.0)
    swapped = chosen.match(right, left)
    right_way = chosen.match(left, right)
    assert np.count_nonzero(np.abs(swapped.disparity_px - 12) < 1) < 0.02 * swapped.disparity_px.size
    assert swapped.density < right_way.density


def test_the_same_pair_gives_the_same_bits_whatever_came_before(chosen, name):
    left, right = shifted_pair(9.25)
    first = chosen.match(left, right)
    kept = first.disparity_px.copy()
    chosen.match(*shifted_pair(3.0, (40, 100), seed=2))
    fresh = matcher(name, num_disparities=NUM_DISPARITIES)
    for again in (chosen.match(left, right), fresh.match(left, right)):
        np.testing.assert_array_equal(again.disparity_px, kept)
        np.testing.assert_array_equal(again.sigma_px, first.sigma_px)
    np.testing.assert_array_equal(first.disparity_px, kept)


def test_the_images_stay_as_they_were(chosen):
    left, right = shifted_pair(9.25)
    before = left.copy(), right.copy()
    left.flags.writeable = right.flags.writeable = False
    chosen.match(left, right)
    np.testing.assert_array_equal([left, right], before)


def test_a_window_of_larger_images_gives_what_its_copy_gives(chosen):
    left, right = (np.repeat(image, 2, axis=1)[:, ::2] for image in shifted_pair(9.25))
    assert not left.flags.c_contiguous
    np.testing.assert_array_equal(
        chosen.match(left, right).disparity_px, chosen.match(left.copy(), right.copy()).disparity_px
    )


@pytest.mark.parametrize(("grey_left", "grey_right"), [(0, 0), (128, 128), (255, 255), (0, 40), (255, 215)])
def test_images_without_texture_give_no_match_or_one_that_says_it_knows_nothing(chosen, grey_left, grey_right):
    found = chosen.match(np.full(SHAPE, grey_left, np.uint8), np.full(SHAPE, grey_right, np.uint8))
    assert (found.sigma_px[found.valid] >= 2).all()


@pytest.mark.parametrize("covered", ["left", "right"])
def test_with_one_lens_covered_nothing_is_known(chosen, covered):
    left, right = shifted_pair(6.0)
    (left if covered == "left" else right)[:] = 90
    assert not chosen.match(left, right).valid.any()


@pytest.mark.parametrize("count", ["x", None, [64]])
def test_a_search_range_that_is_no_number_is_refused_in_a_line(name, count):
    with pytest.raises(InvalidInputError, match=r"num_disparities|matcher"):
        matcher(name, num_disparities=count)


def test_unlike_images_match_in_few_places_only(chosen):
    rng = np.random.default_rng(3)
    left, right = rng.integers(0, 256, (2, *SHAPE), dtype=np.uint8)
    assert chosen.match(left, right).density < 0.3


GOOD = np.zeros(SHAPE, np.uint8)

BAD_PAIRS = {
    "of different width": (GOOD, GOOD[:, 1:], r"differ in size: \(48, 120\) and \(48, 119\)"),
    "of different height": (GOOD[1:], GOOD, r"differ in size: \(47, 120\) and \(48, 120\)"),
    "with a float left": (GOOD.astype(np.float32), GOOD, r"the left image must be \(H, W\) uint8, not .* float32"),
    "with a 16-bit right": (GOOD, GOOD.astype(np.uint16), r"the right image must be \(H, W\) uint8, not .* uint16"),
    "in colour": (np.zeros((48, 120, 3), np.uint8), GOOD, r"the left image must be \(H, W\) uint8, not \(48, 120, 3\)"),
    "that is a list": (GOOD.tolist(), GOOD, r"the left image must be \(H, W\) uint8, not list"),
    "that is missing": (GOOD, None, r"the right image must be \(H, W\) uint8, not NoneType"),
    "of one row": (GOOD[:1], GOOD[:1], r"an image of 120x1 px is too small"),
    "of no rows": (GOOD[:0], GOOD[:0], r"an image of 120x0 px is too small"),
    "as narrow as the search range": (
        GOOD[:, :32],
        GOOD[:, :32],
        r"an image of 32x48 px is too small for 32 disparities",
    ),
    "a little wider than the search range": (GOOD[:, :33], GOOD[:, :33], r"33x48 px is too small for 32 disparities"),
}


@pytest.mark.parametrize("kind", BAD_PAIRS)
def test_a_pair_that_cannot_be_matched_is_refused_naming_the_culprit(chosen, kind):
    left, right, reason = BAD_PAIRS[kind]
    with pytest.raises(InvalidInputError, match=reason):
        chosen.match(left, right)


@pytest.mark.parametrize("count", [0, -16])
def test_a_search_range_that_cannot_be_is_refused_by_name(name, count):
    with pytest.raises(InvalidInputError, match=f"num_disparities must be .*, not {count}"):
        matcher(name, num_disparities=count)


def test_an_unknown_option_is_refused_with_the_choices(name):
    with pytest.raises(InvalidInputError, match=f"matcher '{name}' has no option 'num_disparity'; .*num_disparities"):
        matcher(name, num_disparity=64)


def test_an_unknown_matcher_is_refused_with_the_choices():
    with pytest.raises(
        InvalidInputError,
        match=rf"no matcher named 'sgmb'; did you mean 'sgbm'\? choose from: {', '.join(sorted(MATCHERS))}",
    ):
        matcher("sgmb")
