"""What the map refuses, in one line and without having changed."""

import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from stereogrid.errors import InvalidInputError, MapTooLargeError
from stereogrid.geometry import from_yaw
from stereogrid.observation import Disparity
from stereogrid.sensor_model import SensorModel

from .scenes import CAMERA, FORWARD, empty, mapped, wall


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        ({"cell_m": 0}, "cell_m"),
        ({"cell_m": -0.1}, "cell_m"),
        ({"cell_m": np.nan}, "cell_m"),
        ({"cell_m": np.inf}, "cell_m"),
        ({"fusion": "mean"}, "'mean'; choose from: cell, sum_of_rays"),
        ({"clamp": 0}, "clamp"),
        ({"clamp": np.nan}, "clamp"),
        ({"memory_limit_gb": np.nan}, "memory_limit_gb"),
        ({"memory_limit_gb": -1}, "memory_limit_gb"),
    ],
)
def test_a_map_that_makes_no_sense_is_refused(options, culprit):
    with pytest.raises(InvalidInputError, match=culprit):
        empty(**options)


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        ({"form": "typed"}, "'typed'; choose from: corrected, printed"),
        ({"p_free": 0.6}, "p_free 0.6"),
        ({"prior": np.nan}, "prior nan"),
        ({"max_range_m": np.inf}, "max_range_m"),
    ],
)
def test_a_sensor_model_that_makes_no_sense_is_refused(options, culprit):
    with pytest.raises(InvalidInputError, match=culprit):
        SensorModel(**options)


def bad_pose(i, j, value):
    pose = FORWARD.copy()
    pose[i, j] = value
    return pose


@pytest.mark.parametrize(
    ("pose", "eps_m", "shape", "culprit"),
    [
        (FORWARD, 0.0, (60, 79), r"disparity is \(60, 79\), the camera \(60, 80\)"),
        (FORWARD, 0.0, (80, 60), r"disparity is \(80, 60\)"),
        (bad_pose(0, 3, np.nan), 0.0, (60, 80), "T_world_cam contains NaN"),
        (bad_pose(0, 0, 0.5), 0.0, (60, 80), "T_world_cam is not rigid"),
        (np.diag([1.0, 1, -1, 1]), 0.0, (60, 80), "T_world_cam is not rigid"),
        (bad_pose(0, 3, 1e30), 0.0, (60, 80), "too far to map"),
        (np.eye(3), 0.0, (60, 80), r"T_world_cam must be a \(4, 4\)"),
        (FORWARD, -0.01, (60, 80), "motion_sigma_m"),
        (FORWARD, np.nan, (60, 80), "motion_sigma_m"),
        (FORWARD, np.inf, (60, 80), "motion_sigma_m"),
    ],
)
def test_a_bad_observation_is_refused_and_the_map_stays_as_it_was(pose, eps_m, shape, culprit):
    grid = mapped([FORWARD], [wall(2.0)])
    before = grid.sha256(), len(grid.blocks)
    with pytest.raises(InvalidInputError, match=culprit):
        grid.integrate(CAMERA, Disparity(np.full(shape, 5, np.float32), np.float32(0.2)), pose, motion_sigma_m=eps_m)
    assert (grid.sha256(), len(grid.blocks)) == before


@pytest.mark.parametrize(
    ("cell_m", "need"), [(0.001, r"288 GB"), (1e-6, r"2.88e\+11 GB"), (1e-120, "GB, the limit is 4 GB")]
)
def test_cells_too_small_for_the_memory_are_refused_at_once_naming_the_need(cell_m, need):
    # The view is a pyramid of 80 * 60 / 60^2 * 3^3 / 3 = 12 m^3, at 24 bytes a cell.
    grid = empty(cell_m=cell_m)
    tracemalloc.start()
    started_s = time.perf_counter()
    with pytest.raises(MapTooLargeError, match=need) as caught:
        grid.integrate(CAMERA, wall(2.0), FORWARD)
    seconds, peak = time.perf_counter() - started_s, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "the limit is 4 GB" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert seconds < 0.1
    assert peak < 1e6
    assert len(grid.blocks) == 0


def test_growth_past_the_limit_is_refused_and_the_map_stays_as_it_was():
    grid = mapped([FORWARD], [wall(2.0)])
    # Room for one view and its scratch, but not for the views of a drive.
    grid.memory_limit_gb = 0.0003
    grid.check_fits(CAMERA)
    elsewhere = [from_yaw(2.0 * n, [5.0 * n, 3, 1]) @ FORWARD for n in range(1, 30)]
    with pytest.raises(MapTooLargeError, match=r"would grow to .* GB, its limit is"):
        for T_world_cam in elsewhere:
            before = grid.sha256(), len(grid.blocks), len(grid.blocks.words)
            grid.integrate(CAMERA, wall(2.0), T_world_cam)
    assert len(grid.blocks) > 0
    assert (grid.sha256(), len(grid.blocks), len(grid.blocks.words)) == before
    # What needs no more room is still taken.
    grid.integrate(CAMERA, wall(2.0), FORWARD)
    assert grid.sha256() != before[0]


def test_an_image_of_one_row_is_refused():
    camera = replace(CAMERA, height_px=1)
    with pytest.raises(InvalidInputError, match=r"\(1, 80\) is too small to map"):
        empty().integrate(camera, Disparity(np.full((1, 80), 5, np.float32), np.float32(0.2)), FORWARD)


@pytest.mark.parametrize("weight", [0.0, -1.0, 1.5, np.nan])
def test_a_weight_that_is_no_share_is_refused(weight):
    with pytest.raises(InvalidInputError, match="weight"):
        empty().integrate(CAMERA, wall(2.0), FORWARD, weight=weight)


def test_a_motion_rule_that_there_is_not_is_refused_with_the_choices():
    with pytest.raises(InvalidInputError, match="no motion rule named 'max'; choose from: linear, rss"):
        empty().integrate(CAMERA, wall(1.0), FORWARD, 0.1, motion_rule="max")
