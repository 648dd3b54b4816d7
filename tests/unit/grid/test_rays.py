"""Rays through the map against an oracle that sorts a ray's crossings with all planes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid, State
from stereogrid.grid import rays as rays_module

from .maps import every_cell, filled, known, random_map
from .scenes import CAMERA, FORWARD, mapped, random_pose, wall

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=10, deadline=None, derandomize=True)


def oracle(held, cell_m, origin, direction, longest_m, *, p_occupied, unknown_stops):
    """(end [m], cell, state): the cell of the origin, then those that hold the middles between crossings."""
    o, d = np.array(origin) / cell_m, np.array(direction) / np.linalg.norm(direction)
    longest = longest_m / cell_m
    crossings = [np.array([0.0, longest])]
    for axis in range(3):
        if d[axis]:
            a, b = sorted((o[axis], o[axis] + d[axis] * longest))
            at = (np.arange(np.floor(a) - 1, np.ceil(b) + 2) - o[axis]) / d[axis]
            crossings.append(at[(at > 0) & (at < longest)])
    edges = np.unique(np.concatenate(crossings))
    middles = (edges[:-1] + edges[1:]) / 2
    cells = np.vstack([np.floor(o), np.floor(o + middles[:, None] * d)]).astype(int)
    for entry, cell in zip(np.concatenate([[0.0], edges[:-1]]), cells.tolist(), strict=True):
        p = held.get(tuple(cell))
        if p is not None and p > p_occupied:
            return entry * cell_m, cell, State.OCCUPIED
        if p is None and unknown_stops:
            return entry * cell_m, cell, State.UNKNOWN
    return longest_m, cells[-1].tolist(), State.UNKNOWN if p is None else State.FREE


def assert_as_the_oracle(grid, origins, directions, longest_m, **options):
    options = {"p_occupied": 0.5, "unknown_stops": False, **options}
    hits, held = grid.first_hit(origins, directions, longest_m, **options), known(grid)
    expected = [oracle(held, grid.cell_m, o, d, longest_m, **options) for o, d in zip(origins, directions, strict=True)]
    ends, cells, states = zip(*expected, strict=True)
    np.testing.assert_array_equal(hits.state, states)
    np.testing.assert_array_equal(hits.cell, cells)
    np.testing.assert_allclose(hits.end_m, ends, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(np.isfinite(hits.range_m), hits.state == State.OCCUPIED)
    return hits


@given(
    seed=seeds,
    cell_m=st.sampled_from([0.25, 0.1]),
    unknown_stops=st.booleans(),
    p_occupied=st.sampled_from([0.5, 0.8, 0.0]),
    share_occupied=st.sampled_from([0.02, 0.3]),
)
@few
def test_rays_from_anywhere_end_where_the_oracle_says(seed, cell_m, unknown_stops, p_occupied, share_occupied):
    grid = random_map(seed, cell_m=cell_m, share_occupied=share_occupied, share_known=0.4)
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-24, 24, (100, 3)) * cell_m
    directions = rng.normal(size=(100, 3)) * rng.uniform(1e-3, 1e3, (100, 1))
    hits = assert_as_the_oracle(
        grid, origins, directions, 40 * cell_m, unknown_stops=unknown_stops, p_occupied=p_occupied
    )
    assert unknown_stops or len(np.unique(hits.state)) > 1


@given(seed=seeds, unknown_stops=st.booleans())
@few
def test_rays_along_axes_and_diagonals_from_boundaries_and_corners_are_exact(seed, unknown_stops):
    grid = random_map(seed, share_occupied=0.05, share_known=0.5)
    rng = np.random.default_rng(seed)
    origins = rng.integers(-40, 40, (150, 3)) * 0.125
    directions = rng.integers(-1, 2, (150, 3)).astype(float)
    directions[(directions == 0).all(axis=1)] = [0, -1, 0]
    assert_as_the_oracle(grid, origins, directions, 7.3, unknown_stops=unknown_stops)


def test_a_ray_through_an_edge_goes_straight_to_the_cell_beyond():
    beside = [[1, 0, 0], [0, 1, 0]]
    grid = filled([*beside, [1, 1, 0]], [2.0, 2.0, 2.0])
    hit = grid.first_hit([0.125, 0.125, 0.1], [[1, 1, 0]], 5.0)
    assert hit.cell.tolist() == [[1, 1, 0]]
    np.testing.assert_allclose(hit.range_m, np.hypot(0.125, 0.125))
    assert np.isinf(filled(beside, 2.0).first_hit([0.125, 0.125, 0.1], [[1, 1, 0]], 5.0).range_m).all()


@given(seed=seeds)
@few
def test_a_ray_that_starts_in_an_occupied_cell_hits_at_once_whichever_way_it_goes(seed):
    grid, rng = random_map(seed), np.random.default_rng(seed)
    centres = grid.occupied_centres()
    origins = centres + rng.choice([-0.125, 0, 0.1], centres.shape)
    directions = rng.integers(-3, 4, origins.shape) + np.array([0, 0, 0.5])
    hits = grid.first_hit(origins, directions, 3.0)
    assert not hits.range_m.any()
    np.testing.assert_array_equal(hits.cell, np.floor(origins / 0.25))


def test_a_surface_at_the_largest_range_still_counts_and_one_behind_it_does_not():
    grid = filled([[4, 0, 0]], 2.0)
    ray = [[0.0, 0.1, 0.1]], [[2.0, 0, 0]]
    assert grid.first_hit(*ray, 1.0).range_m == 1.0
    missed = grid.first_hit(*ray, 0.999)
    assert (missed.range_m, missed.end_m, missed.state) == (np.inf, 0.999, State.UNKNOWN)


def test_rays_from_far_away_enter_the_map_where_they_must():
    grid = filled(every_cell([0, 0, 0], [4, 4, 4]), 2.0)
    origins = [[1e6, 0.5, 0.5], [-1e6, 0.3, 0.3], [0.5, 0.5, 1e6], [1e6, 5, 5]]
    hits = grid.first_hit(origins, [[-1, 0, 0], [1, 0, 0], [0, 0, -1], [-1, 0, 0]], 2e6)
    np.testing.assert_array_equal(hits.range_m, [1e6 - 1, 1e6, 1e6 - 1, np.inf])


def test_rays_in_an_empty_map_end_at_their_largest_range_in_the_unknown():
    hits = OccupancyGrid(0.1).first_hit(np.zeros((2, 3)), [[1, 0, 0], [0, -1, 0]], 1.05)
    assert hits.cell.tolist() == [[10, 0, 0], [0, -11, 0]]
    assert (hits.state == State.UNKNOWN).all()
    assert (hits.end_m == 1.05).all()
    at_once = OccupancyGrid(0.1).first_hit(np.zeros(3), [[1, 0, 0]], 1.05, unknown_stops=True)
    assert at_once.end_m == 0
    assert grid_without_rays().end_m.shape == (0,)


def grid_without_rays():
    return random_map(0).first_hit(np.empty((0, 3)), np.empty((0, 3)), 1.0)


@pytest.mark.filterwarnings("error")
def test_directions_of_any_length_mean_the_same_and_tiny_components_do_no_harm():
    grid = random_map(3)
    d = np.random.default_rng(3).normal(size=(50, 3))
    ranges = grid.first_hit(np.full(3, 0.1), d, 6.0).range_m
    for scale in (1e-250, 1e250):
        np.testing.assert_allclose(grid.first_hit(np.full(3, 0.1), d * scale, 6.0).range_m, ranges, rtol=1e-12)
    axis = grid.first_hit([[0, 0.1, 0.1]], [[1, 0, 0]], 6.0)
    tiny = grid.first_hit([[0, 0.1, 0.1]], [[1, 1e-320, -1e-200]], 6.0)
    assert (axis.end_m, axis.cell.tolist()) == (tiny.end_m, tiny.cell.tolist())


def test_the_answer_does_not_depend_on_how_many_threads_share_the_work(monkeypatch):
    grid, rng = random_map(5), np.random.default_rng(5)
    rays = rng.uniform(-4, 4, (997, 3)), rng.normal(size=(997, 3))
    alone = grid.first_hit(*rays, 6.0)
    monkeypatch.setattr(rays_module, "RAYS_PER_JOB", 10)
    shared = grid.first_hit(*rays, 6.0)
    for name in ("end_m", "cell", "state"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(shared, name))


@pytest.mark.parametrize(
    ("origins", "directions", "max_range_m", "message"),
    [
        (np.zeros((1, 3)), [[0, 0, 0]], 1, "direction of ray 0 is zero"),
        (np.zeros((1, 3)), [[np.nan, 0, 1]], 1, "NaN"),
        ([[np.inf, 0, 0]], [[1, 0, 0]], 1, "infinity"),
        (np.zeros((2, 3)), [[1, 0, 0]], 1, r"\(N, 3\)"),
        (np.zeros(3), [1, 0, 0], 1, r"\(N, 3\)"),
        (np.zeros(3), [[1, 0, 0]], 0, "max_range_m"),
        (np.zeros(3), [[1, 0, 0]], np.inf, "max_range_m"),
        (np.zeros(3), [[1, 0, 0]], np.nan, "max_range_m"),
        (np.full(3, 1e12), [[1, 0, 0]], 1, "too far"),
    ],
)
def test_rays_that_cannot_be_meant_are_refused(origins, directions, max_range_m, message):
    with pytest.raises(InvalidInputError, match=message):
        random_map(0).first_hit(origins, directions, max_range_m)


# Depth images


@given(depth_m=st.floats(0.6, 2.7), seed=seeds)
@few
def test_a_mapped_wall_is_seen_at_its_depth_to_within_a_cell(depth_m, seed):
    pose = random_pose(np.random.default_rng(seed))
    grid = mapped([pose], [wall(depth_m, 0.01)])
    depth = grid.depth_image(CAMERA, pose, 5.0)
    assert depth.dtype == np.float32
    assert depth.shape == CAMERA.shape
    within = slice(4, -4), slice(4, -4)
    in_range = depth_m * np.linalg.norm(CAMERA.ray_directions, axis=-1) < 2.9
    seen = depth[within][in_range[within]]
    assert np.isfinite(seen).mean() > 0.97
    # A cell is entered by its near faces: up to its diagonal before the point that made it occupied.
    assert np.nanmedian(np.abs(seen - depth_m)) < grid.cell_m
    assert np.nanmax(np.abs(seen - depth_m)) < 2 * grid.cell_m


def test_the_depth_image_is_the_first_hit_of_each_pixels_ray_and_nan_elsewhere():
    camera = StereoCamera(focal_px=20, cx_px=11.5, cy_px=7.5, baseline_m=0.1, width_px=24, height_px=16)
    grid = random_map(8, share_occupied=0.05)
    for unknown_stops in (False, True):
        pose = from_rotation(R_BASE_OPTICAL, (-1.1, 0.2, 0.3))
        depth = grid.depth_image(camera, pose, 4.0, unknown_stops=unknown_stops)
        rays = camera.ray_directions.reshape(-1, 3)
        hits = grid.first_hit(pose[:3, 3], rays @ pose[:3, :3].T, 4.0, unknown_stops=unknown_stops)
        points = np.where(np.isfinite(hits.range_m), hits.range_m, np.nan)[:, None] * rays
        points /= np.linalg.norm(rays, axis=1, keepdims=True)
        np.testing.assert_allclose(depth.ravel(), points[:, 2], rtol=1e-6)
    assert np.isnan(OccupancyGrid(0.1).depth_image(camera, FORWARD, 4.0)).all()
