"""Cues: planes are smooth whatever their slant, noise is rough, and the shift's sigma is as Monte Carlo has it."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.matching.sigma_cues import (
    AROUND_PX,
    CUES,
    OFFSETS,
    ROUGHEST_PX,
    ROUNDING,
    WINDOW_PX,
    cues,
    grey_difference,
    roughness,
)

SHAPE = (40, 60)


def rough(disparity_px):
    out = np.empty_like(disparity_px)
    roughness(disparity_px, OFFSETS, ROUGHEST_PX, out)
    return out


def with_holes(seed, share=0.3):
    rng = np.random.default_rng(seed)
    disparity_px = rng.normal(10, 0.6, SHAPE).astype(np.float32)
    disparity_px[rng.random(SHAPE) < share] = np.nan
    return disparity_px


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_a_plane_is_smooth_however_it_slants(along, down):
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    plane = (40 + along * column + down * row).astype(np.float32)
    smooth = rough(plane)
    # Corners have no pair of opposite neighbours.
    margin = int(np.abs(OFFSETS).max())
    assert smooth[margin:-margin, margin:-margin].max() < 1e-4
    assert smooth[0, 0] == ROUGHEST_PX


@pytest.mark.parametrize("seed", range(4))
def test_roughness_is_its_numpy_twin(seed):
    d = with_holes(seed)
    expected = np.full(SHAPE, ROUGHEST_PX)
    for row, column in np.ndindex(SHAPE):
        gaps = []
        for down, along in OFFSETS:
            ends = [(row - down, column - along), (row + down, column + along)]
            if all(0 <= r < SHAPE[0] and 0 <= c < SHAPE[1] for r, c in ends):
                gap = abs(0.5 * (d[ends[0]] + d[ends[1]]) - d[row, column])
                gaps += [] if np.isnan(gap) else [min(gap, ROUGHEST_PX)]
        if gaps:
            expected[row, column] = np.mean(gaps)
    np.testing.assert_allclose(rough(d), expected, atol=1e-5)


def test_roughness_grows_with_the_noise_of_the_disparity():
    noise = np.random.default_rng(0).normal(size=SHAPE)
    means = [rough((10 + s * noise).astype(np.float32)).mean() for s in (0.02, 0.1, 0.3)]
    # Half of two errors and a third one: mean |N(0, 1.5 s^2)|.
    np.testing.assert_allclose(means[0] - rough(np.full(SHAPE, 10, np.float32)).mean(), 0.02 * 0.977, rtol=0.15)
    assert (np.diff(means) > 0).all()


@given(st.floats(0, 12), st.integers(0, 3))
def test_the_difference_of_grey_is_that_to_the_interpolated_match(shift_px, seed):
    left, right = np.random.default_rng(seed).integers(0, 256, (2, *SHAPE), dtype=np.uint8)
    out = np.empty(SHAPE, np.float32)
    disparity_px = np.full(SHAPE, shift_px, np.float32)
    grey_difference(left, right, disparity_px, out)
    column = np.arange(SHAPE[1]) - disparity_px[0]
    inside = column >= 0
    for row in (0, 17):
        expected = left[row] - np.interp(column, np.arange(SHAPE[1]), right[row].astype(float))
        np.testing.assert_allclose(out[row, inside], expected[inside], atol=0.01)
    assert (out[:, ~inside] == 0).all()


def test_the_difference_of_grey_is_nothing_where_nothing_matched_or_the_match_is_outside():
    image = np.full(SHAPE, 100, np.uint8)
    disparity_px = np.full(SHAPE, np.nan, np.float32)
    disparity_px[3], disparity_px[4] = 70, -70
    out = np.empty(SHAPE, np.float32)
    grey_difference(image, image // 2, disparity_px, out)
    assert (out == 0).all()


@pytest.mark.parametrize("noise_grey", [1.0, 4.0])
def test_the_shifts_sigma_is_the_scatter_of_least_squares_shifts(noise_grey):
    """Monte Carlo: shift one noisy window onto the other, sum(gradient x difference) / sum(gradient^2)."""
    rng = np.random.default_rng(4)
    texture = 60 * cv2.GaussianBlur(rng.normal(size=(41, 61)), (0, 0), 2)
    texture = 100 + 25 * texture / texture.std()
    gradient = cv2.Sobel(texture, cv2.CV_64F, 1, 0, ksize=3, scale=1 / 8)[16:25, 26:35]
    noise = rng.normal(0, noise_grey, (2, 20_000, WINDOW_PX, WINDOW_PX))
    shifts = ((noise[0] - noise[1]) * gradient).sum(axis=(1, 2)) / (gradient**2).sum()
    predicted = []
    for _ in range(60):
        pair = [np.clip(np.rint(texture + rng.normal(0, noise_grey, texture.shape)), 0, 255) for _ in range(2)]
        # A disparity of almost nothing: the two images show the same place.
        found = cues(*(image.astype(np.uint8) for image in pair), np.full(texture.shape, 1e-6, np.float32))
        predicted.append(found[CUES.index("shift_px"), 20, 30])
    # The noise of the gradient itself makes the texture seem stronger than it is.
    assert np.median(predicted) == pytest.approx(shifts.std(), rel=0.15)


def test_a_perfect_match_is_left_with_the_noise_of_rounding():
    ramp = np.tile(np.arange(60, dtype=np.uint8) * 4, (40, 1))
    found = cues(ramp, ramp, np.full(SHAPE, 1e-6, np.float32))
    by_name = dict(zip(CUES, found[:, 20, 30], strict=True))
    assert by_name["gradient"] == pytest.approx(4)
    assert by_name["shift_px"] == pytest.approx(ROUNDING**0.5 / (4 * WINDOW_PX))


def test_what_is_around_counts_matches_only():
    disparity_px = np.full(SHAPE, 10, np.float32)
    disparity_px[:, 30:] = np.nan
    image = np.random.default_rng(0).integers(0, 256, SHAPE, dtype=np.uint8)
    found = dict(zip(CUES, cues(image, image, disparity_px), strict=True))
    # The last matched column has half a window and its own column.
    assert found["unmatched"][20, 29] == pytest.approx((AROUND_PX // 2) / AROUND_PX)
    assert found["unmatched"][20, 20] == pytest.approx(0, abs=1e-6)
    inside = slice(15, 25), slice(14, 22)
    assert found["around_px"][inside].max() < 1e-5
