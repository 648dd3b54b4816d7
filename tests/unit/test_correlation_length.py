"""The correlation length of fields whose length is known, with pixels missing."""

import cv2
import numpy as np
import pytest

from experiments.correlation_length import FEWEST_PIXELS, Autocorrelation, autocorrelation, pooled
from stereogrid.errors import InvalidInputError

SHAPE = (480, 640)
NAN = float("nan")


def white(seed=0, shape=SHAPE):
    return np.random.default_rng(seed).normal(size=shape)


def box(width_px):
    return lambda field: cv2.blur(field, (width_px, width_px))


def gauss(std_px):
    return lambda field: cv2.GaussianBlur(field, (0, 0), std_px)


def unit(field):
    return (field - field.mean()) / field.std()


def holes(field, share, blob_px=6, seed=1):
    """The field without a share of its pixels, in blobs."""
    drawn = cv2.GaussianBlur(white(seed, field.shape), (0, 0), blob_px)
    return np.where(drawn > np.quantile(drawn, 1 - share), NAN, field)


FIELDS = {
    "white": (lambda field: field, 1.0),
    "box of 3": (box(3), 3.0),
    "box of 9": (box(9), 9.0),
    "box of 15": (box(15), 15.0),
    "gauss of 1.5": (gauss(1.5), 2 * 1.5 * np.sqrt(np.pi)),
    "gauss of 4": (gauss(4), 2 * 4 * np.sqrt(np.pi)),
}


@pytest.mark.parametrize("share_missing", [0.0, 0.2, 0.6])
@pytest.mark.parametrize("kind", FIELDS)
def test_the_length_of_a_known_field_is_found_whatever_pixels_are_missing(kind, share_missing):
    make, length_px = FIELDS[kind]
    lengths = [
        autocorrelation(holes(unit(make(white(seed))), share_missing, seed=seed + 10)).length_px for seed in range(4)
    ]
    # 5 % of L^2 lie beyond the distance at which the sum ends; the rest is chance.
    assert np.mean(lengths) == pytest.approx(length_px, rel=0.07)


@pytest.mark.parametrize("kind", ["white", "box of 3", "gauss of 1.5"])
def test_the_mean_over_a_large_window_has_the_variance_of_as_many_independent_looks(kind):
    make, length_px = FIELDS[kind]
    side = 60
    field = unit(make(white(shape=(1800, 1800))))
    means = field.reshape(30, side, 30, side).mean(axis=(1, 3))
    assert means.var() == pytest.approx(length_px**2 / side**2, rel=0.15)


@pytest.mark.parametrize("side", [4, 8, 16])
def test_looks_are_those_of_the_means_over_windows_of_that_size(side):
    field = unit(gauss(2)(white(shape=(1600, 1600))))
    means = field.reshape(1600 // side, side, 1600 // side, side).mean(axis=(1, 3))
    assert autocorrelation(field).looks(side) == pytest.approx(1 / means.var(), rel=0.05)


def test_looks_need_a_window_within_the_lags():
    found = autocorrelation(white())
    assert found.looks(1) == pytest.approx(1)
    for side in (0, 33):
        with pytest.raises(InvalidInputError, match=f"a window must have 1 to 32 px, not {side}"):
            found.looks(side)


def test_the_autocorrelation_is_the_mean_product_of_the_pairs_that_exist():
    field = holes(white(shape=(110, 120)), 0.2, blob_px=2)
    found = autocorrelation(field, 4)
    e = np.clip(field, -3, 3)
    e = (e - np.nanmean(e)) / np.nanstd(e)
    padded = np.pad(e, 4, constant_values=NAN)
    slow = [[np.nanmean(e * padded[4 + r : 114 + r, 4 + c : 124 + c]) for c in range(-4, 5)] for r in range(-4, 5)]
    np.testing.assert_allclose(found.rho, slow, atol=1e-9)


def test_a_constant_error_is_a_bias_and_no_correlation():
    field = gauss(1.5)(white())
    field = unit(field) * 0.5
    plain, shifted = autocorrelation(field), autocorrelation(field + 1)
    assert shifted.length_px == pytest.approx(plain.length_px, rel=0.02)
    assert (plain.bias, shifted.bias) == (pytest.approx(0, abs=0.01), pytest.approx(1, abs=0.01))


def test_a_few_gross_errors_do_not_hide_how_far_the_others_reach():
    field = unit(gauss(3)(white()))
    spoilt = np.where(white(5) > 3, 1000.0, field)
    assert autocorrelation(spoilt).length_px == pytest.approx(autocorrelation(field).length_px, rel=0.1)


def test_an_error_that_never_ends_is_summed_to_the_largest_lag():
    slope = np.broadcast_to(np.linspace(-1, 1, 640), SHAPE)
    found = autocorrelation(slope)
    assert found.reach_px == 33
    assert 50 < found.length_px < np.sqrt(np.pi) * 33


def test_too_few_pixels_and_errors_that_are_all_the_same_are_refused():
    with pytest.raises(InvalidInputError, match="the errors of 100 pixels say nothing"):
        autocorrelation(white(shape=(10, 10)))
    with pytest.raises(InvalidInputError, match="all errors are the same"):
        autocorrelation(np.ones((100, FEWEST_PIXELS // 100)))


def test_pooled_scenes_weigh_the_same():
    a, b = (Autocorrelation(np.full((3, 3), rho), bias, 1.0, n) for rho, bias, n in ((0.2, 0.0, 10), (0.4, 1.0, 30)))
    both = pooled([a, b])
    assert (both.bias, both.n) == (0.5, 40)
    np.testing.assert_allclose(both.rho, 0.3)
