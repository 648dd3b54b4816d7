"""The sweep and its pyramid agree with their NumPy twins, and keep what a map must not lose."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.geometry import transform
from stereogrid.grid import OccupancyGrid, fusion, pyramid
from stereogrid.grid.blocks import BLOCK, CELLS
from stereogrid.grid.cells import LARGEST_EVIDENCE, NOTHING, ONE
from stereogrid.grid.fusion import View
from stereogrid.observation import Disparity
from stereogrid.sensor_model import LOOKS_EXPONENT, REACH_BEHIND_SIGMAS, SensorModel, log_odds, reach_behind

from . import twins
from .scenes import CAMERA, FORWARD, constant_disparity, contents, random_disparity, random_pose, wall

SMALL = StereoCamera(focal_px=45, cx_px=18.3, cy_px=13.1, baseline_m=0.12, width_px=37, height_px=27)
seeds = st.integers(0, 2**32 - 1)
lengths = st.sampled_from([1.0, 2.5, 7.0, np.inf])
models = st.builds(
    SensorModel,
    p_free=st.floats(0.05, 0.19),
    p_occupied=st.floats(0.81, 0.98),
    prior=st.floats(0.2, 0.8),
    max_range_m=st.floats(0.8, 3.0),
)
rules = st.sampled_from(["rss", "linear"])


def seen(seed, correlation_px, camera=SMALL):
    rng = np.random.default_rng(seed)
    disparity = replace(random_disparity(rng, camera), correlation_px=correlation_px)
    return disparity, random_pose(rng, spread_m=20.0)


def all_cells(learnt):
    """Cells (N, 3) and evidence (N,) int16 of the blocks that learnt something."""
    within = np.stack(np.unravel_index(np.arange(CELLS), (BLOCK, BLOCK, BLOCK)), axis=-1)
    evidence = np.full((len(learnt.blocks), CELLS), NOTHING, dtype=np.int16)
    evidence[learnt.free] = learnt.free_evidence[learnt.free, None]
    evidence[learnt.judged] = learnt.evidence[learnt.judged]
    cells = (learnt.blocks * BLOCK)[:, None] + within
    return cells.reshape(-1, 3), evidence.ravel()


def twin_readings(disparity, model, eps_m, camera=SMALL, motion_rule="rss"):
    found = twins.levels(
        disparity.disparity_px,
        disparity.sigma_px,
        camera.focal_px,
        gate_sigmas=pyramid.GATE_SIGMAS,
        steepest=pyramid.STEEPEST,
    )
    options = {"correlation_px": disparity.correlation_px, "eps_m": eps_m, "relief_of_noise": pyramid.RELIEF_OF_NOISE}
    options |= {"least_certainty": pyramid.LEAST_CERTAINTY, "motion_rule": motion_rule}
    return [twins.readings(level, camera, model, **options) for level in found]


@given(seed=seeds, correlation_px=lengths, model=models, eps_m=st.sampled_from([0.0, 0.05]), rule=rules)
@settings(max_examples=20, deadline=None, derandomize=True)
def test_the_pyramid_agrees_with_its_twin(seed, correlation_px, model, eps_m, rule):
    disparity, _ = seen(seed, correlation_px)
    made = pyramid.Pyramid.of(SMALL, disparity, model, motion_sigma_m=eps_m, motion_rule=rule)
    expected = twin_readings(disparity, model, eps_m, motion_rule=rule)
    assert len(expected) == len(made.layout)
    halves = made.nodes.view(np.int32)[:, 1]
    q, r = ((bits.astype(np.int32)).view(np.float32) for bits in (halves & -65536, halves << 16))
    for (first, h, w), (d, width, relief) in zip(made.layout, expected, strict=True):
        level = slice(first, first + h * w)
        found = made.nodes[level, 0].reshape(h, w)
        np.testing.assert_array_equal(found > 0, ~np.isnan(d))
        np.testing.assert_allclose(found[found > 0], d[found > 0], rtol=1e-5)
        # One step of bfloat16 where float32 and float64 round apart.
        valid = found > 0
        np.testing.assert_allclose(found[valid] / q[level].reshape(h, w)[valid], width[valid], rtol=0.009)
        ratio, expected_ratio = r[level].reshape(h, w)[found > 0], (relief / width)[found > 0]
        np.testing.assert_allclose(ratio, expected_ratio, rtol=0.02, atol=0.02)


@given(seed=seeds, correlation_px=lengths, model=models, eps_m=st.sampled_from([0.0, 0.05]))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_the_sweep_agrees_with_its_twin(seed, correlation_px, model, eps_m):
    disparity, pose = seen(seed, correlation_px)
    cells, evidence = all_cells(fusion.sweep(View(SMALL, disparity, pose, 0.09, model, eps_m), 1))
    expected = twins.sweep(
        cells,
        SMALL,
        pose,
        twin_readings(disparity, model, eps_m),
        model,
        cell_m=0.09,
        correlation_px=correlation_px,
        exponent=LOOKS_EXPONENT,
        reach_behind=REACH_BEHIND_SIGMAS,
    )
    learnt, known = evidence != NOTHING, ~np.isnan(expected)
    # Cells on an edge (of the image, of a node, of the reach) fall to either side in float32.
    assert np.mean(learnt != known) < 2e-3
    both = learnt & known
    assert both.sum() > 50
    off = np.abs(evidence[both] / ONE - np.clip(expected[both], -128, 128))
    assert np.median(off) < 0.01
    assert np.mean(off > 0.03 + 0.02 * np.abs(expected[both])) < 1e-2


@given(seed=seeds, correlation_px=lengths, threads=st.integers(2, 5))
@settings(max_examples=10, deadline=None, derandomize=True)
def test_the_map_does_not_depend_on_the_number_of_threads(seed, correlation_px, threads):
    disparity, pose = seen(seed, correlation_px, CAMERA)
    grids = [OccupancyGrid(0.04, model=SensorModel(max_range_m=3.0), threads=n) for n in (1, threads)]
    for grid in grids:
        grid.integrate(CAMERA, disparity, pose)
    assert grids[0].sha256() == grids[1].sha256()
    assert grids[0].n_known > 10_000


@given(seed=seeds, correlation_px=lengths)
@settings(max_examples=15, deadline=None, derandomize=True)
def test_blocks_that_are_free_in_bulk_hold_what_their_cells_would_learn_one_by_one(seed, correlation_px):
    # A wall far off, with holes: many blocks are free as wholes.
    rng = np.random.default_rng(seed)
    d = np.full(CAMERA.shape, CAMERA.focal_baseline_px_m / 2.9, np.float32)
    d[rng.random(CAMERA.shape) < 0.1] = np.nan
    disparity = Disparity(d, np.float32(0.02), correlation_px)
    model = SensorModel(max_range_m=3.0)
    pose = random_pose(rng)
    learnt = fusion.sweep(View(CAMERA, disparity, pose, 0.03, model), 1)
    assert learnt.free.sum() > 20
    expected = twins.sweep(
        (learnt.blocks[learnt.free][:, None] * BLOCK + [[0, 0, 0], [7, 7, 7], [3, 4, 5]]).reshape(-1, 3),
        CAMERA,
        pose,
        twin_readings(disparity, model, 0.0, CAMERA),
        model,
        cell_m=0.03,
        correlation_px=correlation_px,
        exponent=LOOKS_EXPONENT,
        reach_behind=REACH_BEHIND_SIGMAS,
    ).reshape(-1, 3)
    np.testing.assert_allclose(learnt.free_evidence[learnt.free] / ONE, expected.mean(axis=1), atol=0.006)
    # At the reach Phi is 2e-4, not 0, and the ratio of a hit 27 times that of free space.
    assert np.ptp(expected, axis=1).max() < 2 * 27 * 2.3e-4


# How many looks a footprint is worth


@pytest.mark.parametrize("depth_m", [0.8, 1.6])
def test_independent_pixels_narrow_the_reading_by_the_root_of_their_number(depth_m):
    d_px = CAMERA.focal_baseline_px_m / depth_m
    for correlation_px in (1.0, 4.0):
        disparity = replace(wall(depth_m, 0.4), correlation_px=correlation_px)
        made = pyramid.Pyramid.of(CAMERA, disparity, SensorModel())
        q = (made.nodes.view(np.int32)[:, 1] & -65536).astype(np.int32).view(np.float32)
        for level, (first, _, _) in enumerate(made.layout):
            looks = max(1.0, 4**level / correlation_px**2)
            assert d_px / q[first] == pytest.approx(0.4 / np.sqrt(looks), rel=0.005)


def test_a_pixel_of_one_look_and_an_infinite_length_give_what_one_reading_gives():
    # At 2.9 m a cell of 0.1 m is 2 px wide: one reading of the wall's depth, whatever the footprint.
    grid = OccupancyGrid(0.1, model=SensorModel(max_range_m=3.2))
    grid.integrate(CAMERA, wall(2.0, 0.3), FORWARD)
    cells, values, _ = contents(grid)
    centre = transform(np.linalg.inv(FORWARD), (cells + 0.5) * 0.1)
    inner = np.abs(centre[:, :2]).max(axis=1) < 0.3
    ranges = np.linalg.norm(centre, axis=1)
    measured = 2.0 * ranges / centre[:, 2]
    expected = twins.gain(
        ranges, measured, measured * 0.3 / (CAMERA.focal_baseline_px_m / 2.0), 0.1, (0.25, 0.9, 0.5, False)
    )
    assert inner.sum() > 200
    np.testing.assert_allclose(values[inner], expected[inner], atol=0.03)


@given(correlation_px=st.floats(1, 30))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_free_space_gains_its_log_odds_times_the_looks_to_the_power_that_is_stated(correlation_px):
    learnt = fusion.sweep(
        View(CAMERA, replace(wall(2.8, 0.05), correlation_px=correlation_px), FORWARD, 0.05, SensorModel()), 1
    )
    cells, evidence = all_cells(learnt)
    # 0.625 m away a cell is 4.8 px wide: it reads nodes of 4 px, and 2 x 4^2 pixels are its footprint.
    near = (cells == [12, 0, 0]).all(axis=1)
    looks = max(1.0, 2 * 4**2 / correlation_px**2)
    free = log_odds(SensorModel().p_free)
    assert evidence[near] / ONE == pytest.approx(free * looks**LOOKS_EXPONENT, abs=0.003)


# What must not be lost


def test_a_pole_of_a_third_of_a_cell_survives_in_front_of_a_far_wall():
    camera = StereoCamera(focal_px=386, cx_px=159.5, cy_px=119.5, baseline_m=0.06, width_px=320, height_px=240)
    rng = np.random.default_rng(5)
    grid = OccupancyGrid(0.05, model=SensorModel(max_range_m=8.0))
    for n in range(12):
        x = 0.1 * n
        pose = FORWARD.copy()
        pose[:3, 3] = x, 0.01, 1.02
        d = np.full(camera.shape, camera.focal_baseline_px_m / (7.0 - x))
        # 2 cm wide, 3 m ahead of the first camera and a little to its left.
        centre = camera.cx_px - camera.focal_px * (0.32 - 0.01) / (3.0 - x)
        half_px = camera.focal_px * 0.01 / (3.0 - x)
        columns = np.arange(camera.width_px)
        d[:, np.abs(columns - centre) <= half_px] = camera.focal_baseline_px_m / (3.0 - x)
        d += rng.normal(0, 0.25, d.shape)
        grid.integrate(camera, Disparity(d.astype(np.float32), np.float32(0.25), 1.0), pose)
    heights = np.arange(0.825, 1.2, 0.05)
    pole = np.stack([np.full(len(heights), 3.0), np.full(len(heights), 0.32), heights], axis=1)
    p = (
        np.nan_to_num(grid.probability(pole - [0.025, 0, 0])),
        np.nan_to_num(grid.probability(pole + np.array([0.025, 0, 0]))),
    )
    assert (np.maximum(*p) > 0.5).mean() > 0.8
    beside = grid.probability(pole + np.array([0.0, 0.15, 0.0]))
    assert (beside < 0.5).all()


@pytest.mark.parametrize("cell_m", [0.05, 0.1, 0.2])
def test_coarse_cells_keep_the_surface_that_passes_through_any_part_of_them(cell_m):
    rng = np.random.default_rng(2)
    grid = OccupancyGrid(cell_m, model=SensorModel(max_range_m=3.0))
    for _ in range(6):
        offset = rng.uniform(-0.02, 0.02, 3)
        pose = FORWARD.copy()
        pose[:3, 3] = offset
        grid.integrate(CAMERA, wall(2.03 - offset[0], 0.1), pose)
    y, z = np.meshgrid(np.arange(-0.6, 0.61, cell_m), np.arange(-0.5, 0.51, cell_m))
    on_wall = np.stack([np.full(y.size, 2.03), y.ravel() + 0.001, z.ravel() + 0.001], axis=1)
    assert (grid.probability(on_wall) > 0.5).all()


def test_evidence_is_cut_off_where_its_type_ends():
    sure = SensorModel(p_free=1e-6, p_occupied=1 - 1e-6)
    disparity = Disparity(constant_disparity(4.0, 0.05).disparity_px, np.float32(0.05), 1.0)
    _, evidence = all_cells(fusion.sweep(View(CAMERA, disparity, FORWARD, 0.5, sure), 1))
    assert evidence[evidence != NOTHING].min() >= -LARGEST_EVIDENCE


@pytest.mark.parametrize("form", ["corrected", "printed"])
def test_each_form_reaches_as_far_behind_as_it_says(form):
    model = SensorModel(form=form, max_range_m=4.0)
    grid = OccupancyGrid(0.02, model=model)
    grid.integrate(CAMERA, wall(1.5, 0.2), FORWARD)
    cells, _, _ = contents(grid)
    sigma_m = 1.5**2 * 0.2 / CAMERA.focal_baseline_px_m
    farthest = (cells[:, 0].max() + 0.5) * 0.02
    assert farthest == pytest.approx(1.5 + reach_behind(model) * sigma_m, abs=0.03)


@given(seed=seeds, cell_m=st.sampled_from([0.001, 0.07, 3.0]), correlation_px=lengths)
@settings(max_examples=25, deadline=None, derandomize=True)
def test_extreme_but_finite_readings_leave_a_sound_map(seed, cell_m, correlation_px):
    rng = np.random.default_rng(seed)
    size = rng.integers(2, 12, 2)
    focal_px = 10.0 ** rng.uniform(-2, 5)
    camera = StereoCamera(focal_px, *rng.uniform(-50, 50, 2), 10.0 ** rng.uniform(-3, 3), int(size[0]), int(size[1]))
    d = (10.0 ** rng.uniform(-37, 37, camera.shape)).astype(np.float32)
    sigma = (10.0 ** rng.uniform(-37, 37, camera.shape)).astype(np.float32)
    d[rng.random(camera.shape) < 0.3] = np.nan
    grid = OccupancyGrid(cell_m, model=SensorModel(max_range_m=min(20 * cell_m, 5.0)), memory_limit_gb=1e9)
    box = 20 * cell_m
    for pose in (FORWARD, random_pose(rng, spread_m=box)):
        grid.integrate(camera, Disparity(d, sigma, correlation_px), pose, motion_sigma_m=10.0 ** rng.uniform(-9, 9))
    _, values, counts = contents(grid)
    assert np.isfinite(values).all()
    assert set(counts.tolist()) <= {1, 2}
