"""An uncertain pose widens readings along their rays, and smears across them what all pixels of an image share."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_rotation, from_yaw, inverse, transform
from stereogrid.grid import FUSIONS, OccupancyGrid, marginal
from stereogrid.grid.blocks import BLOCK, CELLS
from stereogrid.grid.cells import NOTHING, ONE
from stereogrid.grid.fusion import View
from stereogrid.grid.pose_nodes import LEAST_CELLS, MOST_NODES, pose_nodes, quadrature
from stereogrid.grid.pyramid import Pyramid, eps_of_nodes, layout_of
from stereogrid.grid.sweep import FREE, JUDGED, SKIPPED
from stereogrid.observation import Disparity
from stereogrid.sensor_model import SensorModel, log_odds

from . import twins
from .scenes import CAMERA, FORWARD, MODEL, contents, empty, no_disparity, random_disparity, random_pose, wall

seeds = st.integers(0, 2**32 - 1)
CENTRED = StereoCamera(focal_px=60, cx_px=40, cy_px=30, baseline_m=0.1, width_px=81, height_px=61)
"""Its middle pixel looks along the optical axis."""


def covariance(position_m=(0, 0, 0), turn_rad=(0, 0, 0)):
    """Of independent errors along the axes of world."""
    return np.diag(np.square([*position_m, *turn_rad], dtype=float))


def random_covariance(rng, position_m=0.2, turn_rad=0.05):
    root = rng.standard_normal((6, 6)) * np.repeat([position_m, turn_rad], 3)[:, None] / np.sqrt(6)
    return root @ root.T


def fused(disparity, C=None, *, camera=CAMERA, pose=FORWARD, motion_sigma_m=0.0, weight=1.0, **options):
    grid = empty(**{"clamp": None, **options})
    grid.integrate(camera, disparity, pose, motion_sigma_m, pose_covariance=C, weight=weight)
    return grid


def evidence_of(grid):
    """{cell: log-odds} of all that the map knows."""
    cells, values, _ = contents(grid)
    return dict(zip(map(tuple, cells.tolist()), values.tolist(), strict=True))


# What must stay as it is


@pytest.mark.parametrize("fusion", FUSIONS)
@pytest.mark.parametrize("form", ["corrected", "printed"])
@pytest.mark.parametrize("weight", [1.0, 0.3])
def test_a_covariance_of_zero_gives_the_very_map_that_is_made_without(fusion, form, weight):
    rng = np.random.default_rng(1)
    pose, disparity = random_pose(rng), random_disparity(rng)
    options = {"pose": pose, "weight": weight, "fusion": fusion, "model": replace(MODEL, form=form)}
    exact, zero = (fused(disparity, C, motion_sigma_m=0.03, **options) for C in (None, np.zeros((6, 6))))
    assert exact.sha256() == zero.sha256()
    uncertain = fused(disparity, covariance([0.15] * 3, [0.03] * 3), **options)
    assert uncertain.sha256() != exact.sha256()


@given(seed=seeds, threads=st.integers(2, 5))
@settings(max_examples=6, deadline=None, derandomize=True)
def test_the_map_does_not_depend_on_the_number_of_threads(seed, threads):
    rng = np.random.default_rng(seed)
    disparity, pose, C = random_disparity(rng), random_pose(rng), random_covariance(rng)
    one, many = (fused(disparity, C, pose=pose, cell_m=0.06, threads=n) for n in (1, threads))
    assert one.sha256() == many.sha256()
    assert one.n_known > 5000


@pytest.mark.parametrize("fusion", FUSIONS)
@given(seed=seeds, quarters=st.integers(1, 3))
@settings(max_examples=3, deadline=None, derandomize=True)
def test_turning_the_world_and_the_covariance_by_quarters_turns_the_map(fusion, seed, quarters):
    rng = np.random.default_rng(seed)
    disparity, pose, C = random_disparity(rng), random_pose(rng), random_covariance(rng, 0.1, 0.02)
    R = np.round(from_yaw(quarters * np.pi / 2)[:3, :3])
    both = np.kron(np.eye(2), R)
    here = fused(disparity, C, pose=pose, fusion=fusion)
    there = fused(disparity, both @ C @ both.T, pose=from_rotation(R) @ pose, fusion=fusion)
    cells, values, _ = contents(here)
    moved = np.round((cells + 0.5) @ R.T - 0.5).astype(int)
    expected = dict(zip(map(tuple, moved.tolist()), values.tolist(), strict=True))
    found = evidence_of(there)
    # A cell on an edge of the view or of the reach may fall to either side of it in float32.
    assert len(found.keys() ^ expected.keys()) <= 1e-3 * len(expected)
    off = np.array([found[cell] - expected[cell] for cell in found.keys() & expected.keys()])
    assert np.mean(np.abs(off) > 0.02) < 0.003


def test_an_image_without_a_match_tells_nothing_however_uncertain_the_pose():
    assert fused(no_disparity(), covariance([0.3] * 3, [0.1] * 3)).n_known == 0


# Along each ray


@given(seed=seeds)
@settings(max_examples=10, deadline=None, derandomize=True)
def test_along_a_ray_the_position_errs_by_its_covariance_there(seed):
    rng = np.random.default_rng(seed)
    S = random_covariance(rng)[:3, :3]
    layout = layout_of(CAMERA.shape)
    eps = eps_of_nodes(CAMERA, layout, 0.1, S)
    for level, (first, height, width) in enumerate(layout):
        row, column = np.indices((height, width)) * 2**level + 0.5 * (2**level - 1)
        f, cx, cy = CAMERA.focal_px, CAMERA.cx_px, CAMERA.cy_px
        rays = np.stack([(column - cx) / f, (row - cy) / f, np.ones_like(row)], axis=-1)
        length = np.linalg.norm(rays, axis=-1)
        u = rays / length[..., None]
        along = np.einsum("hwi,ij,hwj->hw", u, S, u)
        expected = np.sqrt(along / length**2 + 0.1**2)
        found = eps[first : first + height * width].reshape(height, width)
        np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_an_error_along_the_optical_axis_is_eps_in_the_middle_and_that_of_the_ray_elsewhere():
    d_px, sigma_px, eps_m = 4.0, 0.1, 0.2
    C = covariance([eps_m, 0, 0])
    view = View(CENTRED, Disparity(np.full(CENTRED.shape, d_px, np.float32), np.float32(sigma_px)), FORWARD, 0.1, MODEL)
    made = Pyramid.of(
        CENTRED, view.disparity, MODEL, left_m2=replace(view, pose_covariance=C).left_m2, motion_sigma_m=view.eps_m
    )
    q = (made.nodes.view(np.int32)[:, 1] & -65536).astype(np.int32).view(np.float32)[: CENTRED.height_px * 81]
    row, column = np.indices(CENTRED.shape)
    cos_2 = 1 / (1 + ((row - 30) / 60) ** 2 + ((column - 40) / 60) ** 2)
    expected = np.hypot(sigma_px, cos_2 * eps_m * d_px**2 / CENTRED.focal_baseline_px_m)
    np.testing.assert_allclose(d_px / q.reshape(CENTRED.shape), expected, rtol=0.005)


@pytest.mark.parametrize("fusion", FUSIONS)
@pytest.mark.parametrize("rule", ["rss", "linear"])
def test_on_the_optical_axis_an_error_along_it_makes_the_map_that_eps_makes(fusion, rule):
    d = np.full(CENTRED.shape, np.nan, np.float32)
    d[30, 40] = CENTRED.focal_baseline_px_m / 1.7
    disparity = Disparity(d, np.float32(0.1))
    grids = [empty(fusion=fusion, clamp=None) for _ in range(3)]
    grids[0].integrate(CENTRED, disparity, FORWARD, 0.2, motion_rule=rule)
    grids[1].integrate(CENTRED, disparity, FORWARD, motion_rule=rule, pose_covariance=covariance([0.2, 0, 0]))
    grids[2].integrate(CENTRED, disparity, FORWARD, 0.12, motion_rule=rule, pose_covariance=covariance([0.16, 0, 0]))
    expected, *found = (evidence_of(grid) for grid in grids)
    assert len(expected) > 10
    for each in found:
        assert each.keys() == expected.keys()
        assert max(abs(each[cell] - expected[cell]) for cell in expected) < 0.02


# Across the rays


@pytest.mark.parametrize(("fusion", "within"), [("cell", 0.05), ("sum_of_rays", 0.2)])
def test_a_post_at_5_m_under_1_degree_of_heading_is_smeared_by_8_7_cm_across_and_not_along(fusion, within):
    camera = StereoCamera(focal_px=200, cx_px=79.5, cy_px=9.5, baseline_m=0.1, width_px=160, height_px=20)
    d = np.full(camera.shape, camera.focal_baseline_px_m / 9, np.float32)
    d[:, 78:82] = camera.focal_baseline_px_m / 5
    disparity, model = Disparity(d, np.float32(0.05)), SensorModel(max_range_m=10.0)
    C, excess = covariance(turn_rad=[0, 0, np.radians(1)]), []
    cells = np.stack(np.meshgrid(np.arange(88, 101), np.arange(-30, 30), indexing="ij"), axis=-1)
    cells = np.append(cells, np.zeros((13, 60, 1), int), axis=-1)
    for each in (None, C):
        grid = fused(disparity, each, camera=camera, cell_m=0.05, model=model, fusion=fusion)
        values, counts = grid.blocks.at(cells.reshape(-1, 3))
        # What a cell is likelier to be occupied than where all rays pass: hidden cells are as likely as before.
        ratio = np.where(counts > 0, np.exp(values), 1.0).reshape(13, 60)
        excess.append(ratio - ratio[:, :3].mean())
    across_m = (cells[0, :, 1] + 0.5) * 0.05
    layer = [each[-1] / each[-1].sum() for each in excess]
    variance = [each @ (across_m - each @ across_m) ** 2 for each in layer]
    assert np.sqrt(variance[1] - variance[0]) == pytest.approx(5 * np.radians(1), rel=0.06)
    # Layer by layer as much as before: nothing has moved along the rays. (How many rays a cell sums up is chance.)
    exact, smeared = (each.sum(axis=1) for each in excess)
    assert exact[-1] > 10 * exact[0]
    np.testing.assert_allclose(smeared, exact, atol=within * exact[-1])


@pytest.mark.parametrize("fusion", FUSIONS)
@pytest.mark.parametrize("form", ["corrected", "printed"])
def test_the_less_the_heading_is_known_the_less_is_claimed_of_a_post_and_never_less_than_that_it_is_free(fusion, form):
    d = np.full(CAMERA.shape, CAMERA.focal_baseline_px_m / 2.9, np.float32)
    d[:, 36:44] = CAMERA.focal_baseline_px_m / 1.5
    disparity = Disparity(d, np.float32(0.05))
    model = SensorModel(max_range_m=3.0, form=form)
    maps = [
        fused(disparity, covariance(turn_rad=[0, 0, np.radians(deg)]), cell_m=0.05, fusion=fusion, model=model)
        for deg in (0, 3, 9)
    ]
    least, *others = (each.blocks.known()[1].min() for each in maps)
    at_post = [float(each.blocks.at(np.array([[29, 0, 0]]))[0][0]) for each in maps]
    assert at_post[0] > 0.5
    assert (np.diff(at_post) < 0).all()
    assert at_post[-1] < at_post[0] - 1
    assert min(others) >= least - 1 / ONE


@pytest.mark.parametrize(("fusion", "within"), [("cell", 0.03), ("sum_of_rays", 0.25)])
def test_a_wall_across_the_view_does_not_change_under_an_error_along_it(fusion, within):
    C = covariance([0, 0.15, 0.15])
    exact, smeared = (evidence_of(fused(wall(1.5), each, fusion=fusion)) for each in (None, C))
    # Away from the wall's ends: where all the poses see it.
    middle = [(i, j, k) for i, j, k in exact if i > 9 and max(abs(j + 0.5), abs(k + 0.5)) < 0.2 * (i + 0.5)]
    assert sum(exact[cell] > 0.5 for cell in middle) > 10
    # How many rays a cell sums up is chance: beyond 6 nat, a map's usual limit, their number does not matter.
    both = np.clip([(exact[cell], smeared[cell]) for cell in middle], -6, 6)
    np.testing.assert_allclose(both[:, 1], both[:, 0], atol=within)


def test_a_wall_beside_the_robot_is_smeared_by_an_error_across_it():
    """The camera looks along a wall on its left: .15 m to the side there is no telling which cells it fills."""
    camera, wall_m = CAMERA, 0.8
    column = np.arange(camera.width_px)
    to_left = (camera.cx_px - column) / camera.focal_px
    depth_m = np.where(to_left > 0.3, wall_m / np.maximum(to_left, 0.3), np.nan)
    d = np.broadcast_to(camera.focal_baseline_px_m / depth_m, camera.shape).astype(np.float32)
    exact, smeared = (evidence_of(fused(Disparity(d, np.float32(0.05)), C)) for C in (None, covariance([0, 0.15, 0])))
    assert exact[19, 8, 0] > smeared[19, 8, 0] + 0.3
    assert exact[19, 6, 0] < smeared[19, 6, 0] - 0.3


@pytest.mark.parametrize("fusion", FUSIONS)
@pytest.mark.parametrize("weight", [1.0, 0.25])
def test_a_cell_gets_the_mean_of_its_ratios_over_the_poses(fusion, weight):
    rng = np.random.default_rng(7)
    disparity, pose = random_disparity(rng), random_pose(rng)
    sideways = from_rotation(pose[:3, :3])[:3, 0]
    C = np.zeros((6, 6))
    C[:3, :3] = 0.1**2 * np.outer(sideways, sideways)
    nodes = View(CAMERA, disparity, pose, 0.1, MODEL, pose_covariance=C).nodes
    assert len(nodes) > 3
    of_pose = [evidence_of(fused(disparity, pose=each, fusion=fusion)) for each in nodes.poses]
    cells = sorted(set().union(*of_pose))
    told = np.array([[each.get(cell, np.nan) for cell in cells] for each in of_pose])
    expected = twins.mean_over_poses(told, nodes.weights, weight)
    found = evidence_of(fused(disparity, C, pose=pose, fusion=fusion, weight=weight))
    assert sorted(found) == cells
    np.testing.assert_allclose([found[cell] for cell in cells], expected, atol=0.5001 / ONE + 1e-4)


@given(seed=seeds, n_poses=st.integers(2, 12), weight=st.sampled_from([1.0, 0.4]), most=st.sampled_from([800, 32767]))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_the_mean_agrees_with_its_twin(seed, n_poses, weight, most):
    rng = np.random.default_rng(seed)
    kinds = rng.choice([SKIPPED, FREE, JUDGED], (n_poses, 9), p=[0.2, 0.4, 0.4]).astype(np.int8)
    kinds[:, :3] = SKIPPED, FREE, JUDGED
    free = rng.integers(-600, -200, kinds.shape).astype(np.int16)
    evidence = rng.integers(-most, most + 1, (*kinds.shape, CELLS)).astype(np.int16)
    evidence[rng.random(evidence.shape) < 0.3] = NOTHING
    weights = rng.dirichlet(np.ones(n_poses)) + 0.01
    weights /= weights.sum()
    told = np.where((kinds == FREE)[..., None], free[..., None], np.where(evidence == NOTHING, np.nan, evidence)) / ONE
    told[kinds == SKIPPED] = np.nan
    expected = twins.mean_over_poses(told.reshape(n_poses, -1), weights, weight).reshape(9, CELLS)
    stack = kinds.copy(), free.copy(), evidence.copy()
    marginal.average((0, 9), weights.astype(np.float32), weight, stack, marginal.EXPONENTIALS)
    found = np.where(stack[2][0] == NOTHING, np.nan, stack[2][0].astype(float))
    whole = stack[0][0] == FREE
    found[whole] = stack[1][0][whole, None]
    found[stack[0][0] == SKIPPED] = np.nan
    np.testing.assert_allclose(found / ONE, expected, atol=0.52 / ONE)
    np.testing.assert_array_equal(whole, (kinds == FREE).any(axis=0) & (kinds != JUDGED).all(axis=0))


def test_blocks_that_are_free_by_every_pose_stay_free_as_wholes():
    learnt = FUSIONS["cell"](
        View(CAMERA, wall(2.9, 0.02), FORWARD, 0.03, MODEL, pose_covariance=covariance([0, 0.1, 0])), 1
    )
    exact = FUSIONS["cell"](View(CAMERA, wall(2.9, 0.02), FORWARD, 0.03, MODEL), 1)
    middle = {tuple(b): e for b, e, free in zip(exact.blocks, exact.free_evidence, exact.free, strict=True) if free}
    found = {tuple(b): e for b, e, free in zip(learnt.blocks, learnt.free_evidence, learnt.free, strict=True) if free}
    assert len(middle) > 20
    inner = [b for b in middle if np.abs(np.add(b, 0.5)[1:]).max() * BLOCK * 0.03 < 0.15 * b[0] * BLOCK * 0.03]
    assert len(inner) > 3
    assert all(found[b] == middle[b] for b in inner)


# The poses that stand for a covariance


@given(sigma_cells=st.floats(0, 30))
def test_nodes_have_the_moments_of_a_normal_distribution_and_are_a_cell_apart(sigma_cells):
    places, weights = quadrature(sigma_cells)
    assert weights.sum() == pytest.approx(1)
    assert weights @ places == pytest.approx(0, abs=1e-12)
    if len(places) == 1:
        assert sigma_cells <= LEAST_CELLS
        return
    assert weights @ places**2 == pytest.approx(1)
    assert len(places) == MOST_NODES or np.diff(places).max() * sigma_cells <= 1


@given(seed=seeds, reference_m=st.floats(0.5, 5), size=st.floats(0.1, 3))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_the_poses_and_what_they_leave_make_up_the_covariance(seed, reference_m, size):
    rng = np.random.default_rng(seed)
    pose = random_pose(rng)
    C = size**2 * random_covariance(rng, 0.2, 0.01)
    nodes = pose_nodes(pose, C, reference_m=reference_m, cell_m=0.1)
    assert np.linalg.eigvalsh(nodes.left_m2)[0] > -1e-12
    in_cam = np.array([inverse(pose) @ each for each in nodes.poses])
    shift = in_cam[:, :3, 3]
    np.testing.assert_allclose(shift[:, 2], 0, atol=1e-9)
    position = pose[:3, :3].T @ C[:3, :3] @ pose[:3, :3]
    total = np.einsum("k,ki,kj->ij", nodes.weights, shift, shift) + nodes.left_m2
    # All of what lies across the axis, and all along it; how the two go together is left out.
    np.testing.assert_allclose(total[:2, :2], position[:2, :2], atol=1e-9)
    assert total[2, 2] == pytest.approx(position[2, 2])
    # What the poses move at the reference is what the covariance moves there, on axes where it is worth a pose.
    ahead = transform(pose, [0, 0, reference_m])
    moved = np.array([transform(each @ inverse(pose), ahead) - ahead for each in nodes.poses]) @ pose[:3, :2]
    right, down = pose[:3, 0], pose[:3, 1]
    A = np.array([[*right, *(reference_m * down)], [*down, *(-reference_m * right)]])
    missing = A @ C @ A.T - np.einsum("k,ki,kj->ij", nodes.weights, moved, moved)
    # Turns are small; an axis with one pose keeps its error.
    assert np.linalg.eigvalsh(missing).max() <= (LEAST_CELLS * 0.1) ** 2 + 0.02 * np.trace(A @ C @ A.T)
    assert np.linalg.eigvalsh(missing).min() >= -0.02 * np.trace(A @ C @ A.T)


# At the door


def with_entry(i, j, value):
    C = np.eye(6) * 0.01
    C[i, j] = value
    return C


@pytest.mark.parametrize(
    ("C", "culprit"),
    [
        (np.eye(3), r"pose_covariance must be \(6, 6\), not \(3, 3\)"),
        (0.1, r"pose_covariance must be \(6, 6\), not"),
        (with_entry(2, 2, np.nan), "pose_covariance must be finite, without NaN"),
        (with_entry(0, 0, np.inf), "pose_covariance must be finite, without NaN"),
        (with_entry(0, 1, 0.002), "pose_covariance must be symmetric; it is off by 0.002"),
        (with_entry(5, 5, -0.001), "pose_covariance must be positive semidefinite; it has the eigenvalue -0.001"),
        (with_entry(0, 0, 1e30), "pose_covariance lets the camera err by 1e.15 m: too far to map"),
    ],
)
def test_a_covariance_that_cannot_be_is_refused_and_the_map_stays_as_it_was(C, culprit):
    grid = OccupancyGrid(0.1, model=MODEL)
    grid.integrate(CAMERA, wall(2.0), FORWARD)
    before = grid.sha256()
    with pytest.raises(InvalidInputError, match=culprit):
        grid.integrate(CAMERA, wall(2.0), FORWARD, pose_covariance=C)
    assert grid.sha256() == before


def test_a_covariance_may_be_off_by_rounding():
    root = np.random.default_rng(3).standard_normal((6, 2)) * 0.1
    C = (root @ root.T).astype(np.float32)
    assert np.linalg.eigvalsh(C.astype(float))[0] < 0
    assert fused(wall(2.0), C).n_known > 100


def test_free_space_that_only_some_poses_see_is_claimed_by_their_share():
    """The camera's right edge under an error to the side: half way, half the claim."""
    C = covariance([0, 0.15, 0])
    learnt = evidence_of(fused(wall(2.9, 0.05), C, cell_m=0.05))
    edge_m = 40 / 60 * 1.025
    free = np.exp(log_odds(MODEL.p_free))
    shares = np.array([(1 - np.exp(learnt.get((20, j, 0), 0.0))) / (1 - free) for j in range(30)])
    assert shares[0] == pytest.approx(1, abs=0.01)
    assert (np.diff(shares) < 0.01).all()
    assert np.interp(edge_m, (np.arange(30) + 0.5) * 0.05, shares) == pytest.approx(0.5, abs=0.1)
