"""A virtual rig: what its right camera would see, and how sure its disparities are."""

import numpy as np
import pytest

from stereogrid.camera import StereoCamera
from stereogrid.matching import matcher
from stereogrid.recording.virtual_rig import measured_disparity, right_view, sensor_sigma_px, with_noise

RIG = StereoCamera(585, 320, 240, 0.06, 640, 480)


def textured(shape: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)


def test_an_even_wall_is_moved_by_its_disparity() -> None:
    left = textured((4, 40))
    for disparity_px in (0.0001, 3.0):
        right = right_view(left, np.full(left.shape, disparity_px, np.float32))
        np.testing.assert_allclose(right[:, :37], left[:, round(disparity_px) :][:, :37], atol=1)
    # Between two pixels their mean is seen.
    right = right_view(left, np.full(left.shape, 2.5, np.float32))
    np.testing.assert_allclose(right[:, :37], (left[:, 2:39].astype(float) + left[:, 3:]) / 2, atol=0.51)


def test_what_is_nearer_hides_what_is_farther() -> None:
    left = textured((3, 60))
    disparity_px = np.full(left.shape, 2.0, np.float32)
    disparity_px[:, 20:30] = 8.0
    right = right_view(left, disparity_px)
    np.testing.assert_array_equal(right[:, 12:22], left[:, 20:30])
    np.testing.assert_array_equal(right[:, :12], left[:, 2:14])
    np.testing.assert_array_equal(right[:, 28:58], left[:, 30:])
    # Behind the box, where the left camera does not see: the background beside it, mirrored.
    np.testing.assert_array_equal(right[:, 22:28], right[:, 28:34][:, ::-1])


def test_an_unknown_disparity_is_that_of_the_farther_neighbour() -> None:
    left = textured((1, 40))
    known = np.full(left.shape, 2.0, np.float32)
    known[:, :10] = 6.0
    unknown = known.copy()
    unknown[:, 10:15] = np.nan
    np.testing.assert_array_equal(right_view(left, unknown), right_view(left, known))


def test_where_nothing_is_known_the_right_picture_is_the_left_one() -> None:
    left = textured((3, 20))
    np.testing.assert_array_equal(right_view(left, np.full(left.shape, np.nan, np.float32)), left)


def plainly(left: np.ndarray, disparity_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is drawn to the right picture and where, pixel by pixel: the nearest surface between two neighbours."""
    seen, nearest = np.full(left.shape, np.nan), np.zeros(left.shape)
    height, width = left.shape
    for row in range(height):
        for at in range(width):
            for x in range(width - 1):
                d, e = float(disparity_px[row, x]), float(disparity_px[row, x + 1])
                start, end = x - d, x + 1 - e
                if abs(e - d) > 1 or not start <= at <= end:
                    continue
                share = (at - start) / (end - start) if end > start else 0.0
                if d + share * (e - d) > nearest[row, at] + 1e-5:
                    nearest[row, at] = d + share * (e - d)
                    seen[row, at] = (1 - share) * left[row, x] + share * left[row, x + 1]
    return seen, nearest


def test_the_kernel_agrees_with_a_plain_rendering() -> None:
    rng = np.random.default_rng(3)
    left = textured((6, 48))
    disparity_px = 4 + np.cumsum(rng.normal(0, 0.6, left.shape), axis=1).clip(-3.5, 9)
    seen, nearest = plainly(left, disparity_px.astype(np.float32))
    right = right_view(left, disparity_px.astype(np.float32))
    drawn = nearest > 0
    assert 0.6 < drawn.mean() < 1
    np.testing.assert_allclose(right[drawn], seen[drawn], atol=1)


def test_a_matcher_finds_in_the_synthetic_pair_what_was_measured() -> None:
    rng = np.random.default_rng(1)
    left = np.kron(rng.integers(0, 256, (60, 80), dtype=np.uint8), np.ones((2, 2), np.uint8))
    disparity_px = np.full(left.shape, 6.0, np.float32)
    disparity_px[40:80, 60:110] = 11.3
    found = matcher("sgbm", num_disparities=32).match(left, right_view(left, disparity_px))
    error_px = abs(found.disparity_px - disparity_px)
    assert found.density > 0.85 and np.nanmedian(error_px) < 0.1
    assert np.nanmean(error_px > 1) < 0.05


def test_the_sensors_noise_is_the_same_disparity_at_every_depth() -> None:
    assert sensor_sigma_px(RIG) == pytest.approx(0.05)
    for depth_m in (1.0, 3.0):
        sigma_m = 1.4245e-3 * depth_m**2
        assert RIG.disparity_px(depth_m) - RIG.disparity_px(depth_m + sigma_m) == pytest.approx(0.05, rel=0.01)
    measured = measured_disparity(RIG, np.full(RIG.shape, 2.0))
    assert measured.sigma_px == pytest.approx(0.05) and measured.correlation_px == pytest.approx(9)


def test_added_noise_is_independent_drawn_anew_from_its_seed_and_counted_in_sigma() -> None:
    depth_m = np.full(RIG.shape, 2.0)
    exact, noisy, again, other = (
        measured_disparity(RIG, depth_m, noise, np.random.default_rng(seed)).disparity_px
        for noise, seed in ((0.0, 1), (0.25, 1), (0.25, 1), (0.25, 2))
    )
    assert (noisy - exact).std() == pytest.approx(0.25, rel=0.01)
    np.testing.assert_array_equal(noisy, again)
    assert abs(np.corrcoef((noisy - exact).ravel(), (other - exact).ravel())[0, 1]) < 0.01
    said = measured_disparity(RIG, depth_m, 0.25, np.random.default_rng(1))
    assert said.sigma_px == pytest.approx(np.hypot(0.05, 0.25)) and 1 < said.correlation_px < 3


def test_what_noise_makes_negative_is_unknown() -> None:
    noisy_px = with_noise(np.full((50, 50), 0.1), 0.25, np.random.default_rng(0))
    assert 0.2 < np.isnan(noisy_px).mean() < 0.5 and (noisy_px[~np.isnan(noisy_px)] > 0).all()
