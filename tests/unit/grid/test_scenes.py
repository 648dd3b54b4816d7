"""Known scenes, both fusion rules and the options of the sensor model."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, transform
from stereogrid.grid import FUSIONS, OccupancyGrid
from stereogrid.grid.cells import ONE
from stereogrid.observation import Disparity
from stereogrid.scoring.ground import camera_height
from stereogrid.sensor_model import REACH_BEHIND_SIGMAS, SensorModel, log_odds, widened_sigma_px

from .scenes import (
    CAMERA,
    FORWARD,
    FREE_GAIN,
    MODEL,
    contents,
    empty,
    ground_disparity,
    mapped,
    no_disparity,
    random_pose,
    wall,
)

seeds = st.integers(0, 2**32 - 1)


# Known scenes


@pytest.mark.parametrize("fusion", FUSIONS)
@given(depth_m=st.floats(0.9, 2.4), offset=st.tuples(*[st.floats(0, 0.1)] * 3))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_a_wall_is_occupied_where_it_stands_with_free_before_and_unknown_behind(fusion, depth_m, offset):
    pose = FORWARD.copy()
    pose[:3, 3] = offset
    grid = mapped([pose], [wall(depth_m, 0.05)], fusion=fusion)
    wall_x = offset[0] + depth_m
    y, z = np.meshgrid(np.arange(-0.15, 0.2, 0.1) + offset[1], np.arange(-0.15, 0.2, 0.1) + offset[2])

    def p_at(x):
        return grid.probability(np.stack([np.full(y.size, x), y.ravel(), z.ravel()], axis=1))

    assert (p_at(wall_x) > 0.5).all()
    for x in np.arange(offset[0] + 0.5, wall_x - 0.2, 0.1):
        assert (p_at(x) < 0.5).all()
    assert np.isnan(p_at(wall_x + 0.35)).all()
    # Behind the surface p falls to the prior from above, and many rays add up what little they claim there.
    claimed = grid.occupied_centres(0.6)
    assert len(claimed) > 100
    reach_m = REACH_BEHIND_SIGMAS * depth_m**2 * 0.05 / CAMERA.focal_baseline_px_m
    assert np.abs(claimed[:, 0] - wall_x).max() < (
        0.51 * grid.cell_m + reach_m if fusion == "cell" else 3 * grid.cell_m
    )


@pytest.mark.parametrize("pitch_deg", [0, 10])
@given(offset=st.floats(0, 1), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=8, deadline=None, derandomize=True)
def test_a_floor_seen_at_a_grazing_angle_stays_where_it_is(pitch_deg, offset, seed):
    # An eighth of the street camera's pixels; a camera 1.65 m above the ground, as there.
    camera = StereoCamera(focal_px=90, cx_px=79.5, cy_px=23.5, baseline_m=0.54, width_px=160, height_px=48)
    rng = np.random.default_rng(seed)
    cell_m, height_m = 0.2, 1.65
    grid = OccupancyGrid(cell_m, model=SensorModel(max_range_m=12))
    a = np.deg2rad(pitch_deg)
    down = np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])
    path_m = np.array([[0.5 * n, 0, height_m + offset * cell_m] for n in range(25)])
    for at in path_m:
        pose = from_rotation(R_BASE_OPTICAL @ down, at)
        seen = ground_disparity(camera, pose, offset * cell_m, sigma_px=0.15, rng=rng)
        grid.integrate(camera, seen, pose)
    measured = camera_height(grid, path_m)
    assert measured.n > 500
    # The cell that holds the plane, or its neighbour where the plane lies within the noise of their border: at 12 m,
    # the noise of .15 px is so much of the height.
    noise_m = height_m * 0.15 / camera.disparity_px(12.0)
    assert measured.value == pytest.approx(height_m, abs=0.5 * cell_m + noise_m)


# Fusion


def test_one_update_a_cell_or_one_a_ray_is_the_same_where_one_ray_crosses_a_cell():
    # The only match looks along x through the middles of cells; a pixel is narrower than a cell up to 6 m.
    camera = replace(CAMERA, cx_px=40, cy_px=30)
    d = np.full(camera.shape, np.nan, np.float32)
    d[30, 40] = camera.focal_baseline_px_m / 2
    pose = FORWARD.copy()
    pose[:3, 3] = 0.05
    grids = [empty(fusion=fusion) for fusion in FUSIONS]
    for grid in grids:
        # Of this width the last cell that the ray enters is the last whose centre is within the reach.
        grid.integrate(camera, Disparity(d, np.float32(0.12)), pose)
    cell, rays = (contents(grid) for grid in grids)
    assert len(rays[0]) > 15
    # The cells beside the ray have the pixel in their footprints too; those on it learn the same.
    learnt = dict(zip(map(tuple, cell[0].tolist()), cell[1].tolist(), strict=True))
    # A ray enters its last cell where the cell's centre may be past the reach.
    on_ray = [learnt.get(tuple(each), np.nan) for each in rays[0].tolist()]
    np.testing.assert_allclose(on_ray[:-1], rays[1][:-1], atol=0.01)


def test_the_sum_of_rays_counts_every_ray_through_a_near_cell():
    pose = FORWARD.copy()
    pose[:3, 3] = 0.013, 0.021, 0.034
    # What an observation may add ends at 128 nat: more than 600 rays of this p_free.
    model = replace(MODEL, p_free=0.45)
    cell, rays = (mapped([pose], [wall(2.5)], fusion=fusion, clamp=None, model=model) for fusion in FUSIONS)
    gain = float(log_odds(0.45))
    cells, values, _ = contents(rays)
    depths = (cells[:, 0] + 0.5) * rays.cell_m - pose[0, 3]
    free = (depths > 0.4) & (depths < 1.5)
    k = values[free] / gain
    np.testing.assert_allclose(k, np.round(k), atol=0.6 / ONE / abs(gain))
    near = free & (depths < 0.5) & (np.abs(cells[:, 1:]) <= 1).all(axis=1)
    # A cell of 0.1 m at 0.45 m covers (60 px 0.1 / 0.45)^2 pixels, about 180.
    assert (values[near] / gain).min() > 120
    assert np.nanmin(cell.blocks.known()[1]) == pytest.approx(gain, abs=0.6 / ONE)
    # Every ray that is not cut off crosses each plane x = const once.
    assert (values[free & (cells[:, 0] == 9)] / gain).sum() > CAMERA.width_px * CAMERA.height_px


@pytest.mark.parametrize("clamp", [0.5, 2.0, None])
@pytest.mark.parametrize("fusion", FUSIONS)
def test_log_odds_stay_within_the_clamp_and_without_one_they_grow(fusion, clamp):
    grid = mapped([FORWARD] * 8, [wall(2.0)] * 8, fusion=fusion, clamp=clamp)
    _, values, counts = contents(grid)
    if clamp is None:
        assert values.max() > 4
        assert values.min() < -4
        assert np.isclose(values.min(), 8 * FREE_GAIN, atol=1e-5) or fusion == "sum_of_rays"
    else:
        assert values.max() == np.float32(clamp)
        assert values.min() == -np.float32(clamp)
    assert counts.max() == 8


def test_a_clamped_cell_answers_to_new_evidence_at_once():
    grid = mapped([FORWARD] * 30, [wall(2.0)] * 30, clamp=2.0)
    hit = np.array([[2.0, 0.05, 0.05]])
    before = grid.probability(hit)
    for _ in range(3):
        grid.integrate(CAMERA, no_disparity(), FORWARD)
    assert grid.probability(hit) == before
    for _ in range(3):
        grid.integrate(CAMERA, wall(2.9), FORWARD)
    assert grid.probability(hit) < 0.5 < before


# The sensor model's options


@given(prior=st.floats(0.35, 0.85), fusion=st.sampled_from(sorted(FUSIONS)))
@settings(max_examples=10, deadline=None, derandomize=True)
def test_after_one_reading_a_free_cell_has_the_readings_probability_whatever_the_prior(prior, fusion):
    camera = replace(CAMERA, cx_px=40, cy_px=30)
    d = np.full(camera.shape, np.nan, np.float32)
    d[30, 40] = camera.focal_baseline_px_m / 2
    pose = FORWARD.copy()
    pose[:3, 3] = 0.05
    grid = empty(model=replace(MODEL, prior=prior), fusion=fusion)
    grid.integrate(camera, Disparity(d, np.float32(0.1)), pose)
    free, hit = grid.probability([[1.05, 0.05, 0.05], [2.05, 0.05, 0.05]])
    # Rounded to 1 / 256 nat.
    assert free == pytest.approx(MODEL.p_free, abs=1e-3)
    assert prior < hit <= MODEL.p_occupied + 1e-3


@given(seed=seeds, eps_m=st.tuples(st.floats(0, 0.4), st.floats(0, 0.4)))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_a_larger_motion_error_claims_less_at_the_surface_and_nowhere_more(seed, eps_m):
    pose = random_pose(np.random.default_rng(seed))
    grids = []
    for eps in sorted(eps_m):
        grids.append(empty())
        grids[-1].integrate(CAMERA, wall(1.7), pose, motion_sigma_m=eps)
    sure, unsure = grids
    hits = transform(pose, CAMERA.ray_directions[5:-5:9, 5:-5:9].reshape(-1, 3) * 1.7)
    assert (unsure.probability(hits) <= sure.probability(hits) + 1e-6).all()
    (_, p_sure), (_, p_unsure) = sure.known_cells(), unsure.known_cells()
    assert p_unsure.max() <= p_sure.max() + 1e-6
    assert p_unsure.min() >= MODEL.p_free - 1e-6
    assert (p_unsure < 0.31).sum() <= (p_sure < 0.31).sum()


def test_a_motion_error_of_half_a_metre_leaves_little_of_a_hit():
    certain, lost = empty(), empty()
    certain.integrate(CAMERA, wall(1.65), FORWARD)
    lost.integrate(CAMERA, wall(1.65), FORWARD, motion_sigma_m=0.5)
    hit = [[1.65, 0.05, 0.05]]
    assert certain.probability(hit) > 0.7
    assert 0.5 < lost.probability(hit) < 0.6


@given(seed=seeds, eps_m=st.floats(0, 1))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_the_linear_sum_is_never_narrower_than_the_root_of_squares(seed, eps_m):
    rng = np.random.default_rng(seed)
    d, sigma = rng.uniform(0.5, 30, 50), rng.uniform(0.05, 2, 50)
    linear, rss = (widened_sigma_px(CAMERA, d, sigma, motion_sigma_m=eps_m, motion_rule=m) for m in ("linear", "rss"))
    assert (linear >= rss * (1 - 1e-12)).all()
    assert (rss >= np.maximum(sigma, eps_m * d**2 / CAMERA.focal_baseline_px_m) * (1 - 1e-12)).all()


def test_the_linear_rule_of_the_motion_error_claims_less_at_the_surface():
    linear, rss = empty(), empty()
    for grid, rule in ((linear, "linear"), (rss, "rss")):
        grid.integrate(CAMERA, wall(1.7, 0.3), FORWARD, motion_sigma_m=0.1, motion_rule=rule)
    hit = [[1.7, 0.05, 0.05]]
    assert linear.probability(hit) < rss.probability(hit)
