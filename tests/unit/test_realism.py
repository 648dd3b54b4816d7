"""The numbers that tell a real image from a made one: each is known for images that are made for it."""

import cv2
import numpy as np
import pytest
from faults_scenes import FewObservations
from scipy import fft

pytest.importorskip("pybullet", reason="the experiment drives through simulated worlds")

from experiments.realism import RealismConfig
from experiments.realism_measures import MEASURES, image_statistics, measures, noise_gray, photo_difference_gray
from experiments.realism_report import Measured, distance, grouped, measures_table
from experiments.realism_scenes import Scene, seen_apart, spread
from sim.faults import PRESETS
from sim.faults.timing import Shutters
from stereogrid.errors import StereogridError
from stereogrid.recording import Ticks

SHAPE = (240, 320)


def textured(rng, power=1.0):
    """Noise (H, W) float32 whose amplitude falls as frequency^-power, mean 128 and deviation 40."""
    frequency = np.hypot(fft.fftfreq(SHAPE[0])[:, None], fft.rfftfreq(SHAPE[1])[None, :])
    frequency[0, 0] = np.inf
    image = fft.irfft2(fft.rfft2(rng.standard_normal(SHAPE)) * frequency**-power, s=SHAPE)
    return (128 + 40 * image / image.std()).astype(np.float32)


@pytest.mark.parametrize("power", [0.5, 1.0, 1.5])
def test_the_slope_is_that_of_the_power_spectrum(power):
    found = [image_statistics(textured(np.random.default_rng(k), power))["slope"] for k in range(3)]
    assert np.mean(found) == pytest.approx(2 * power, abs=0.12)


@pytest.mark.parametrize("sigma", [0.8, 2.0, 4.0])
def test_the_noise_is_found_under_a_ramp_and_edges(sigma):
    rng = np.random.default_rng(1)
    scene = np.linspace(60, 180, SHAPE[1], dtype=np.float32)[None] + np.zeros(SHAPE, np.float32)
    scene[:, 100:160] += 40
    # The quietest tenth of the blocks lies a little below the mean.
    assert noise_gray(scene + sigma * rng.standard_normal(SHAPE).astype(np.float32)) == pytest.approx(sigma, rel=0.2)


def test_an_image_without_texture_is_flat_and_one_with_it_is_not():
    flat, rough = np.full(SHAPE, 90, np.uint8), textured(np.random.default_rng(2), 0.5).clip(0, 255).astype(np.uint8)
    assert image_statistics(flat)["flat"] == 100
    assert image_statistics(rough)["flat"] == 0
    assert image_statistics(flat)["contrast_gray"] == pytest.approx(0, abs=1e-3)
    assert image_statistics(rough)["contrast_gray"] == pytest.approx(40, rel=0.1)


def test_both_eyes_see_one_shade_but_for_what_one_of_them_adds():
    left = cv2.GaussianBlur(textured(np.random.default_rng(3), 0.5), (0, 0), 1).clip(20, 220).astype(np.uint8)
    right = np.roll(left, -7, axis=1)
    found_px = np.full(SHAPE, 7.0, np.float32)
    found_px[:, :7] = np.nan
    assert photo_difference_gray(left, right, found_px) == 0
    assert photo_difference_gray(left, right + np.uint8(9), found_px) == 9
    assert np.isnan(photo_difference_gray(left, right, np.full_like(found_px, np.nan)))


def test_every_measure_is_taken_and_a_shifted_pair_is_matched_without_fault():
    left = cv2.GaussianBlur(textured(np.random.default_rng(4), 0.5), (0, 0), 0.8).clip(0, 255).astype(np.uint8)
    right = np.roll(left, -7, axis=1)
    truth_px = np.full(SHAPE, 7.0)
    visible = np.arange(SHAPE[1])[None] >= 7 + np.zeros(SHAPE)
    found = measures(left, right, num_disparities=32, truth_px=truth_px, visible=visible)
    assert list(found) == list(MEASURES)
    assert found["bm_density"] > 90
    assert found["bm_bad_1_0"] < 0.5 and found["sgbm_bad_2_0"] < 0.5
    assert np.isnan(measures(left, right, num_disparities=32)["bm_bad_1_0"])


def test_places_are_spread_evenly_over_a_path_that_was_looked_at_more_often_in_its_corner():
    x_m = np.concatenate([np.arange(0, 5, 1.0), np.linspace(4.1, 4.3, 20), np.arange(5, 11, 1.0)])
    chosen = spread(np.stack([x_m, 0 * x_m, 0 * x_m], axis=1), 6)
    np.testing.assert_allclose(x_m[chosen], [0, 2, 4, 6, 8, 10])


class Rooms(FewObservations):
    """Forty places, dark and bright in turn, of a recording whose world is known."""

    metadata = {"world": "corridor", "seed": "0"}  # noqa: RUF012

    def __init__(self):
        super().__init__(40, (60, 150))

    def ticks(self):
        return Ticks(np.arange(2.0), np.tile(np.eye(4), (2, 1, 1)), np.zeros((2, 2)))


def test_every_preset_sees_every_place_and_with_the_exposure_of_that_place(monkeypatch):
    monkeypatch.setattr(Shutters, "pictures", lambda _, seen: (seen.left, seen.right))
    for preset, faults in PRESETS.items():
        seen = list(seen_apart(Rooms(), preset, 1))
        assert [each.stamp_s for each in seen] == list(range(40))
        dark, bright = (np.mean([each.left.mean() for each in seen[k::2]]) for k in (0, 1))
        # Of the contrast of the places, a camera leaves the share that its exposure does not make up for.
        assert dark / bright == pytest.approx((60 / 150) ** ((1 - faults.auto_exposure) * 2 / faults.gamma), rel=0.1)


def scene(place, preset):
    blank = np.zeros((4, 4), np.uint8)
    return Scene(place, preset, blank, blank, 16)


def test_the_distance_is_in_deviations_of_the_real_places_and_of_a_place_its_mean_counts():
    def group(*values, preset=""):
        return [Measured(scene("a", preset), {"slope": value}) for value in values]

    real = [group(1.0), group(2.0, 4.0), group(5.0)]
    assert distance([group(7.0, preset="p"), group(7.0, preset="p")], real, "slope") == pytest.approx(2.0)
    assert np.isnan(distance([group(7.0)], real[:1], "slope"))


def test_real_images_come_first_and_what_has_no_truth_has_a_dash():
    values = dict.fromkeys(MEASURES, 1.0) | {"bm_bad_1_0": np.nan}
    groups = grouped([Measured(scene("corridor", "mild"), values), Measured(scene("aloe", ""), values)])
    table = measures_table(groups, ["bm_density", "bm_bad_1_0"])
    assert [row[:2] for row in table.rows] == [["aloe", "real"], ["corridor", "mild"]]
    assert table.rows[0][3:] == ["1.0", "-"]


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"worlds": ("corridr",)}, "corridr.*choose from: .*corridor"),
        ({"presets": ("foggy",)}, "foggy.*choose from: .*ideal"),
        ({"worlds": ()}, "corridor"),
        ({"places": 1}, "places"),
        ({"distance_m": -1.0}, "distance_m"),
    ],
)
def test_a_wrong_parameter_is_named(wrong, named):
    with pytest.raises(StereogridError, match=named):
        RealismConfig(**wrong)
