"""Each kernel against a twin written in NumPy, another way where there is one."""

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from stereogrid.scoring import kernels

SEEDS = st.integers(0, 2**32 - 1)


def met_by_separating_axes(triangle, shape, half):
    """Which cubes of (nx, ny, nz) cells meet a triangle (3, 3): all 13 axes on all cells at once."""
    centres = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1) + 0.5
    edges = np.roll(triangle, -1, axis=0) - triangle
    axes = [*np.eye(3), np.cross(edges[0], edges[1])]
    axes += [np.cross(unit, edge) for unit, edge in product(np.eye(3), edges)]
    met = np.ones(shape, dtype=bool)
    for axis in axes:
        offset = (triangle @ axis)[:, None, None, None] - centres @ axis
        reach = half * np.abs(axis).sum()
        met &= (offset.min(axis=0) <= reach) & (offset.max(axis=0) >= -reach)
    return met


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_met_cells_are_those_that_no_axis_separates(seed):
    triangles = np.random.default_rng(seed).uniform(-2, 10, (3, 3, 3))
    met = np.zeros((8, 9, 7), dtype=bool)
    kernels.mark_met_cells(triangles, 0.5001, met)
    twin = np.any([met_by_separating_axes(t, met.shape, 0.5001) for t in triangles], axis=0)
    assert np.array_equal(met, twin)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_met_cells_are_those_that_samples_of_the_triangle_fall_in(seed):
    rng = np.random.default_rng(seed)
    triangle = rng.uniform(0, 6, (1, 3, 3))
    met = np.zeros((6, 6, 6), dtype=bool)
    kernels.mark_met_cells(triangle, 0.5, met)
    u, v = np.meshgrid(np.linspace(0, 1, 400), np.linspace(0, 1, 400))
    u, v = u[u + v <= 1], v[u + v <= 1]
    points = np.stack([1 - u - v, u, v], axis=1) @ triangle[0]
    sampled = np.zeros_like(met)
    sampled[tuple(np.clip(points, 0, 5.999).astype(int).T)] = True
    assert not (sampled & ~met).any()
    # Sampling misses a cell that the triangle only grazes; few are.
    assert (met & ~sampled).sum() <= 0.1 * met.sum() + 2


def enclosed_by_solid_angle(triangles, points):
    """Winding number of closed triangles (F, 3, 3) about points (N, 3), Van Oosterom and Strackee 1983."""
    a, b, c = (triangles[None] - points[:, None, None]).transpose(2, 0, 1, 3)
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    ab, bc, ca = (a * b).sum(-1), (b * c).sum(-1), (c * a).sum(-1)
    top = (a * np.cross(b, c)).sum(-1)
    angle = 2 * np.arctan2(top, la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.round(angle.sum(axis=1) / (4 * np.pi)) != 0


@given(SEEDS)
@settings(max_examples=40, deadline=None)
def test_crossings_enclose_the_centres_that_the_solid_angle_encloses(seed):
    corners = np.random.default_rng(seed).uniform(-1, 9, (4, 3))
    tetrahedron = corners[[[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]]
    flips = np.zeros((8, 8, 9), dtype=np.uint8)
    kernels.flip_above_crossings(tetrahedron, np.array([1e-5, 0.6e-5]), flips)
    enclosed = np.bitwise_xor.accumulate(flips[:, :, :-1], axis=2).astype(bool)
    centres = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5
    twin = enclosed_by_solid_angle(tetrahedron, centres + np.array([1e-5, 0.6e-5, 0]))
    assert np.array_equal(enclosed.ravel(), twin)


def distance_by_minimisation(point, triangle):
    """Distance to a triangle as a quadratic program over its barycentric coordinates."""
    a, b, c = triangle

    def squared(uv):
        return np.sum((a + uv[0] * (b - a) + uv[1] * (c - a) - point) ** 2)

    inside = {"type": "ineq", "fun": lambda uv: 1 - uv[0] - uv[1]}
    best = minimize(squared, [0.3, 0.3], bounds=[(0, 1)] * 2, constraints=[inside], options={"ftol": 1e-14})
    return np.sqrt(best.fun)


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_the_distance_to_a_triangle_is_the_least_over_its_points(seed):
    rng = np.random.default_rng(seed)
    triangles, points = rng.uniform(-1, 1, (2, 3, 3)), rng.uniform(-2, 2, (3, 3))
    distance = np.empty(3)
    kernels.distance_to_candidates(points, np.tile([0, 1, 1], (3, 1)), triangles, distance)
    twin = [min(distance_by_minimisation(p, t) for t in triangles) for p in points]
    assert np.allclose(distance, twin, atol=1e-4)


def test_a_triangle_without_area_is_a_segment():
    distance = np.empty(2)
    line = np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    points = np.array([[1.5, 3, 4], [5, 4, 0]])
    kernels.distance_to_candidates(points, np.zeros((2, 1), int), line, distance)
    assert np.allclose(distance, [5, 5])


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_the_inverse_depth_of_a_plane_is_interpolated_exactly(seed):
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:5, :6]
    slope_r, slope_c = rng.uniform(-0.01, 0.01, 2)
    image = 1 + slope_r * row + slope_c * column
    r, c = rng.uniform(0, 4), rng.uniform(0, 5)
    assert np.isclose(kernels.inverse_depth_at(image, c, r), 1 + slope_r * r + slope_c * c)


def test_across_an_edge_the_nearest_ray_decides():
    image = np.array([[1.0, 0.2], [1.0, 0.2]])
    assert kernels.inverse_depth_at(image, 0.49, 0.3) == 1.0
    assert kernels.inverse_depth_at(image, 0.51, 0.3) == 0.2


def seen_in_numpy(cells, T_cam_cell, eyes, inverse_depths):
    """(nearest_m, in_view) of one pose, all cells at once, the nearest ray without interpolation."""
    solid, nearest_m, _ = cells
    index = np.stack(np.meshgrid(*map(np.arange, solid.shape), indexing="ij"), axis=-1)
    point = index @ T_cam_cell[:, :3].T + T_cam_cell[:, 3]
    z = np.where(point[..., 2] > 0, point[..., 2], np.nan)
    inside, clear = (np.linalg.norm(point, axis=-1) <= eyes.max_range_m) & np.isfinite(z), True
    for image, shift_m in zip(inverse_depths, (0.0, eyes.baseline_m), strict=True):
        x, y = point[..., 0] - shift_m, point[..., 1]
        column, row = eyes.focal_px * x / z + eyes.cx_px + 0.5, eyes.focal_px * y / z + eyes.cy_px + 0.5
        inside = inside & (column >= 0) & (column < eyes.width_px) & (row >= 0) & (row < eyes.height_px)
        c, r = (
            np.nan_to_num(np.where(inside, v, 0) / pitch + 0.5).astype(int)
            for v, pitch in ((column, eyes.pitch_x_px), (row, eyes.pitch_y_px))
        )
        clear = clear & (image[r, c] * z * (1 - eyes.slack_m / np.sqrt(x**2 + y**2 + z**2)) <= 1)
    seen = inside & clear & ~solid
    return np.where(seen, np.fmin(nearest_m, z), nearest_m), inside


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_seen_cells_are_those_of_the_twin(seed):
    rng = np.random.default_rng(seed)
    shape = (12, 11, 10)
    cells = rng.random(shape) < 0.1, np.full(shape, np.inf, np.float32), np.zeros(shape, bool)
    T = np.linalg.qr(rng.normal(size=(3, 3)))[0] * 0.3
    T_cam_cell = np.column_stack([T, -T @ rng.uniform(0, 10, 3)])
    eyes = kernels.Eyes(20.0, 15.5, 11.5, 0.2, 32.0, 24.0, 4.0, 4.0, 2.5, 0.2)
    # Near and far alternate as on a chessboard, so the nearest ray decides everywhere.
    near = np.indices((7, 9)).sum(axis=0) % 2 == 1
    left, right = (np.where(near, rng.uniform(0.6, 1.5, (7, 9)), rng.uniform(0.1, 0.5, (7, 9))) for _ in "lr")
    nearest_m, in_view = seen_in_numpy(cells, T_cam_cell, eyes, (left, right))
    kernels.see_cells(cells, np.array([[0, 0, 0], shape]), T_cam_cell, eyes, (left, right))
    assert np.array_equal(cells[1], nearest_m.astype(np.float32))
    assert np.array_equal(cells[2], in_view)
