"""Images become the tensors that a description asks for, and its output becomes a disparity of the images' size."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.errors import ConfigError, InvalidInputError
from stereogrid.matching.onnx_network import NetworkDescription, NetworkInput
from stereogrid.tomlfile import config_from_table, load_config

BOTH = (NetworkInput("a", "left"), NetworkInput("b", "right"))
PLAIN = NetworkDescription("net.onnx", BOTH)
LEFT, RIGHT = np.random.default_rng(0).integers(0, 256, (2, 10, 14), dtype=np.uint8)


def test_a_plain_description_passes_grey_values_in_three_equal_channels():
    fed = PLAIN.feed(LEFT, RIGHT)
    assert list(fed) == ["a", "b"]
    assert fed["a"].dtype == np.float32
    np.testing.assert_array_equal(fed["a"], np.stack([LEFT] * 3)[None])
    np.testing.assert_array_equal(fed["b"][0, 2], RIGHT)


def test_hitnet_gets_one_tensor_of_six_channels_from_0_to_1():
    described = NetworkDescription("net.onnx", (NetworkInput("input", "stacked"),), scale=1 / 255)
    (fed,) = described.feed(LEFT, RIGHT).values()
    assert fed.shape == (1, 6, 10, 14)
    np.testing.assert_allclose(fed[0, :3], np.stack([LEFT / 255] * 3), rtol=1e-6)
    np.testing.assert_allclose(fed[0, 3:], np.stack([RIGHT / 255] * 3), rtol=1e-6)


def test_crestereo_gets_the_pair_at_half_size_as_well():
    inputs = (*BOTH, NetworkInput("half_a", "left", 0.5), NetworkInput("half_b", "right", 0.5))
    fed = NetworkDescription("net.onnx", inputs).feed(LEFT, RIGHT)
    assert [fed[name].shape for name in ("a", "half_b")] == [(1, 3, 10, 14), (1, 3, 5, 7)]
    means = LEFT.reshape(5, 2, 7, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(fed["half_a"][0, 0], means, atol=0.51)


@pytest.mark.parametrize("order", ["rgb", "bgr"])
def test_foundation_stereo_gets_standardised_colours_in_the_order_asked_for(order):
    mean, std = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
    described = replace(PLAIN, scale=1 / 255, mean=mean, std=std, order=order, pad_multiple=32)
    fed = described.feed(LEFT, RIGHT)["a"]
    assert fed.shape == (1, 3, 32, 32)
    for channel, colour in enumerate((0, 1, 2) if order == "rgb" else (2, 1, 0)):
        np.testing.assert_allclose(fed[0, channel, :10, :14], (LEFT / 255 - mean[colour]) / std[colour], rtol=1e-4)


def test_padding_repeats_the_last_row_and_column():
    fed = replace(PLAIN, pad_multiple=8).feed(LEFT, RIGHT)["a"][0, 0]
    assert fed.shape == (16, 16)
    np.testing.assert_array_equal(fed[10:, :14], np.tile(LEFT[-1], (6, 1)))
    np.testing.assert_array_equal(fed[:10, 14:], np.tile(LEFT[:, -1:], (1, 2)))


def test_the_other_layout_holds_the_same_numbers():
    usual, other = PLAIN.feed(LEFT, RIGHT)["a"], replace(PLAIN, layout="NHWC").feed(LEFT, RIGHT)["a"]
    np.testing.assert_array_equal(other, usual.transpose(0, 2, 3, 1))
    assert other.flags.c_contiguous


@given(st.integers(4, 40), st.integers(4, 40), st.integers(1, 16), st.sampled_from([(), (12, 20), (30, 9)]))
def test_the_output_for_what_was_fed_is_a_disparity_of_the_images_size(height, width, multiple, fixed_size):
    described = replace(PLAIN, pad_multiple=multiple, fixed_size=fixed_size)
    image = np.zeros((height, width), np.uint8)
    fed = described.feed(image, image)["a"]
    assert all(side % multiple == 0 for side in fed.shape[2:])
    found = described.disparity(np.full((1, 1, *fed.shape[2:]), 3.0, np.float32), (height, width))
    assert (found.shape, found.dtype) == ((height, width), np.float32)
    # Pixels of the images are as many times wider as the network's image is narrower.
    np.testing.assert_allclose(found, 3 * width / (fixed_size[1] if fixed_size else width), rtol=1e-5)


@pytest.mark.parametrize("lead", [(), (1,), (1, 1)])
def test_an_output_may_leave_out_the_axes_of_length_one(lead):
    field = np.random.default_rng(1).normal(size=(10, 14)).astype(np.float32)
    np.testing.assert_array_equal(PLAIN.disparity(field.reshape(*lead, 10, 14), (10, 14)), field)


def test_channel_and_sign_are_taken_as_described():
    field = np.random.default_rng(1).normal(size=(1, 2, 10, 14)).astype(np.float32)
    described = replace(PLAIN, channel=1, sign=-1)
    np.testing.assert_array_equal(described.disparity(field, (10, 14)), -field[0, 1])
    other = replace(described, layout="NHWC").disparity(field.transpose(0, 2, 3, 1), (10, 14))
    np.testing.assert_array_equal(other, -field[0, 1])


@pytest.mark.parametrize(
    "shape", [(1, 1, 10, 13), (1, 1, 5, 7), (2, 1, 10, 14), (140,), (1, 10, 14, 1), (1, 1, 1, 10, 14)]
)
def test_an_output_of_the_wrong_shape_is_refused_with_the_right_one(shape):
    with pytest.raises(
        InvalidInputError, match=r"the output is .*; expected one image of 10 rows and 14 columns in NCHW"
    ):
        PLAIN.disparity(np.zeros(shape, np.float32), (10, 14))


def test_a_channel_that_is_not_there_is_refused():
    with pytest.raises(InvalidInputError, match=r"the output is \(1, 1, 10, 14\); .* with a channel 1"):
        replace(PLAIN, channel=1).disparity(np.zeros((1, 1, 10, 14), np.float32), (10, 14))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_output_that_is_not_finite_is_refused(value):
    field = np.zeros((10, 14), np.float32)
    field[3, 4:7] = value
    with pytest.raises(InvalidInputError, match="3 values of the output are not finite"):
        PLAIN.disparity(field, (10, 14))


GOOD = {"weights": "net.onnx", "inputs": [{"name": "a", "image": "left"}, {"name": "b", "image": "right"}]}


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"scael": 1.0}, "unknown key 'scael'; did you mean 'scale'?"),
        ({"inputs": [{"name": "a", "imge": "left"}]}, r"unknown key 'inputs\[0\].imge'; did you mean 'image'?"),
        ({"inputs": [{"name": "a"}]}, r"missing key 'inputs\[0\].image'"),
        ({"inputs": [{"name": "a", "image": "up"}]}, r"no image named 'up'; choose from: left, right, stacked"),
        ({"inputs": [{"name": "a", "image": "left"}]}, "inputs must show the network both images"),
        ({"inputs": [{"name": "a", "image": "stacked"}] * 2}, "inputs must be named once each"),
        ({"inputs": {"name": "a"}}, "'inputs' must be a list"),
        ({"inputs": [{"name": "a", "image": "stacked", "size": 2}]}, "size must be above 0 and at most 1, not 2.0"),
        ({"layout": "NWHC"}, r"no layout named 'NWHC'; did you mean 'NHWC'\? choose from: NCHW, NHWC"),
        ({"order": "gbr"}, "no order named 'gbr'"),
        ({"channels": 6}, "channels must be 1 or 3, not 6"),
        ({"mean": [1.0, 2.0]}, "mean must be one finite number or one a channel"),
        ({"mean": 1.0}, "'mean' must be a list, not 1.0"),
        ({"std": [1.0, "a"]}, r"'std\[1\]' must be float, not 'a'"),
        ({"std": [0.0]}, "std must be positive"),
        ({"fixed_size": [480]}, r"fixed_size must be \[height, width\]"),
        ({"pad_multiple": 0}, "pad_multiple must be 1 to 1024"),
        ({"sign": 0}, "sign must be 1 or -1"),
        ({"scale": 0.0}, "scale must be 1e-06 to 1e"),
        ({"std": [1e-320]}, "std must be positive"),
        ({"pad_multiple": 2**31}, "pad_multiple must be 1 to 1024"),
        ({"channel": -1}, "channel must be >= 0"),
    ],
)
def test_a_wrong_line_of_the_description_is_named_with_the_choices(wrong, message):
    with pytest.raises(ConfigError, match=message):
        config_from_table(NetworkDescription, {**GOOD, **wrong})


def test_the_example_in_the_documentation_is_read(tmp_path):
    from stereogrid.matching import onnx_network

    text = onnx_network.__doc__.split("\n\n", 1)[1]
    (tmp_path / "net.toml").write_text("\n".join(line.strip() for line in text.splitlines()))
    described = load_config(NetworkDescription, tmp_path / "net.toml")
    assert [each.size for each in described.inputs] == [0.5, 0.5, 1.0, 1.0]
    assert (described.output, described.channel) == ("next_output", 0)


def test_what_must_be_described_is_asked_for():
    with pytest.raises(ConfigError, match="missing key 'weights'"):
        config_from_table(NetworkDescription, {"inputs": GOOD["inputs"]})
