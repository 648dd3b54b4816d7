"""No cell that an observation could change lies outside the blocks that are looked at."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.geometry import inverse, transform
from stereogrid.grid.blocks import BLOCK
from stereogrid.grid.view import blocks_in_view, view_volume_m3

from .scenes import CAMERA, FORWARD, random_pose

cameras = st.builds(
    StereoCamera,
    focal_px=st.floats(15, 120),
    cx_px=st.floats(-20, 60),
    cy_px=st.floats(-20, 50),
    baseline_m=st.just(0.1),
    width_px=st.just(40),
    height_px=st.just(30),
)


@given(camera=cameras, seed=st.integers(0, 2**32 - 1), cell_m=st.floats(0.03, 0.15), max_range_m=st.floats(0.3, 2.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_every_block_with_a_cell_whose_centre_is_seen_is_in_view(camera, seed, cell_m, max_range_m):
    pose = random_pose(np.random.default_rng(seed), spread_m=5.0)
    block_m = BLOCK * cell_m
    low = np.floor((pose[:3, 3] - max_range_m) / block_m).astype(int) - 1
    high = np.floor((pose[:3, 3] + max_range_m) / block_m).astype(int) + 1
    axes = [np.arange(a, b + 1) for a, b in zip(low, high, strict=True)]
    all_blocks = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    within = np.stack(np.meshgrid(*[np.arange(BLOCK)] * 3, indexing="ij"), -1).reshape(-1, 3)
    points = ((all_blocks[:, None] * BLOCK + within + 0.5) * cell_m).reshape(-1, 3)
    cells = transform(inverse(pose), points)
    safe = np.maximum(cells[:, 2], 1e-9)
    column, row = (camera.focal_px * cells[:, a] / safe + c for a, c in ((0, camera.cx_px), (1, camera.cy_px)))
    seen = (cells[:, 2] > 0) & (np.linalg.norm(cells, axis=1) <= max_range_m)
    seen &= (column >= -0.5) & (column < camera.width_px - 0.5) & (row >= -0.5) & (row < camera.height_px - 0.5)
    touched = all_blocks[seen.reshape(len(all_blocks), -1).any(axis=1)]
    found = blocks_in_view(camera, pose, cell_m, max_range_m=max_range_m)
    assert {tuple(b) for b in touched.tolist()} <= {tuple(b) for b in found.tolist()}


@given(camera=cameras, seed=st.integers(0, 2**32 - 1), cell_m=st.floats(0.02, 0.2), max_range_m=st.floats(0.3, 3.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_every_point_on_a_pixels_ray_within_the_range_lies_in_a_block_in_view(camera, seed, cell_m, max_range_m):
    rng = np.random.default_rng(seed)
    pose = random_pose(rng, spread_m=5.0)
    rays = camera.ray_directions.reshape(-1, 3)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    points = transform(pose, rays * rng.uniform(0, max_range_m, (len(rays), 1)))
    found = blocks_in_view(camera, pose, cell_m, max_range_m=max_range_m)
    needed = np.floor(points / (BLOCK * cell_m)).astype(int)
    assert {tuple(b) for b in needed.tolist()} <= {tuple(b) for b in found.tolist()}


@given(camera=cameras, seed=st.integers(0, 2**32 - 1), cell_m=st.floats(0.02, 0.2))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_no_block_comes_twice_and_they_come_sorted(camera, seed, cell_m):
    blocks = blocks_in_view(camera, random_pose(np.random.default_rng(seed)), cell_m, max_range_m=2.0)
    np.testing.assert_array_equal(blocks, np.unique(blocks, axis=0))
    assert blocks.dtype == np.int64


def test_blocks_behind_the_camera_and_beyond_the_range_are_left_out():
    # Blocks of 0.08 m, a range of 2 m along x, 67 degrees across.
    blocks = blocks_in_view(CAMERA, FORWARD, 0.01, max_range_m=2.0)
    centres = (blocks + 0.5) * 0.08
    radius_m = 0.08 * np.sqrt(3) / 2
    assert centres[:, 0].min() > -2 * radius_m
    assert np.linalg.norm(centres, axis=1).max() <= 2.0 + radius_m
    # Not much more than the view itself and a rim of blocks: the pyramid has 3.6 m^3, its ball-capped part less.
    assert len(blocks) * 0.08**3 < 2.2 * view_volume_m3(CAMERA, 2.0)


@pytest.mark.parametrize("max_range_m", [0.5, 3.0])
def test_the_volume_of_the_view_is_that_of_the_points_that_project_into_the_image(max_range_m):
    rng = np.random.default_rng(3)
    # A box around the pyramid; the share of its points that the left camera sees.
    half = np.array([40 / 60, 30 / 60]) * max_range_m
    points = rng.uniform([-half[0], -half[1], 0], [half[0], half[1], max_range_m], (200_000, 3))
    column, row, _ = CAMERA.project(points).T
    seen = (column >= -0.5) & (column < 79.5) & (row >= -0.5) & (row < 59.5)
    box_m3 = 4 * half[0] * half[1] * max_range_m
    assert view_volume_m3(CAMERA, max_range_m) == pytest.approx(seen.mean() * box_m3, rel=0.02)
