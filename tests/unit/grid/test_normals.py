"""Normals of surfaces whose direction is known. The bounds are the errors measured, rounded up."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stereogrid.errors import InvalidInputError

from .maps import every_cell, filled

MEAN_PLANE_DEG, MAX_PLANE_DEG, MEAN_BALL_DEG, MAX_BALL_DEG = 2.5, 4.0, 1.5, 3.0
BOX = every_cell([-14] * 3, [14] * 3)


def errors_deg(grid, truth_of):
    """Angles (N,) between estimated and true normals of the occupied cells within 8 cells of the origin."""
    centres, normals = grid.surface()
    inner = np.abs(centres).max(axis=1) < 8 * grid.cell_m
    assert np.isfinite(normals[inner]).all()
    np.testing.assert_allclose(np.linalg.norm(normals[inner], axis=1), 1)
    cosines = (normals[inner] * truth_of(centres[inner])).sum(axis=1)
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def surface_map(signed_cells):
    """Free in front (> .5), occupied within half a cell's diagonal, unknown behind: as a camera leaves a wall."""
    seen = signed_cells > -0.87
    log_odds = np.where(signed_cells[seen] > 0.5, -2.0, 2.0)
    return filled(BOX[seen], log_odds)


@pytest.mark.parametrize("angles_deg", [(0, 0), (10, 0), (30, 0), (45, 0), (26, 17), (45, 35), (71, 52)])
def test_a_plane_seen_from_one_side_faces_it(angles_deg):
    normal = Rotation.from_euler("zy", angles_deg, degrees=True).apply([1.0, 0, 0])
    errors = errors_deg(surface_map((BOX + 0.5) @ normal), lambda centres: normal)
    assert len(errors) > 100
    assert errors.mean() < MEAN_PLANE_DEG
    assert errors.max() < MAX_PLANE_DEG


def test_a_ball_seen_from_outside_faces_outwards():
    grid = surface_map(np.linalg.norm(BOX + 0.5, axis=1) - 7.3)
    errors = errors_deg(grid, lambda centres: centres / np.linalg.norm(centres, axis=1, keepdims=True))
    assert errors.mean() < MEAN_BALL_DEG
    assert errors.max() < MAX_BALL_DEG


def test_normals_do_not_depend_on_what_the_axes_are_called():
    rng = np.random.default_rng(0)
    cells = every_cell([-6] * 3, [6] * 3)
    cells = cells[rng.random(len(cells)) < 0.5]
    log_odds = rng.choice([-1.0, 1.0], len(cells))
    centres, normals = filled(cells, log_odds).surface(reach_cells=2)
    turned_centres, turned = filled(cells[:, [2, 0, 1]], log_odds).surface(reach_cells=2)
    order, turned_order = np.lexsort(centres.T), np.lexsort(turned_centres[:, [1, 2, 0]].T)
    np.testing.assert_allclose(normals[order], turned[turned_order][:, [1, 2, 0]], atol=1e-9)


def test_where_neighbours_do_not_say_there_is_no_normal():
    solid = filled(every_cell([-8] * 3, [8] * 3), 2.0).surface()
    inner = np.abs(solid[0]).max(axis=1) < 1
    assert np.isnan(solid[1][inner]).all()
    lone = filled([[0, 0, 0]], 2.0).surface()[1]
    assert np.isnan(lone).all()
    cells = every_cell([-8] * 3, [8] * 3)
    sheet = filled(cells, np.where(cells[:, 0] == 0, 2.0, -2.0)).surface()
    inner = np.abs(sheet[0]).max(axis=1) < 1
    assert np.isnan(sheet[1][inner]).all()


def test_a_map_without_surfaces_has_no_normals():
    centres, normals = filled([[0, 0, 0]], -2.0).surface()
    assert centres.shape == normals.shape == (0, 3)


@pytest.mark.parametrize("reach_cells", [0, -1, 17, 1.5])
def test_a_reach_that_is_no_small_whole_number_is_refused(reach_cells):
    with pytest.raises(InvalidInputError, match="reach_cells"):
        filled([[0, 0, 0]], 2.0).surface(reach_cells=reach_cells)
