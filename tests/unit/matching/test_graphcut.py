"""The graph-cut matcher as a whole, on synthetic scenes with known truth and on real pairs.

golden_graphcut.json holds what the real pairs gave, and the command that measures them again.
"""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn_pairs import SHAPE, SUPERSAMPLED, plane_pair, texture, two_layers

from experiments.pairs import open_pair
from stereogrid.errors import InvalidInputError
from stereogrid.matching.graphcut import GraphCutMatcher
from stereogrid.matching.graphcut.expansion import energy
from stereogrid.matching.graphcut.matcher import STEP_CUT
from stereogrid.scoring.disparity import disparity_scores, occlusion_f1

GOLDEN = Path(__file__).parent / "golden_graphcut.json"


def noise(seed, blur_px, shape=(120, 160)):
    rng = np.random.default_rng(seed)
    images = [rng.normal(size=shape).astype(np.float32) for _ in range(2)]
    if blur_px:
        images = [cv2.GaussianBlur(i, (0, 0), blur_px) for i in images]
    return [np.clip(np.rint(128 + 50 * i / i.std()), 0, 255).astype(np.uint8) for i in images]


class Recorded(GraphCutMatcher):
    """Keeps the energy before and after each round of moves."""

    def _cut(self, costs, weights, labels, meter, *, agreed=None):
        self.rounds = getattr(self, "rounds", [])
        before = energy(costs, weights, STEP_CUT, labels)
        super()._cut(costs, weights, labels, meter, agreed=agreed)
        self.rounds.append((before, energy(costs, weights, STEP_CUT, labels)))


def test_each_round_of_moves_lowers_the_energy():
    chosen = Recorded(num_disparities=20)
    chosen.match(*two_layers()[:2])
    assert len(chosen.rounds) == 3
    assert all(after < before for before, after in chosen.rounds)


def test_what_the_near_square_hides_is_missing_and_the_rest_is_right():
    left, right, truth, hidden = two_layers()
    found = GraphCutMatcher(num_disparities=20).match(left, right)
    assert occlusion_f1(found.disparity_px, hidden, np.ones(SHAPE, bool)).value > 0.85
    error = np.abs(found.disparity_px - truth)[found.valid & ~hidden]
    assert np.mean(error > 1) < 0.02
    assert np.median(error) < 0.1


@pytest.mark.parametrize("slope", [0.03, 0.08])
def test_a_slant_is_no_staircase(slope):
    """A quarter of a slanted surface lies in each quarter between two labels; pixel locking would move it to 0."""
    d = np.tile(6 + slope * np.arange(200), (60, 1))
    found = GraphCutMatcher(num_disparities=32).match(*plane_pair(d)).disparity_px[8:-8, 40:-12]
    # The right column x shows the left column x + d(x).
    true = (6 + slope * (np.arange(200) - 6) / (1 + slope))[40:-12]
    true = 6 + slope * (np.arange(200)[40:-12] - true)
    assert np.nanmean(np.abs(found - true)) < 0.1
    share = np.histogram(found[~np.isnan(found)] % 1, 4, (0, 1))[0] / np.count_nonzero(~np.isnan(found))
    assert (share > 0.13).all()


def test_a_wall_without_texture_takes_its_distance_from_its_edges():
    left, right = plane_pair(np.full(SHAPE, 7.0))
    left[25:37, 60:80], right[25:37, 53:73] = 128, 128
    found = GraphCutMatcher(num_disparities=24).match(left, right).disparity_px[27:35, 62:78]
    assert np.abs(found - 7).max() < 0.5


@pytest.mark.parametrize(("grey_left", "grey_right"), [(0, 0), (128, 128), (10, 200)])
def test_of_images_without_texture_nothing_is_known(grey_left, grey_right):
    images = (np.full(SHAPE, grey, np.uint8) for grey in (grey_left, grey_right))
    assert GraphCutMatcher(num_disparities=32).match(*images).density == 0


@pytest.mark.parametrize("count", [8, 32, 64])
@pytest.mark.parametrize("blur_px", [0, 1])
def test_noise_matches_in_few_places_whatever_its_grain(count, blur_px):
    assert GraphCutMatcher(num_disparities=count).match(*noise(5, blur_px)).density < 0.3


def test_half_of_an_image_that_does_not_match_leaves_the_other_as_it_is():
    left, right = plane_pair(np.full(SHAPE, 5.0))
    right[:, 90:] = noise(6, 0, SHAPE)[0][:, 90:]
    found = GraphCutMatcher(num_disparities=16).match(left, right).disparity_px
    assert np.isnan(found[:, 115:]).mean() > 0.7
    assert np.abs(found[8:-8, 13:75] - 5).max() < 0.5


@pytest.mark.parametrize("count", [1, 2, 7, 17, 33])
def test_any_number_of_labels_will_do(count):
    d = min(5, count - 1)
    found = GraphCutMatcher(num_disparities=count).match(*plane_pair(np.full(SHAPE, float(d)))).disparity_px
    middle = found[8:-8, count + 8 : -8]
    if d == 0:
        assert np.isnan(found).all()
    else:
        assert np.nanmax(np.abs(middle - d)) < 0.5
        assert np.isnan(middle).mean() < 0.05


def test_three_equal_channels_are_one():
    left, right = two_layers()[:2]
    chosen = GraphCutMatcher(num_disparities=20)
    colours = (cv2.cvtColor(i, cv2.COLOR_GRAY2BGR) for i in (left, right))
    np.testing.assert_array_equal(chosen.match(left, right).disparity_px, chosen.match(*colours).disparity_px)


def test_colour_tells_apart_what_grey_cannot():
    """Red and blue of the same grey: only in colour there is anything to match."""
    spots = texture(3)[:, ::SUPERSAMPLED] > 128
    colours = np.where(spots[..., None], (255, 20, 30), (30, 20, 115)).astype(np.uint8)
    assert np.ptp(cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY).astype(int)) <= 2
    left, right = (np.ascontiguousarray(colours[:, k : k + 140]) for k in (0, 6))
    chosen = GraphCutMatcher(num_disparities=16)
    found = chosen.match(left, right).disparity_px
    assert np.nanmean(np.abs(found - 6) < 0.5) > 0.5


def test_two_matches_at_once_give_the_same_bits_as_one_after_the_other():
    left, right = two_layers()[:2]
    chosen = GraphCutMatcher(num_disparities=20)
    alone = chosen.match(left, right).disparity_px
    with ThreadPoolExecutor(4) as threads:
        for found in threads.map(lambda _: chosen.match(left, right).disparity_px, range(8)):
            np.testing.assert_array_equal(found, alone)


@pytest.mark.parametrize(("gain", "offset"), [(0.75, 0), (1.0, 30), (0.8, 20)])
def test_two_exposures_of_a_scene_match_as_well_as_one(gain, offset):
    left, right, truth, hidden = two_layers()
    darker = np.clip(np.rint(gain * right + offset), 0, 255).astype(np.uint8)
    found = GraphCutMatcher(num_disparities=20).match(left, darker)
    assert occlusion_f1(found.disparity_px, hidden, np.ones(SHAPE, bool)).value > 0.85
    assert np.mean(np.abs(found.disparity_px - truth)[found.valid & ~hidden] > 1) < 0.02


def test_progress_rises_to_one():
    shares = []
    GraphCutMatcher(num_disparities=12, progress=shares.append).match(*two_layers()[:2])
    assert shares == sorted(shares)
    assert len(shares) == 3 * 12
    assert shares[-1] == 1


def test_without_time_no_label_is_moved_and_the_start_must_do():
    left, right, truth, hidden = two_layers()
    hurried = Recorded(num_disparities=20, time_budget_s=0)
    found = hurried.match(left, right)
    assert all(after == before for before, after in hurried.rounds)
    assert np.mean(np.abs(found.disparity_px - truth)[found.valid & ~hidden] > 1) < 0.05


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"num_disparities": 0}, "num_disparities must be at least 1, not 0"),
        ({"smoothness": -1}, "smoothness must be 0 to 100000, not -1"),
        ({"smoothness": 100_001}, "smoothness must be 0 to 100000, not 100001"),
        ({"time_budget_s": -0.5}, "time_budget_s must be at least 0 or None, not -0.5"),
        ({"time_budget_s": float("nan")}, "time_budget_s must be at least 0 or None, not nan"),
    ],
)
def test_options_that_cannot_be_are_refused_by_name(options, reason):
    with pytest.raises(InvalidInputError, match=f"^{reason}$"):
        GraphCutMatcher(**options)


def test_the_smallest_allowed_image_is_matched_and_one_column_or_row_less_is_refused():
    chosen = GraphCutMatcher(num_disparities=16)
    image = np.random.default_rng(0).integers(0, 256, (7, 26), dtype=np.uint8)
    assert chosen.match(image, image).disparity_px.shape == (7, 26)
    with pytest.raises(InvalidInputError, match=r"25x7 px is too small .* more than 25 columns and at least 7 rows"):
        chosen.match(image[:, 1:], image[:, 1:])
    with pytest.raises(InvalidInputError, match="26x6 px is too small"):
        chosen.match(image[1:], image[1:])


def test_the_strongest_smoothness_overflows_nothing():
    left, right = plane_pair(np.full(SHAPE, 5.0))
    found = GraphCutMatcher(num_disparities=16, smoothness=100_000).match(left, right).disparity_px
    assert np.abs(found[8:-8, 13:-8] - 5).max() < 0.5


def test_a_matcher_says_what_it_is():
    assert repr(GraphCutMatcher(num_disparities=32)) == "GraphCutMatcher(num_disparities=32, smoothness=150)"


PAIRS = ("tsukuba", "venus", "teddy", "motorcycle")


def measure(folder):
    """Bad-2 filled [%] over what both images show, MAE [px] of the matched, F1 of the hidden."""
    pair = open_pair(folder)
    found = GraphCutMatcher(num_disparities=pair.num_disparities).match(*pair.grey).disparity_px
    scores = {score.name: score.value for score in disparity_scores(found, pair.truth_px, pair.visible)}
    f1 = occlusion_f1(found, pair.hidden, pair.visible | pair.hidden).value
    return {
        "bad_2_0_filled": round(scores["bad_2_0_filled"], 2),
        "mae": round(scores["mae"], 3),
        "occlusion_f1": round(f1, 3),
    }


@pytest.mark.parametrize("pair", PAIRS)
def test_real_pairs_are_matched_as_well_as_they_were(real_data, pair):
    measured = measure(real_data(f"stereo/{pair}"))
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))["pairs"][pair]
    assert measured["bad_2_0_filled"] == pytest.approx(golden["bad_2_0_filled"], abs=0.1)
    assert measured["mae"] == pytest.approx(golden["mae"], abs=0.015)
    assert measured["occlusion_f1"] == pytest.approx(golden["occlusion_f1"], abs=0.01)
