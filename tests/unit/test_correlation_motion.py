"""Errors of surface points are found again after a motion, and what changes at rest is told from what stays."""

import numpy as np
import pytest

from experiments import correlation_motion
from experiments.correlation_motion import (
    DECORRELATED,
    Bin,
    Decorrelation,
    Followed,
    binned,
    decorrelation,
    follow,
    temporal_share,
)
from experiments.correlation_scenes import ShortDrive, View
from stereogrid.camera import StereoCamera

CAMERA = StereoCamera(300, 159.5, 119.5, 0.1, 320, 240)
NOTHING = np.zeros(CAMERA.shape, np.uint8)
DEPTH_M = 3.0


def moved_to(x_m=0.0, z_m=0.0):
    T = np.eye(4)
    T[0, 3], T[2, 3] = x_m, z_m
    return T


def wall(T_world_cam):
    """A wall 3 m from the origin, seen from a place."""
    depth_m = np.full(CAMERA.shape, DEPTH_M - T_world_cam[2, 3])
    return View(NOTHING, NOTHING, depth_m, T_world_cam)


def test_a_point_is_found_again_by_its_true_place():
    """10 cm to the right is 10 px at 3 m and 300 px of focal length."""
    views = wall(moved_to()), wall(moved_to(x_m=0.1))
    first = np.random.default_rng(0).normal(size=CAMERA.shape)
    found = follow(CAMERA, views, (first, np.roll(first, -10, axis=1)))
    assert found.rho() == pytest.approx(1)
    np.testing.assert_allclose(found.motion_px, 10)
    np.testing.assert_allclose(found.moved_m, 0.1)
    assert found.depth_m.size == pytest.approx(310 * 240 / 9, rel=0.03)
    unmoved = follow(CAMERA, views, (first, first))
    assert abs(unmoved.rho()) < 0.05


def test_points_that_something_hides_or_that_are_unmatched_are_not_followed():
    first, second = wall(moved_to()), wall(moved_to(z_m=0.1))
    second.depth_m[:, 160:] = 1.0
    errors = np.ones(CAMERA.shape), np.ones(CAMERA.shape)
    errors[1][:120] = np.nan
    found = follow(CAMERA, (first, second), errors)
    assert found.depth_m.size == pytest.approx(CAMERA.shape[0] * CAMERA.shape[1] / 9 / 4, rel=0.05)


def test_the_temporal_share_is_that_of_the_noise_in_the_whole_error():
    rng = np.random.default_rng(1)
    frames, sigma = 12, 0.5
    for share in (0.0, 0.3, 1.0):
        lasting = rng.normal(size=(100, 120)) * sigma * np.sqrt(1 - share)
        changing = rng.normal(size=(frames, 100, 120)) * sigma * np.sqrt(share)
        d = 20 + lasting + changing
        d[3, :20] = np.nan
        d[5, 50:55] += 15  # a jump to another surface
        assert temporal_share(d, np.full(d.shape, sigma)) == pytest.approx(share, abs=0.03)


def test_bins_hold_the_points_of_their_motion_and_tell_near_from_far():
    rng = np.random.default_rng(2)
    n = 40_000
    motion_px, depth_m = rng.uniform(0, 8, n), rng.choice([1.0, 5.0], n)
    rho = np.where(motion_px < 4, 0.8, 0.1)
    first = rng.normal(size=n)
    second = rho * first + np.sqrt(1 - rho**2) * rng.normal(size=n)
    bins = binned(Followed(np.stack([first, second]), motion_px, motion_px, depth_m), motion_px, (1.0, 4.0, 8.0, 9.0))
    assert [(each.least, each.most) for each in bins] == [(1.0, 4.0), (4.0, 8.0)]
    for each, expected in zip(bins, (0.8, 0.1), strict=True):
        assert [each.rho, each.near, each.far] == pytest.approx([expected] * 3, abs=0.03)


def bins(*rho):
    return [Bin(2.0**n, 2.0 ** (n + 1), each, each + 0.1, each - 0.1, 5000) for n, each in enumerate(rho)]


def test_errors_are_decorrelated_at_the_first_motion_that_brings_them_below_the_threshold():
    assert Decorrelation(0.5, bins(0.5, 0.4, 0.2, 0.35), [], 0.1).decorrelation_px == pytest.approx(np.sqrt(4 * 8))
    assert Decorrelation(0.5, bins(0.5, 0.4), [], 0.4).decorrelation_px == np.inf
    assert Decorrelation(DECORRELATED - 0.01, bins(0.5), [], 0.1).decorrelation_px == 0
    assert Decorrelation(0.5, bins(0.5, 0.4), [], 0.1).collapse()["px"] == pytest.approx(0.2)
    assert np.isnan(Decorrelation(0.5, bins(0.5), [], 0.1).collapse()["m"])


def test_an_error_that_belongs_to_the_surface_stays_and_one_that_belongs_to_the_image_goes(monkeypatch):
    """Half of the variance goes with the wall, half is new in every view: rho is .5 at rest and after any motion."""
    places_px = np.arange(0, 60, 3)
    surface = np.random.default_rng(3).normal(size=(240, 500))
    shifts = {}

    def view(shift_px, seed):
        each = wall(moved_to(x_m=shift_px / 100))
        shifts[id(each)] = (shift_px, seed)
        return each

    def errors(name, camera, each):
        shift_px, seed = shifts[id(each)]
        fresh = np.random.default_rng([4, seed]).normal(size=CAMERA.shape)
        return (surface[:, shift_px : shift_px + 320] + fresh) / np.sqrt(2)

    monkeypatch.setattr(correlation_motion, "view_errors", errors)
    views = [view(shift, n) for n, shift in enumerate(places_px)]
    counted = []
    drive = ShortDrive(CAMERA, views, {0: view(0, 100), 5: view(places_px[5], 105)})
    found = decorrelation("any", [drive], lambda: counted.append(1))
    assert len(counted) == len(views)
    assert found.at_rest == pytest.approx(0.5, abs=0.02)
    assert [each.least for each in found.by_px] == [2.0, 4.0, 8.0, 16.0]
    assert [each.rho for each in found.by_px] == pytest.approx([0.5] * 4, abs=0.02)
    assert found.lasting_share == pytest.approx(0.5, abs=0.02)
    assert found.decorrelation_px == np.inf
