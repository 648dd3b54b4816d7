"""Sigma: a product of one factor a cue, from the matcher's table, within limits and only where there is a match."""

import json
import re
from importlib import resources

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.matching import MATCHERS, matcher
from stereogrid.matching.sigma import (
    GENERIC,
    KNOTS,
    LARGEST_PX,
    SMALLEST_PX,
    SigmaTable,
    disparity_sigma_px,
    rows,
    sigma_tables,
)
from stereogrid.matching.sigma_cues import CUES, cues, look_up
from stereogrid.scoring.disparity import sigma_coverage

SHAPE = (60, 100)


def table(**parts):
    """A table of zeros but for these cues."""
    return SigmaTable({cue: tuple(parts.get(cue, (0.0,) * len(KNOTS[cue]))) for cue in CUES})


def scene(noise_grey=0.0, shape=SHAPE, shift_px=5, seed=0):
    """A textured pair shifted by whole pixels, and its disparity with a hole."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(rng.normal(size=(shape[0], shape[1] + 20)), (0, 0), 1.5)
    wide = 120 + 25 * texture / texture.std()
    noisy = [
        part + rng.normal(0, noise_grey, shape) for part in (wide[:, : shape[1]], wide[:, shift_px:][:, : shape[1]])
    ]
    left, right = (np.clip(np.rint(part), 0, 255).astype(np.uint8) for part in noisy)
    disparity_px = np.full(shape, shift_px, np.float32)
    disparity_px[:, :shift_px] = disparity_px[20:30, 40:55] = np.nan
    return left, right, disparity_px


def looked_up(values, chosen):
    """What the kernel gives for one pixel with these values of the cues."""
    out = np.zeros((1, 1), np.float32)
    limits = np.array([SMALLEST_PX, LARGEST_PX], np.float32)
    look_up(np.array(values, np.float32)[:, None, None], rows(KNOTS), rows(chosen.log_sigma), limits, out)
    return float(out[0, 0])


parts = st.tuples(*(st.floats(-1, 1) for _ in range(6)))
at_cues = st.tuples(*(st.floats(0, 2 * KNOTS[cue][-1], width=32) for cue in CUES))


@given(st.fixed_dictionaries(dict.fromkeys(CUES, parts)), at_cues)
def test_the_kernel_is_its_numpy_twin(log_sigma, values):
    """Straight lines between the knots, level outside, and in proportion to the shift beyond its last one."""
    total = sum(np.interp(value, KNOTS[cue], log_sigma[cue]) for cue, value in zip(CUES, values, strict=True))
    beyond = max(values[CUES.index("shift_px")] / KNOTS["shift_px"][-1], 1)
    expected = np.clip(np.exp(total) * beyond, SMALLEST_PX, LARGEST_PX)
    assert looked_up(values, SigmaTable(log_sigma)) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("name", [*sorted(MATCHERS), "a plug-in of somebody's"])
def test_sigma_is_missing_exactly_where_disparity_is_and_within_its_limits_elsewhere(name):
    left, right, disparity_px = scene(noise_grey=2)
    before = disparity_px.copy()
    sigma_px = disparity_sigma_px(left, right, disparity_px, matcher=name)
    assert (sigma_px.shape, sigma_px.dtype) == (SHAPE, np.float32)
    np.testing.assert_array_equal(np.isnan(sigma_px), np.isnan(disparity_px))
    found = sigma_px[~np.isnan(sigma_px)]
    assert found.min() >= np.float32(SMALLEST_PX)
    assert found.max() <= LARGEST_PX
    np.testing.assert_array_equal(disparity_px, before)


def test_a_disparity_without_any_match_has_no_sigma():
    left, right, _ = scene()
    sigma_px = disparity_sigma_px(left, right, np.full(SHAPE, np.nan, np.float32), matcher="bm")
    assert np.isnan(sigma_px).all()


@given(st.integers(1, 12), st.integers(1, 12))
def test_images_of_any_size_have_a_sigma(height, width):
    image = np.zeros((height, width), np.uint8)
    sigma_px = disparity_sigma_px(image, image, np.full((height, width), 0.5, np.float32), matcher="bm")
    np.testing.assert_array_equal(sigma_px, np.float32(LARGEST_PX))


@given(st.integers(0, 255), st.integers(0, 255), st.sampled_from(sorted(sigma_tables())))
def test_even_images_say_that_nothing_is_known(grey_left, grey_right, name):
    images = (np.full((12, 16), grey, np.uint8) for grey in (grey_left, grey_right))
    sigma_px = disparity_sigma_px(*images, np.full((12, 16), 3, np.float32), matcher=name)
    np.testing.assert_array_equal(sigma_px, np.float32(LARGEST_PX))


def test_edges_along_the_rows_do_not_help_to_match_along_the_rows():
    stripes = np.repeat(np.array([0, 0, 0, 255, 255, 255] * 3, np.uint8)[:, None], 20, axis=1)
    disparity_px = np.full(stripes.shape, 3, np.float32)
    np.testing.assert_array_equal(disparity_sigma_px(stripes, stripes, disparity_px, matcher="bm"), LARGEST_PX)


@pytest.mark.parametrize("name", ["bm", "sgbm", GENERIC])
def test_noisier_images_and_rougher_disparities_are_less_certain(name):
    medians = []
    for noise in (0, 3, 8):
        left, right, disparity_px = scene(noise_grey=noise)
        rough = disparity_px + np.random.default_rng(1).normal(0, 0.05 * noise, SHAPE).astype(np.float32)
        medians.append(np.nanmedian(disparity_sigma_px(left, right, rough, matcher=name)))
    assert (np.diff(medians) > 0).all()


@pytest.mark.parametrize("name", ["bm", "sgbm", GENERIC])
def test_a_patch_that_was_matched_wrongly_stands_out(name):
    left, right, disparity_px = scene(noise_grey=1)
    disparity_px[40:48, 60:72] = 13
    sigma_px = disparity_sigma_px(left, right, disparity_px, matcher=name)
    assert np.median(sigma_px[40:48, 60:72]) > 3 * np.median(sigma_px[10:20, 60:80])


def test_a_gain_or_an_offset_between_the_cameras_does_not_matter():
    left, right, disparity_px = scene(noise_grey=2)
    plain = disparity_sigma_px(left, right, disparity_px, matcher="bm")
    brighter = np.clip(right.astype(int) + 20, 0, 255).astype(np.uint8)
    np.testing.assert_allclose(disparity_sigma_px(left, brighter, disparity_px, matcher="bm"), plain, rtol=0.05)


def test_each_matcher_uses_the_table_of_its_own_name():
    left, right, _ = scene(noise_grey=2, shape=(60, 120))
    for name in sorted(set(MATCHERS) & set(sigma_tables())):
        found = matcher(name, num_disparities=16).match(left, right)
        own = sigma_tables()[name].sigma_px(left, right, found.disparity_px)
        np.testing.assert_array_equal(found.sigma_px, own)


def test_matchers_without_a_table_have_the_generic_one():
    left, right, disparity_px = scene(noise_grey=2)
    generic = sigma_tables()[GENERIC].sigma_px(left, right, disparity_px)
    np.testing.assert_array_equal(disparity_sigma_px(left, right, disparity_px, matcher="a plug-in"), generic)


def test_the_committed_tables_say_how_they_were_made():
    text = resources.files("stereogrid.matching").joinpath("sigma_tables.json").read_text(encoding="utf-8")
    held = json.loads(text)
    assert held["command"].startswith("python -m experiments sigma")
    assert {"bm", "sgbm", GENERIC} <= set(held["tables"])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"gradient": None}, "a sigma table needs the cues roughness_px, .*gradient"),
        ({"texture": (0.0,) * 6}, "a sigma table needs the cues"),
        ({"gradient": (0.0,) * 5}, "gradient: expected 6 finite numbers"),
        ({"gradient": (0.0,) * 5 + (np.nan,)}, "gradient: expected 6 finite numbers"),
    ],
)
def test_a_table_that_is_not_whole_is_refused_naming_the_cue(changed, message):
    held = {**table().log_sigma, **changed}
    with pytest.raises(InvalidInputError, match=message):
        SigmaTable({cue: parts for cue, parts in held.items() if parts is not None})


COVERED = {
    ("bm", "venus"): (0.686, 0.940),
    ("sgbm", "venus"): (0.672, 0.941),
    ("gc", "venus"): (0.681, 0.897),
    ("bm", "teddy"): (0.687, 0.915),
    ("sgbm", "teddy"): (0.680, 0.926),
    ("gc", "teddy"): (0.644, 0.904),
    ("bm", "motorcycle"): (0.665, 0.917),
    ("sgbm", "motorcycle"): (0.707, 0.921),
    ("gc", "motorcycle"): (0.674, 0.913),
}
"""Shares of the errors within one and two sigmas, measured by this very test with the tables that are committed.
.68 and .95 are aimed at; docs/results.md says how far scenes stray that the tables were not fitted to."""


@pytest.mark.parametrize(("kind", "name"), COVERED)
def test_as_many_errors_on_real_pairs_are_within_sigma_as_were(real_data, kind, name):
    from experiments.pairs import open_pair

    pair = open_pair(real_data(f"stereo/{name}"))
    found = matcher(kind, num_disparities=64).match(*pair.grey)
    shares = sigma_coverage(found, pair.truth_px, pair.visible, step_px=pair.step_px)
    # Other OpenCV versions round differently.
    assert [share.value for share in shares] == pytest.approx(COVERED[kind, name], abs=0.015)


def test_the_cue_that_look_up_lets_grow_without_end_is_the_shift():
    assert CUES[2] == "shift_px"


def test_the_docstring_of_the_cues_names_them_all():
    assert all(re.search(rf"\b{cue}\b", cues.__doc__) for cue in CUES)
