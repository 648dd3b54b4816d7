"""A user's network, run by onnxruntime: a block matcher written as a graph matches like one, however it is dressed."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from stereogrid.errors import ConfigError, InvalidInputError, MissingExtraError, StereogridError
from stereogrid.matching import matcher
from stereogrid.matching.correlation import error_correlation_px
from stereogrid.matching.onnx import agree
from stereogrid.matching.sigma import GENERIC
from stereogrid.observation import Matcher

SHAPE, SHIFT_PX = (50, 90), 9
TWO = '[{name = "left", image = "left"}, {name = "right", image = "right"}]'


@pytest.fixture
def tiny():
    """write_network, where onnx and onnxruntime are installed."""
    pytest.importorskip("onnxruntime")
    pytest.importorskip("onnx")
    from tiny_networks import write_network

    return write_network


def shifted_pair(shift_px=SHIFT_PX, shape=SHAPE):
    rng = np.random.default_rng(0)
    grey = cv2.GaussianBlur(rng.normal(size=(shape[0], shape[1] + 40)), (0, 0), 1.2)
    wide = np.clip(128 + 40 * grey / grey.std(), 0, 255).astype(np.uint8)
    return np.ascontiguousarray(wide[:, : shape[1]]), np.ascontiguousarray(wide[:, shift_px : shape[1] + shift_px])


def described(folder, text="", inputs=TWO, weights="net.onnx"):
    path = folder / "net.toml"
    path.write_text(f'weights = "{weights}"\ninputs = {inputs}\n{text}')
    return path


def seen(array, margin_px=6):
    """The part that both images show, its edges apart."""
    return array[margin_px:-margin_px, SHIFT_PX + margin_px : -margin_px]


STACKED = '[{name = "both", image = "stacked"}]'
WITH_HALVES = TWO[:-1] + ', {name = "half", image = "right", size = 0.5}]'
DRESSES = {
    "plain": ({}, "", TWO),
    "grey": ({"channels": 1}, "channels = 1", TWO),
    "stacked, from 0 to 1, like HITNet": ({"inputs": ("both",)}, "scale = 0.00392", STACKED),
    "channels last": ({"layout": "NHWC"}, 'layout = "NHWC"', TWO),
    "negative, the second of two channels": ({"sign": -1, "second": True}, "channel = 1\nsign = -1", TWO),
    "with a half-size image, like CREStereo": ({"half": ("half",)}, 'output = "disparity"', WITH_HALVES),
    "padded and standardised, like FoundationStereo": (
        {},
        "scale = 0.00392\nmean = [0.485, 0.456, 0.406]\nstd = [0.229, 0.224, 0.225]\npad_multiple = 32",
        TWO,
    ),
    "in the other order": ({}, 'order = "bgr"', TWO),
}


@pytest.mark.parametrize("dress", DRESSES)
def test_a_network_that_matches_recovers_a_shift_however_it_is_dressed(tiny, tmp_path, dress):
    options, text, inputs = DRESSES[dress]
    tiny(tmp_path / "net.onnx", **options)
    chosen = matcher("onnx", network=described(tmp_path, text, inputs), num_disparities=32)
    assert isinstance(chosen, Matcher)
    found = chosen.match(*shifted_pair())
    np.testing.assert_array_equal(seen(found.disparity_px), SHIFT_PX)


def test_a_network_of_a_fixed_size_gives_disparities_of_the_images_own_pixels(tiny, tmp_path):
    tiny(tmp_path / "net.onnx")
    network = described(tmp_path, "fixed_size = [50, 180]")
    found = matcher("onnx", network=network).match(*shifted_pair())
    assert found.disparity_px.shape == SHAPE
    assert np.nanmedian(seen(found.disparity_px)) == SHIFT_PX
    # Steps of the network's pixels are half as long as the images'.
    assert set(np.unique(np.rint(4 * seen(found.disparity_px)))) & {35, 37, 36}


@pytest.fixture
def plain(tiny, tmp_path):
    tiny(tmp_path / "net.onnx")
    return described(tmp_path)


def test_no_match_lies_outside_the_right_image_is_zero_or_beyond_the_range(plain):
    chosen = matcher("onnx", network=plain, num_disparities=8)
    left, right = np.random.default_rng(1).integers(0, 256, (2, *SHAPE), dtype=np.uint8)
    found = chosen.match(left, right)
    column = np.broadcast_to(np.arange(SHAPE[1]), SHAPE)
    assert 0 < found.density < 1
    assert (found.disparity_px[found.valid] <= np.minimum(column[found.valid], 8)).all()
    assert (found.disparity_px[found.valid] > 0).all()
    assert not matcher("onnx", network=plain).match(left, left).valid.any()  # infinitely far


def test_sigma_is_missing_exactly_where_disparity_is(plain):
    found = matcher("onnx", network=plain).match(*shifted_pair())
    np.testing.assert_array_equal(np.isnan(found.sigma_px), np.isnan(found.disparity_px))


def test_its_errors_go_together_as_far_as_those_of_a_matcher_that_nobody_measured(plain):
    found = matcher("onnx", network=plain).match(*shifted_pair())
    assert found.correlation_px == error_correlation_px(GENERIC)


def test_a_left_right_check_keeps_the_shift_and_drops_what_only_one_image_shows(plain):
    left, right = shifted_pair()
    right[:, 40:] = np.random.default_rng(2).integers(0, 256, right[:, 40:].shape)
    loose = matcher("onnx", network=plain).match(left, right)
    checked = matcher("onnx", network=plain, left_right_px=0.5).match(left, right)
    both = np.s_[6:-6, SHIFT_PX + 6 : 40 + SHIFT_PX - 6]
    np.testing.assert_array_equal(checked.disparity_px[both], SHIFT_PX)
    assert checked.valid[:, 55:].mean() < 0.3 < loose.valid[:, 55:].mean()


def test_agreement_is_looked_up_at_the_match():
    from_left = np.array([[np.nan, 1, 2, 1, 2, 5]], np.float32)
    from_right = np.array([[2, 9, 1, 1, 0, 0]], np.float32)
    # Column 1 matches 0 (2, off by 1), 2 matches 0, 3 matches 2, 4 matches 2 (1, off by 1), 5 matches 0 (off by 3).
    np.testing.assert_array_equal(agree(from_left, from_right, 0.5), [[False, False, True, True, False, False]])
    np.testing.assert_array_equal(agree(from_left, from_right, 1.0), [[False, True, True, True, True, False]])


def test_the_same_pair_gives_the_same_bits_and_the_images_stay_as_they_were(plain):
    left, right = shifted_pair()
    before = left.copy(), right.copy()
    left.flags.writeable = right.flags.writeable = False
    chosen = matcher("onnx", network=plain, left_right_px=1.0)
    first, again = chosen.match(left, right), chosen.match(left, right)
    np.testing.assert_array_equal(first.disparity_px, again.disparity_px)
    np.testing.assert_array_equal([left, right], before)


WRONG = {
    "weights that are missing": ("", TWO, "none.onnx", InvalidInputError, r"none\.onnx: no such file of weights"),
    "weights that are none": ("", TWO, "bad.onnx", InvalidInputError, r"bad\.onnx: not a network that onnxruntime"),
    "weights cut off": ("", TWO, "cut.onnx", InvalidInputError, r"cut\.onnx: not a network that onnxruntime"),
    "an unknown key": ("pad = 3", TWO, "net.onnx", ConfigError, r"net\.toml: unknown key 'pad'; .*pad_multiple"),
    "no TOML": ("= 3", TWO, "net.onnx", ConfigError, r"net\.toml: "),
    "a wrong input": (
        "",
        TWO.replace('"left",', '"lefft",'),
        "net.onnx",
        ConfigError,
        r"net\.toml: the network has no input 'lefft'; choose from: left, right",
    ),
    "an input left out": (
        "",
        '[{name = "left", image = "stacked"}]',
        "net.onnx",
        ConfigError,
        r"net\.toml: the network's input 'right' is not among inputs",
    ),
    "a wrong output": (
        'output = "depth"',
        TWO,
        "net.onnx",
        ConfigError,
        r"net\.toml: the network has no output 'depth'; choose from: disparity",
    ),
}


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_with_a_network_is_said_when_it_is_opened(tiny, tmp_path, kind):
    text, inputs, weights, error, message = WRONG[kind]
    tiny(tmp_path / "net.onnx")
    (tmp_path / "bad.onnx").write_bytes(b"not a network" * 50)
    whole = (tmp_path / "net.onnx").read_bytes()
    (tmp_path / "cut.onnx").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(error, match=message) as refusal:
        matcher("onnx", network=described(tmp_path, text, inputs, weights))
    assert isinstance(refusal.value, StereogridError)
    assert "\n" not in str(refusal.value)


RUN_WRONG = {
    "the wrong number of channels": ({}, "channels = 1", r"net\.onnx: cannot be run: "),
    "a channel that it does not give": (
        {},
        "channel = 3",
        r"net\.onnx: the output is \(1, 1, 50, 90\); .* a channel 3",
    ),
    "an output in another layout": ({"layout": "NHWC"}, "", r"net\.onnx: "),
    "an output that is not finite": ({"extra": ("Log",)}, "", r"net\.onnx: \d+ values of the output are not finite"),
    "an output without rows": ({"extra": ("ReduceMax",)}, "", r"net\.onnx: the output is \(1, 1, 1, 1\); expected one"),
}


@pytest.mark.parametrize("kind", RUN_WRONG)
def test_what_goes_wrong_in_a_network_is_said_with_its_file(tiny, tmp_path, kind):
    options, text, message = RUN_WRONG[kind]
    tiny(tmp_path / "net.onnx", **options)
    chosen = matcher("onnx", network=described(tmp_path, text))
    with pytest.raises(InvalidInputError, match=message) as refusal:
        chosen.match(*shifted_pair())
    assert "\n" not in str(refusal.value)


def test_a_matcher_without_a_network_is_refused_with_what_it_needs():
    with pytest.raises(InvalidInputError, match="the matcher 'onnx' needs a network"):
        matcher("onnx", num_disparities=64)


def test_options_that_cannot_be_are_refused_by_name(tmp_path):
    with pytest.raises(InvalidInputError, match="num_disparities must be positive, not 0"):
        matcher("onnx", network="net.toml", num_disparities=0)
    with pytest.raises(InvalidInputError, match="left_right_px must be finite and >= 0, not -1"):
        matcher("onnx", network="net.toml", left_right_px=-1)
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read"):
        matcher("onnx", network=tmp_path / "none.toml")


def test_a_pair_that_cannot_be_matched_is_refused(plain):
    chosen = matcher("onnx", network=plain)
    with pytest.raises(InvalidInputError, match="an image of 90x1 px is too small for a network"):
        chosen.match(np.zeros((1, 90), np.uint8), np.zeros((1, 90), np.uint8))
    with pytest.raises(InvalidInputError, match="differ in size"):
        chosen.match(np.zeros((50, 90), np.uint8), np.zeros((50, 91), np.uint8))


def test_without_onnxruntime_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(MissingExtraError, match=r'pip install "stereogrid\[onnx\]"'):
        matcher("onnx", network=described(tmp_path))


def test_matching_is_imported_without_onnxruntime():
    code = "import sys, stereogrid.matching; sys.exit('onnxruntime' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
