"""Readings are checked when they are made: what gets past the door is whole."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_yaw
from stereogrid.matching import matcher
from stereogrid.observation import Disparity, Matcher, Observation, Odometry, Source, Truth

IMAGE = np.zeros((4, 6), np.uint8)
NOT_RIGID = np.diag([2.0, 1, 1, 1])


def observation(**changes):
    values = {"stamp_s": 1.5, "left": IMAGE, "right": IMAGE, "odometry": Odometry(np.eye(4)), "T_world_cam": np.eye(4)}
    return Observation(**{**values, **changes})


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"left": np.zeros((4, 6))}, r"the left image must be \(H, W\) uint8, not \(4, 6\) float64"),
        (
            {"right": np.zeros((4, 6, 3), np.uint8)},
            r"the right image must be \(H, W\) uint8, not \(4, 6, 3\) uint8; make it grey first",
        ),
        ({"left": [[0, 1]]}, r"the left image must be \(H, W\) uint8, not list"),
        ({"right": np.zeros((4, 5), np.uint8)}, r"differ in size: \(4, 6\) and \(4, 5\)"),
        ({"stamp_s": np.nan}, "stamp_s must be finite, not nan"),
        ({"T_world_cam": NOT_RIGID}, "T_world_cam is not rigid"),
        ({"disparity": Disparity(np.ones((4, 5)), 0.1)}, r"the disparity is \(4, 5\), the images are \(4, 6\)"),
        ({"T_world_cam": np.full((4, 4), np.nan)}, "T_world_cam contains NaN"),
    ],
)
def test_an_observation_that_is_not_whole_is_refused_with_the_reason(changes, reason):
    observation()
    with pytest.raises(InvalidInputError, match=reason):
        observation(**changes)


@pytest.mark.parametrize("name", ["travelled_m", "turned_rad"])
@pytest.mark.parametrize("value", [-0.1, np.nan])
def test_odometry_cannot_have_travelled_less_than_nothing(name, value):
    with pytest.raises(InvalidInputError, match="travelled_m and turned_rad must be >= 0"):
        Odometry(np.eye(4), **{name: value})


def test_odometry_and_truth_name_their_pose_when_it_is_not_rigid():
    with pytest.raises(InvalidInputError, match="T_odom_base is not rigid"):
        Odometry(NOT_RIGID)
    with pytest.raises(InvalidInputError, match="true T_world_cam is not rigid"):
        Truth(NOT_RIGID)


def test_a_pose_may_be_given_as_nested_lists():
    assert Odometry(np.eye(4).tolist()).T_odom_base.shape == (4, 4)
    assert observation(T_world_cam=from_yaw(0.3, [1, 2, 3]).tolist()).T_world_cam.dtype == np.float64


positive_or_missing = arrays.arrays(
    np.float64, (3, 4), elements=st.one_of(st.floats(0.0625, 200), st.just(float("nan")))
)


@given(positive_or_missing, st.floats(0.01, 4))
def test_density_is_the_share_of_matched_pixels(d, sigma_px):
    disparity = Disparity(d, sigma_px)
    assert disparity.disparity_px.dtype == disparity.sigma_px.dtype == np.float32
    assert disparity.sigma_px.shape == (3, 4)
    assert disparity.density == pytest.approx(np.count_nonzero(d > 0) / 12)
    np.testing.assert_array_equal(disparity.valid, d > 0)


@pytest.mark.parametrize(
    ("d", "sigma", "reason"),
    [
        (0.0, 0.3, "disparity_px must be positive and finite"),
        (-1.0, 0.3, "disparity_px must be positive and finite"),
        (np.inf, 0.3, "disparity_px must be positive and finite"),
        (5.0, 0.0, "sigma_px must be positive and finite"),
        (5.0, np.inf, "sigma_px must be positive and finite"),
        (5.0, np.nan, "sigma_px is NaN where disparity_px is not"),
    ],
)
def test_one_impossible_pixel_is_refused_by_name(d, sigma, reason):
    disparity_px, sigma_px = np.full((2, 3), 4.0), np.full((2, 3), 0.3)
    Disparity(disparity_px, sigma_px)
    disparity_px[1, 2], sigma_px[1, 2] = d, sigma
    with pytest.raises(InvalidInputError, match=reason):
        Disparity(disparity_px, sigma_px)


@pytest.mark.parametrize("length_px", [0.99, 0.0, -np.inf, np.nan])
def test_errors_that_reach_less_far_than_their_own_pixel_are_refused(length_px):
    with pytest.raises(InvalidInputError, match=rf"correlation_px must be 1 to inf, not {length_px}"):
        Disparity(np.ones((2, 3)), 0.3, correlation_px=length_px)


def test_errors_go_together_all_over_unless_one_says_otherwise():
    assert Disparity(np.ones((2, 3)), 0.3).correlation_px == np.inf
    assert Disparity(np.ones((2, 3)), 0.3, correlation_px=1).correlation_px == 1


def test_disparity_and_sigma_of_different_size_are_refused():
    with pytest.raises(InvalidInputError, match=r"sigma_px must be one number or as disparity_px \(2, 3\), not \(3,\)"):
        Disparity(np.ones((2, 3)), np.ones(3))
    with pytest.raises(InvalidInputError, match=r"disparity_px must be \(H, W\), not \(3,\)"):
        Disparity(np.ones(3), np.ones(3))


def test_anything_with_a_camera_a_mounting_and_observations_is_a_source():
    class Replay:
        camera = StereoCamera(834, 319.5, 239.5, 0.06, 640, 480)
        T_base_cam = np.eye(4)

        def __iter__(self):
            yield observation()

    assert isinstance(Replay(), Source)
    assert not isinstance(iter([observation()]), Source)
    assert isinstance(matcher("bm"), Matcher)
