"""An observation counts for what is new in it: in full when the camera has moved, little when it has waited."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.grid import OccupancyGrid
from stereogrid.grid.cells import LARGEST_EVIDENCE, ONE
from stereogrid.mapper import Mapper
from stereogrid.matching.correlation import ErrorReach, error_reaches
from stereogrid.novelty import Novelty, image_motion_px
from stereogrid.observation import Disparity, Observation, Odometry
from stereogrid.sensor_model import SensorModel

# The principal point is a pixel that is looked at: STRIDE_PX (i + 1/2).
CAMERA = StereoCamera(focal_px=60, cx_px=40, cy_px=24, baseline_m=0.1, width_px=80, height_px=60)
FORWARD = from_rotation(R_BASE_OPTICAL)
REACH = ErrorReach(correlation_px=20, temporal_share=0.3, decorrelation_px=4, lasting_share=0.1)

seeds = st.integers(0, 2**32 - 1)


def wall(depth_m):
    """A plane parallel to the image."""
    d = CAMERA.focal_baseline_px_m / depth_m
    return Disparity(np.full(CAMERA.shape, d, np.float32), np.float32(0.2))


def only_the_centre(depth_m):
    d = np.full(CAMERA.shape, np.nan, np.float32)
    d[int(CAMERA.cy_px), int(CAMERA.cx_px)] = CAMERA.focal_baseline_px_m / depth_m
    return Disparity(d, np.float32(0.2))


def no_match():
    return Disparity(np.full(CAMERA.shape, np.nan, np.float32), np.float32(0.2))


def turned(yaw_rad):
    """T_before_now of a camera that turns about its own vertical axis."""
    return np.linalg.inv(FORWARD) @ from_yaw(yaw_rad, [0, 0, 0]) @ FORWARD


def moved(sideways_m):
    T = np.eye(4)
    T[0, 3] = sideways_m
    return T


def moved_px(pixels, depth_m=2.0):
    """T_world_cam that shifts the image of a wall at depth_m by so many pixels against FORWARD."""
    return FORWARD @ moved(pixels * depth_m / CAMERA.focal_px)


def weights(reach, poses, disparity=None):
    novelty = Novelty(CAMERA, reach)
    return [novelty.weight(disparity or wall(2.0), T) for T in poses]


@given(st.floats(1e-4, 0.02), st.floats(0.5, 20))
def test_a_small_turn_moves_the_image_centre_by_focal_times_the_angle_at_any_depth(yaw_rad, depth_m):
    for sign in (-1, 1):
        found = image_motion_px(CAMERA, only_the_centre(depth_m), turned(sign * yaw_rad))
        assert found == pytest.approx(CAMERA.focal_px * yaw_rad, rel=yaw_rad**2)
        assert found == pytest.approx(CAMERA.focal_px * np.tan(yaw_rad), rel=1e-5)


@given(st.floats(-3, 3), st.floats(0.5, 20))
def test_a_sidestep_moves_a_wall_by_focal_times_step_over_depth(step_m, depth_m):
    found = image_motion_px(CAMERA, wall(depth_m), moved(step_m))
    # float32 disparities: 1e-7 of them.
    assert found == pytest.approx(CAMERA.focal_px * abs(step_m) / depth_m, rel=1e-5, abs=1e-9)


def test_a_roll_about_the_view_moves_a_pixel_by_its_distance_from_the_centre():
    T = np.eye(4)
    T[:2, :2] = [[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]]
    d = np.full(CAMERA.shape, np.nan, np.float32)
    d[24, 72] = 3.0
    found = image_motion_px(CAMERA, Disparity(d, np.float32(0.2)), T)
    assert found == pytest.approx(2 * np.sin(0.05) * 32, rel=1e-6)


@given(st.floats(0.5, 20))
def test_without_motion_the_image_does_not_move(depth_m):
    assert image_motion_px(CAMERA, wall(depth_m), np.eye(4)) == pytest.approx(0, abs=1e-9)


def test_without_a_match_or_with_all_of_it_behind_the_camera_before_the_motion_is_not_known():
    assert image_motion_px(CAMERA, no_match(), moved(1.0)) == np.inf
    backwards = np.eye(4)
    backwards[2, 3] = -5.0
    assert image_motion_px(CAMERA, wall(2.0), backwards) == np.inf


def test_half_of_the_points_decide():
    """The median: a third of the view that lies very near does not make the whole observation new."""
    d = wall(10.0).disparity_px.copy()
    d[:, :24] = 100.0
    found = image_motion_px(CAMERA, Disparity(d, np.float32(0.2)), moved(0.1))
    assert found == pytest.approx(CAMERA.focal_px * 0.1 / 10, rel=1e-5)


@pytest.mark.parametrize("disparity", [wall(2.0), no_match()])
def test_the_first_observation_counts_in_full(disparity):
    for reach in (REACH, None, *error_reaches().values()):
        assert weights(reach, [FORWARD], disparity) == [1.0]


@pytest.mark.parametrize("reach", [REACH, *error_reaches().values()])
def test_at_rest_an_observation_counts_for_the_temporal_share(reach):
    found = weights(reach, [FORWARD] * 4)
    assert found[0] == 1
    # The pose is inverted and multiplied with itself: rounding moves the image by some 1e-14 px.
    assert found[1:] == pytest.approx([reach.temporal_share] * 3, abs=1e-9)


@given(st.floats(1.001, 20))
def test_from_the_decorrelation_length_on_an_observation_counts_in_full(times):
    for sign in (-1, 1):
        assert weights(REACH, [FORWARD, moved_px(sign * times * REACH.decorrelation_px)])[1] == 1


@given(st.lists(st.floats(0, 6), min_size=2, max_size=8).map(sorted))
def test_the_further_the_image_moves_the_more_an_observation_counts(pixels):
    found = [weights(REACH, [FORWARD, moved_px(each)])[1] for each in pixels]
    assert all(a <= b + 1e-9 for a, b in pairwise(found))
    assert min(found) >= REACH.temporal_share - 1e-9
    assert max(found) <= 1


def test_half_the_decorrelation_length_is_half_of_what_is_missing():
    found = weights(REACH, [FORWARD, moved_px(REACH.decorrelation_px / 2)])
    assert found[1] == pytest.approx(0.3 + 0.7 / 2, rel=1e-5)


def test_only_the_motion_since_the_observation_before_counts():
    """Away and back again: the place is known, but its last look is not the one before."""
    away = moved_px(10)
    assert weights(REACH, [FORWARD, away, FORWARD, FORWARD]) == pytest.approx([1, 1, 1, 0.3], abs=1e-9)


@given(seeds)
def test_without_a_reach_every_observation_counts_in_full(seed):
    rng = np.random.default_rng(seed)
    poses = [FORWARD, FORWARD, moved_px(rng.uniform(0, 10)), FORWARD]
    assert weights(None, poses) == [1.0] * 4


def test_errors_that_never_let_go_weigh_the_share_and_errors_that_never_hold_weigh_in_full():
    never = ErrorReach(correlation_px=20, temporal_share=0.3, decorrelation_px=np.inf, lasting_share=1)
    assert weights(never, [FORWARD, moved_px(50)])[1] == pytest.approx(0.3)
    at_once = ErrorReach(correlation_px=20, temporal_share=0.3, decorrelation_px=0, lasting_share=0)
    assert weights(at_once, [FORWARD, FORWARD])[1] == 1


def test_a_weight_is_above_0_whatever_the_reach_and_the_view():
    """The grid takes no weight of 0: a cell that was seen is known."""
    frozen = ErrorReach(correlation_px=20, temporal_share=0, decorrelation_px=np.inf, lasting_share=1)
    for reach in (frozen, REACH):
        for disparity in (wall(2.0), no_match()):
            assert all(0 < each <= 1 for each in weights(reach, [FORWARD] * 3, disparity))


class Waiting:
    """A matcher that finds the same wall, with the same mistakes, in every frame."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        d = CAMERA.focal_baseline_px_m / 1.5 + rng.normal(0, 0.2, CAMERA.shape)
        self.disparity = Disparity(d.astype(np.float32), np.float32(0.2), correlation_px=4.0)

    def match(self, left, right):
        return self.disparity


def gained(n, reach, fusion, seed=3):
    """Cells and what n identical frames at one place added to their log-odds."""
    grid = OccupancyGrid(0.1, model=SensorModel(max_range_m=3.0), fusion=fusion, clamp=None)
    mapper = Mapper(CAMERA, Waiting(seed), grid, reach=reach)
    grey = np.zeros(CAMERA.shape, np.uint8)
    for frame in range(n):
        mapper.step(Observation(float(frame), grey, grey, Odometry(np.eye(4)), FORWARD))
    return grid.blocks.known()


@pytest.mark.parametrize("reach", [REACH, *error_reaches().values()])
@pytest.mark.parametrize("fusion", ["cell", "sum_of_rays"])
def test_a_robot_at_rest_gains_no_more_than_what_changes_from_frame_to_frame(reach, fusion):
    n = 10
    cells, once = gained(1, reach, fusion)
    cells_after, after = gained(n, reach, fusion)
    np.testing.assert_array_equal(cells_after, cells)
    # Where rays add up past the most that one observation may say, more frames may say it again.
    within = np.abs(once) < LARGEST_EVIDENCE / ONE
    once, after = once[within], after[within]
    assert np.abs(once).max() > 1
    assert within.mean() > 0.8
    looks = 1 + (n - 1) * reach.temporal_share
    # Each further frame adds a whole number of 1 / ONE nats: half a unit of rounding, and as much in the first.
    rounding = 0.5 * (n - 1) * (1 + reach.temporal_share) / ONE
    assert (np.abs(after) <= np.abs(once) * looks + rounding + 1e-5).all()
    # And it gains that much: to wait is of use as far as the noise changes.
    assert (np.abs(after) >= np.abs(once) * looks - rounding - 1e-5).all()


def test_without_a_reach_a_robot_at_rest_takes_every_frame_for_a_new_look():
    _, once = gained(1, None, "cell")
    _, after = gained(10, None, "cell")
    np.testing.assert_allclose(after, 10 * once, atol=1e-4)
