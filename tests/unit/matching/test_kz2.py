"""The matcher kz2 as a whole, on synthetic scenes with known truth, on real pairs, and on input that will not do.

golden_kz2.json holds what the real pairs gave, and the command that measures them again.
"""

import functools
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn_pairs import SHAPE, shifted_pair, two_layers

from experiments.pairs import open_pair
from stereogrid.errors import InvalidInputError
from stereogrid.matching import GraphCutMatcher, KolmogorovZabihMatcher, matcher
from stereogrid.matching.kz2.subpixel import between_labels
from stereogrid.scoring.disparity import disparity_scores, occlusion_f1

GOLDEN = Path(__file__).parent / "golden_kz2.json"


def noise(seed, shape=(80, 160)):
    return tuple(np.random.default_rng(seed).integers(0, 256, (2, *shape), dtype=np.uint8))


@pytest.mark.parametrize("colour", [False, True])
def test_what_the_near_square_hides_is_missing_and_the_rest_is_right(colour):
    left, right, truth, hidden = two_layers()
    images = [cv2.cvtColor(i, cv2.COLOR_GRAY2BGR) for i in (left, right)] if colour else (left, right)
    found = KolmogorovZabihMatcher(num_disparities=20).match(*images)
    assert occlusion_f1(found.disparity_px, hidden, np.ones(SHAPE, bool)).value > 0.85
    error = np.abs(found.disparity_px - truth)[found.valid & ~hidden]
    assert np.mean(error > 1) < 0.02
    assert np.median(error) < 0.1


@pytest.mark.parametrize("disparity_px", [5.0, 5.25, 5.5, 5.625, 5.875])
def test_a_fraction_of_a_pixel_is_found(disparity_px):
    found = KolmogorovZabihMatcher(num_disparities=12).match(*shifted_pair(disparity_px)).disparity_px
    inside = found[4:-4, 12:-4]
    assert np.mean(np.isnan(inside)) < 0.1
    assert abs(np.nanmedian(inside) - disparity_px) < 0.1
    assert np.nanmedian(np.abs(inside - disparity_px)) < 0.2


def test_without_subpixel_the_disparities_are_the_labels_and_with_it_at_most_half_a_label_away():
    images = two_layers()[:2]
    coarse, fine = (KolmogorovZabihMatcher(num_disparities=20, subpixel=on) for on in (False, True))
    label, _ = coarse.labels(*images)
    found = [each.match(*images).disparity_px for each in (coarse, fine)]
    known = ~np.isnan(found[0])
    np.testing.assert_array_equal(found[0][known], label[known])
    assert known.mean() > 0.8
    assert (found[0][known] > 0).all()
    for each in found:
        assert np.isnan(each[label < 0]).all()
        assert np.nanmax(np.abs(each - label)) <= 0.5


def test_between_labels_there_is_nothing_where_nothing_is_matched():
    left, right = shifted_pair(3.5)
    label = np.full(SHAPE, 3, np.int16)
    label[::7] = -1
    found = between_labels(label, left, right)
    np.testing.assert_array_equal(np.isnan(found), label < 0)
    assert np.abs(np.nanmedian(found[:, 10:]) - 3.5) < 0.15


@pytest.mark.parametrize(("grey_left", "grey_right"), [(0, 0), (128, 128), (10, 200)])
def test_of_images_without_texture_nothing_is_known(grey_left, grey_right):
    images = [np.full(SHAPE, grey, np.uint8) for grey in (grey_left, grey_right)]
    assert KolmogorovZabihMatcher(num_disparities=32).match(*images).density == 0


def test_noise_matches_in_few_places_though_the_least_energy_matches_most():
    chosen = KolmogorovZabihMatcher(num_disparities=32)
    assert np.mean(chosen.labels(*noise(5))[0] >= 0) > 0.5
    assert chosen.match(*noise(5)).density < 0.2


@pytest.mark.parametrize("count", [1, 2, 7, 33])
def test_any_number_of_labels_will_do(count):
    d = min(5, count - 1)
    found = KolmogorovZabihMatcher(num_disparities=count).match(*shifted_pair(float(d))).disparity_px
    middle = found[8:-8, count + 8 : -8]
    if count == 1:  # 0, infinitely far
        assert np.nan_to_num(found).max() <= 0.5
    else:
        assert np.nanmax(np.abs(middle - d)) < 0.6
        assert np.isnan(middle).mean() < 0.1


def test_without_time_the_start_must_do_and_with_it_the_energy_is_no_higher():
    left, right, truth, hidden = two_layers()
    hurried, patient = (KolmogorovZabihMatcher(num_disparities=20, time_budget_s=s) for s in (0, 60))
    endless = KolmogorovZabihMatcher(num_disparities=20)
    found = hurried.match(left, right)
    assert np.mean(np.abs(found.disparity_px - truth)[found.valid & ~hidden] > 1) < 0.05
    assert endless.labels(left, right)[1] == patient.labels(left, right)[1] < hurried.labels(left, right)[1] < 0


def test_progress_rises_to_one():
    shares = []
    KolmogorovZabihMatcher(num_disparities=12, progress=shares.append).match(*two_layers()[:2])
    assert shares == sorted(shares)
    assert shares[-1] == 1


@pytest.mark.parametrize("made", [KolmogorovZabihMatcher, GraphCutMatcher])
@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"num_disparities": 0}, "num_disparities must be at least 1, not 0"),
        ({"num_disparities": -1}, "num_disparities must be at least 1, not -1"),
        ({"num_disparities": 1.5}, r"num_disparities must be an integer, not 1\.5"),
        ({"num_disparities": 16.0}, r"num_disparities must be an integer, not 16\.0"),
        ({"num_disparities": "x"}, "num_disparities must be an integer, not 'x'"),
        ({"num_disparities": True}, "num_disparities must be an integer, not True"),
        ({"num_disparities": None}, "num_disparities must be an integer, not None"),
        ({"time_budget_s": -0.5}, r"time_budget_s must be at least 0 or None, not -0\.5"),
        ({"time_budget_s": float("nan")}, "time_budget_s must be at least 0 or None, not nan"),
    ],
)
def test_options_that_cannot_be_are_refused_by_name(made, options, reason):
    with pytest.raises(InvalidInputError, match=f"^{reason}$"):
        made(**options)


GREY = np.zeros((20, 60), np.uint8)
COLOUR = np.zeros((20, 60, 3), np.uint8)


@pytest.mark.parametrize(
    ("left", "right", "reason"),
    [
        (COLOUR, GREY, "left image must be"),
        (GREY, COLOUR, "right image must be"),
        (GREY.astype(np.float32), GREY.astype(np.float32), "uint8, not .* float32"),
        (COLOUR.astype(float), COLOUR.astype(float), "uint8, not .* float64"),
        (GREY, GREY[:, 1:], "differ in size"),
        (GREY[..., None], GREY[..., None], "left image must be"),
        (np.zeros((20, 60, 4), np.uint8), COLOUR, "left image must be"),
        (GREY.tolist(), GREY, "left image must be"),
        (GREY[:1], GREY[:1], "60x1 px is too small"),
        (GREY[:6], GREY[:6], "60x6 px is too small"),
        (GREY[:, :25], GREY[:, :25], "25x20 px is too small .* more than 25 columns and at least 7 rows"),
        (COLOUR[:0], COLOUR[:0], "60x0 px is too small"),
    ],
)
def test_images_that_will_not_do_are_refused_by_name(left, right, reason):
    for call in (KolmogorovZabihMatcher(num_disparities=16).match, KolmogorovZabihMatcher(num_disparities=16).labels):
        with pytest.raises(InvalidInputError, match=reason):
            call(left, right)


def test_the_smallest_allowed_images_are_matched_whatever_they_show():
    for seed in range(12):
        left, right = noise(seed, (7, 26))
        left[seed % 4 :], right[seed % 4 :] = 100, 100
        found = matcher("kz2", num_disparities=np.int64(16)).match(left, right)
        assert found.disparity_px.shape == (7, 26)


def test_a_matcher_says_what_it_is():
    assert repr(KolmogorovZabihMatcher(num_disparities=32)) == "KolmogorovZabihMatcher(num_disparities=32)"


BEST_OF_REFERENCE = {"tsukuba": -12_801_427, "venus": -22_783_788, "teddy": -146_630_201}


class Recorded(KolmogorovZabihMatcher):
    """Keeps the energy of what it found."""

    def labels(self, left, right):
        label, self.energy = super().labels(left, right)
        return label, self.energy


@functools.cache
def measure(folder):
    """The energy; bad-1 and bad-2 filled [%] over what both images show."""
    pair = open_pair(folder)
    chosen = Recorded(num_disparities=pair.num_disparities)
    found = chosen.match(pair.left, pair.right).disparity_px
    scores = {score.name: score.value for score in disparity_scores(found, pair.truth_px, pair.visible)}
    return {"energy": chosen.energy, **{name: round(scores[name], 2) for name in ("bad_1_0_filled", "bad_2_0_filled")}}


@pytest.mark.parametrize("pair", BEST_OF_REFERENCE)
def test_the_energy_is_no_higher_than_the_best_that_the_published_program_finds(real_data, pair):
    assert measure(real_data(f"stereo/{pair}"))["energy"] <= BEST_OF_REFERENCE[pair]


@pytest.mark.parametrize("pair", BEST_OF_REFERENCE)
def test_real_pairs_are_matched_as_well_as_they_were(real_data, pair):
    measured = measure(real_data(f"stereo/{pair}"))
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))["pairs"][pair]
    for name in ("bad_1_0_filled", "bad_2_0_filled"):
        assert measured[name] == pytest.approx(golden[name], abs=0.1)
