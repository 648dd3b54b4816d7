"""The disparity's standard deviation is that of a least-squares shift between two noisy windows, and no smaller."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.matching.sigma import FLOOR_PX, GREY_NOISE, LARGEST_PX, disparity_sigma_px


@given(st.integers(1, 12), st.sampled_from([3, 5, 9, 15]))
def test_a_ramp_has_the_sigma_of_its_slope_and_window(slope, block_px):
    """Slope s over n x n pixels: sigma^2 = floor^2 + 2 / (n s)^2."""
    ramp = np.tile(np.arange(20) * slope, (20, 1)).astype(np.uint8)
    sigma = disparity_sigma_px(ramp, block_px)[10, 10]
    energy = (block_px * slope) ** 2
    assert sigma == pytest.approx(np.sqrt(FLOOR_PX**2 + 2 * GREY_NOISE**2 / energy), rel=1e-5)


@pytest.mark.parametrize("slope", [0.4, 1.0, 4.0])
def test_beside_the_floor_it_is_the_scatter_of_least_squares_shifts_with_that_grey_noise(slope):
    """Monte Carlo: shift one noisy 9 x 9 window onto the other, sum(gradient x difference) / sum(gradient^2)."""
    rng = np.random.default_rng(4)
    texture = cv2.GaussianBlur(rng.normal(size=(15, 15)), (0, 0), 2)
    texture *= slope / np.abs(np.gradient(texture, axis=1)).mean()
    gradient = cv2.Sobel(texture, cv2.CV_64F, 1, 0, ksize=3, scale=1 / 8)[3:-3, 3:-3]
    noise_left, noise_right = rng.normal(0, GREY_NOISE, (2, 20_000, 9, 9))
    shifts = ((noise_left - noise_right) * gradient).sum(axis=(1, 2)) / (gradient**2).sum()
    grey = np.clip(np.rint(128 + texture), 0, 255).astype(np.uint8)
    predicted = np.sqrt(disparity_sigma_px(grey, 9)[7, 7] ** 2 - FLOOR_PX**2)
    # Whole grey levels change the gradients of the faintest texture a little.
    assert predicted == pytest.approx(shifts.std(), rel=0.15 if slope < 1 else 0.05)


def test_more_contrast_is_never_less_certain():
    texture = cv2.GaussianBlur(np.random.default_rng(5).normal(size=(40, 60)), (0, 0), 1.5)
    texture /= np.abs(texture).max()
    sigmas = [disparity_sigma_px(np.rint(128 + c * texture).astype(np.uint8), 9).mean() for c in (2, 8, 30, 120)]
    assert (np.diff(sigmas) < 0).all()


@given(st.integers(0, 255), st.sampled_from([3, 9, 21]))
def test_an_even_image_says_it_knows_nothing(grey, block_px):
    sigma = disparity_sigma_px(np.full((12, 16), grey, np.uint8), block_px)
    np.testing.assert_array_equal(sigma, np.float32(LARGEST_PX))


def test_edges_along_the_rows_do_not_help_to_match_along_the_rows():
    stripes = np.repeat(np.array([0, 0, 0, 255, 255, 255] * 3, np.uint8)[:, None], 20, axis=1)
    np.testing.assert_array_equal(disparity_sigma_px(stripes, 9), np.float32(LARGEST_PX))
    assert disparity_sigma_px(np.ascontiguousarray(stripes.T), 9).max() < 0.31


def test_it_is_float32_of_the_image_size_between_floor_and_largest_and_spares_the_image():
    image = np.random.default_rng(6).integers(0, 256, (30, 41), dtype=np.uint8)
    before = image.copy()
    sigma = disparity_sigma_px(image, 5)
    assert (sigma.shape, sigma.dtype) == ((30, 41), np.float32)
    assert sigma.min() >= np.float32(FLOOR_PX)
    assert sigma.max() <= LARGEST_PX
    np.testing.assert_array_equal(image, before)
