"""Laws of the map: what one observation may change, and what must not depend on where the world's origin lies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_yaw, inverse, transform
from stereogrid.grid import FUSIONS
from stereogrid.sensor_model import REACH_BEHIND_SIGMAS, REACH_SIGMAS, SensorModel, log_odds

from .scenes import (
    CAMERA,
    FORWARD,
    FREE_GAIN,
    contents,
    drive,
    empty,
    mapped,
    no_disparity,
    random_pose,
    wall,
)

seeds = st.integers(0, 2**32 - 1)


# Where the origin lies and which way the axes point


@pytest.mark.parametrize("fusion", FUSIONS)
@given(seed=seeds, quarters=st.integers(0, 3), shift=st.tuples(*[st.integers(-100, 100)] * 3))
@settings(max_examples=12, deadline=None, derandomize=True)
def test_turning_and_shifting_the_world_by_whole_cells_leaves_the_map_equal(fusion, seed, quarters, shift):
    poses, disparities = drive(seed)
    here = mapped(poses, disparities, fusion=fusion)
    T = from_yaw(quarters * np.pi / 2, np.array(shift) * here.cell_m)
    T[:3, :3] = np.round(T[:3, :3])
    there = mapped([T @ pose for pose in poses], disparities, fusion=fusion)
    cells, values, counts = contents(here)
    moved = np.round((cells + 0.5) @ T[:3, :3].T + shift - 0.5).astype(int)
    expected = dict(zip(map(tuple, moved.tolist()), zip(values, counts, strict=True), strict=True))
    cells, values, counts = contents(there)
    found = dict(zip(map(tuple, cells.tolist()), zip(values, counts, strict=True), strict=True))
    # A cell that lies on an edge of the view, of a node or of the reach may fall to either side of it in float32.
    assert len(found.keys() ^ expected.keys()) <= 1e-3 * len(expected)
    both = np.array([(*found[cell], *expected[cell]) for cell in found.keys() & expected.keys()])
    alike = (both[:, 1] == both[:, 3]) & (np.abs(both[:, 0] - both[:, 2]) <= 0.02)
    assert alike.mean() > 0.997


@given(seed=seeds, order=st.permutations(range(4)))
@settings(max_examples=10, deadline=None, derandomize=True)
def test_without_a_clamp_the_order_of_the_observations_does_not_matter(seed, order):
    poses, disparities = drive(seed, n=4)
    forth = contents(mapped(poses, disparities, clamp=None))
    back = contents(mapped([poses[i] for i in order], [disparities[i] for i in order], clamp=None))
    np.testing.assert_array_equal(forth[0], back[0])
    np.testing.assert_array_equal(forth[2], back[2])
    np.testing.assert_allclose(forth[1], back[1], atol=2e-6)


# What one observation may change


@pytest.mark.parametrize("fusion", FUSIONS)
@given(seed=seeds)
@settings(max_examples=5, deadline=None, derandomize=True)
def test_an_observation_updates_a_cell_at_most_once(fusion, seed):
    poses, disparities = drive(seed)
    grid = empty(fusion=fusion)
    for n, (pose, disparity) in enumerate(zip(poses, disparities, strict=True)):
        before = contents(grid)
        grid.integrate(CAMERA, disparity, pose)
        cells, _, counts = contents(grid)
        centres = (cells + 0.5) * grid.cell_m
        earlier = dict(zip(map(tuple, before[0].tolist()), before[2].tolist(), strict=True))
        growth = counts - np.array([earlier.get(tuple(cell), 0) for cell in cells.tolist()], dtype=int)
        assert set(growth.tolist()) <= {0, 1}
        assert growth.sum() > 0
        assert len(cells) >= len(before[0])
        assert counts.max() <= n + 1
        np.testing.assert_array_equal(grid.n_updates(centres), counts)


@pytest.mark.parametrize("fusion", FUSIONS)
@given(seed=seeds, depth_m=st.floats(0.8, 2.2), sigma_px=st.floats(0.05, 0.6))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_nothing_is_learnt_further_behind_a_surface_than_the_reach(fusion, seed, depth_m, sigma_px):
    pose = random_pose(np.random.default_rng(seed))
    grid = mapped([pose], [wall(depth_m, sigma_px)], fusion=fusion)
    cells, _ = grid.known_cells()
    depths = transform(inverse(pose), (cells + 0.5) * grid.cell_m)[:, 2]
    sigma_m = depth_m**2 * sigma_px / CAMERA.focal_baseline_px_m
    # A hit may vote for a cell whose centre is half a diagonal behind it; rays judge cells beside them.
    slack_m = grid.cell_m * (np.sqrt(3) / 2 if fusion == "cell" else np.sqrt(3))
    assert depths.max() <= depth_m + max(0.5 * grid.cell_m + REACH_BEHIND_SIGMAS * sigma_m, slack_m) + (
        0.0 if fusion == "cell" else slack_m
    )
    # The bound is reached, so the law says something.
    assert depths.max() > depth_m


@given(seed=seeds, depth_m=st.floats(0.8, 2.5), n=st.integers(1, 4))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_a_cell_well_in_front_of_the_surface_gains_exactly_the_log_odds_of_free(seed, depth_m, n):
    pose = random_pose(np.random.default_rng(seed))
    sigma_px = 0.1
    grid = mapped([pose] * n, [wall(depth_m, sigma_px)] * n)
    cells, values, counts = contents(grid)
    depths = transform(inverse(pose), (cells + 0.5) * grid.cell_m)[:, 2]
    sigma_m = depth_m**2 * sigma_px / CAMERA.focal_baseline_px_m
    well_in_front = depths < depth_m - REACH_SIGMAS * sigma_m - np.sqrt(3) / 2 * grid.cell_m
    assert well_in_front.sum() > 20
    assert (counts[well_in_front] == n).all()
    expected = np.add.accumulate(np.full(n, FREE_GAIN))[-1]
    np.testing.assert_array_equal(values[well_in_front], expected)


@pytest.mark.parametrize("fusion", FUSIONS)
def test_an_image_without_matches_changes_nothing(fusion):
    poses, disparities = drive(5)
    grid = mapped(poses, disparities, fusion=fusion)
    before = grid.sha256(), grid.n_known, len(grid.blocks)
    grid.integrate(CAMERA, no_disparity(), poses[0])
    assert (grid.sha256(), grid.n_known, len(grid.blocks)) == before
    nothing = mapped([FORWARD], [no_disparity()], fusion=fusion)
    assert (nothing.n_known, len(nothing.blocks), nothing.n_bytes) == (0, 0, 0)
    assert nothing.occupied_centres().shape == (0, 3)


@pytest.mark.parametrize("fusion", FUSIONS)
def test_a_reading_that_knows_no_depth_changes_nothing(fusion):
    # A sigma of more than half of the disparity leaves the surface anywhere.
    d_px = CAMERA.focal_baseline_px_m / 1.5
    for sigma_px in (0.55 * d_px, 1e4):
        assert mapped([FORWARD], [wall(1.5, sigma_px)], fusion=fusion).n_known == 0
    assert mapped([FORWARD], [wall(1.5, 0.45 * d_px)], fusion=fusion).n_known > 1000


def test_the_printed_form_sinks_the_cells_behind_a_surface_where_the_prior_is_not_a_half():
    behind = np.array([[1.5 + 0.35, 0.05, 0.05]])
    # There u = 3: the reading's p is the prior but for 1 %.
    sigma_px = (0.35 / 3) * CAMERA.focal_baseline_px_m / 1.5**2
    corrected, printed = (
        mapped([FORWARD], [wall(1.5, sigma_px)], model=SensorModel(p_free=0.1, prior=0.2, max_range_m=3, form=form))
        for form in ("corrected", "printed")
    )
    assert np.isnan(corrected.probability(behind))
    assert log_odds(printed.probability(behind)) == pytest.approx(2 * log_odds(0.2), abs=0.2)


# What the map answers


@pytest.mark.filterwarnings("error")
def test_points_that_are_nowhere_are_unknown():
    grid = mapped([FORWARD], [wall(1.5, 0.3)])
    nowhere = [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf], [1e300, 0, 0], [-1e17, 0, 0]]
    assert np.isnan(grid.probability(nowhere)).all()
    assert not grid.n_updates(nowhere).any()


@given(seed=seeds, threshold=st.sampled_from([0.0, 0.2, 0.5, 0.7, 0.95]))
@settings(max_examples=10, deadline=None, derandomize=True)
def test_known_cells_occupied_centres_and_probability_agree(seed, threshold):
    grid = mapped(*drive(seed))
    cells, p = grid.known_cells()
    centres = (cells + 0.5) * grid.cell_m
    np.testing.assert_array_equal(grid.probability(centres), p)
    assert len(cells) == grid.n_known == np.unique(cells, axis=0).shape[0]
    np.testing.assert_array_equal(grid.occupied_centres(threshold), centres[p > threshold])
    # The whole cell answers alike, up to but not including its upper faces.
    rng = np.random.default_rng(seed)
    inside = (cells + rng.uniform(0.001, 0.999, cells.shape)) * grid.cell_m
    np.testing.assert_array_equal(grid.probability(inside), p)


def test_a_cell_that_was_never_updated_has_no_probability():
    grid = mapped([FORWARD], [wall(2.0)])
    behind_the_camera, behind_the_wall, far_away = [-0.5, 0, 0], [2.6, 0, 0], [1e6, -1e6, 5]
    assert np.isnan(grid.probability([behind_the_camera, behind_the_wall, far_away])).all()
    np.testing.assert_array_equal(grid.n_updates([behind_the_camera, behind_the_wall, far_away]), 0)
    assert grid.probability(np.empty((0, 3))).shape == (0,)


@pytest.mark.parametrize("threshold", [-0.1, 1.0, np.nan])
def test_a_threshold_that_is_no_probability_is_refused(threshold):
    with pytest.raises(InvalidInputError, match="threshold"):
        empty().occupied_centres(threshold)


@given(seed=seeds)
@settings(max_examples=10, deadline=None, derandomize=True)
def test_the_digest_does_not_depend_on_the_order_in_which_blocks_came(seed):
    poses, disparities = drive(seed, n=2)
    grid = mapped(poses, disparities)
    blocks = grid.blocks.indices()
    other = empty()
    other.blocks.rows(np.random.default_rng(seed).permutation(blocks))
    for pose, disparity in zip(poses, disparities, strict=True):
        other.integrate(CAMERA, disparity, pose)
    assert (grid.blocks.indices() != other.blocks.indices()).any()
    assert grid.sha256() == other.sha256()


@given(seed=seeds)
@settings(max_examples=10, deadline=None, derandomize=True)
def test_the_digest_changes_when_one_cell_differs(seed):
    grid = mapped(*drive(seed, n=1))
    before = grid.sha256()
    rule, words = grid.blocks.rule, grid.blocks.words
    known = np.argwhere(rule.n_updates(words[: len(grid.blocks)]) > 0)
    at = tuple(known[np.random.default_rng(seed).integers(len(known))])
    words[at] += 1 << rule.count_bits
    assert grid.sha256() != before


def test_the_digest_changes_with_the_cell_size_and_when_a_cell_becomes_known():
    assert empty(cell_m=0.1).sha256() != empty(cell_m=0.2).sha256()
    grid = mapped([FORWARD], [wall(2.0)])
    before = grid.sha256()
    unknown = np.argwhere(grid.blocks.words[: len(grid.blocks)] == 0)[0]
    grid.blocks.words[tuple(unknown)] = 1
    assert grid.sha256() != before
