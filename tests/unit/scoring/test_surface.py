import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.scoring import OCCUPIED, VisibleSet, label_cells
from stereogrid.scoring.kernels import distance_to_candidates
from stereogrid.scoring.surface import (
    Surface,
    map_surface_m,
    surface_scores,
    visible_samples_m,
    voxelised_mesh_m,
)

CELL_M = 0.1


def plane_at(z_m):
    """A square of 4 m by 4 m."""
    corners = np.array([(0, 0, z_m), (4, 0, z_m), (4, 4, z_m), (0, 4, z_m)])
    return trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False)


def all_seen(labels):
    return VisibleSet(np.ones(labels.label.shape, np.float32), np.ones(labels.label.shape, bool))


def sampled(mesh):
    return Surface.sample(mesh, CELL_M, np.random.default_rng(0))


@given(st.floats(0.001, 0.5), st.booleans())
@settings(max_examples=25, deadline=None)
def test_a_map_shifted_from_a_plane_is_as_inaccurate_as_the_shift(shift_m, up):
    surface = sampled(plane_at(1.0))
    map_m = np.random.default_rng(1).uniform(0, 4, (500, 3))
    map_m[:, 2] = 1.0 + (shift_m if up else -shift_m)
    scores = surface_scores(map_m, surface, surface.samples_m, cell_m=CELL_M)
    assert scores["accuracy_m"][0] == pytest.approx(shift_m, abs=1e-9)
    assert scores["accuracy_p95_m"][0] == pytest.approx(shift_m, abs=1e-9)
    assert scores["completeness_m"][0] >= shift_m
    assert scores["chamfer_m"][0] == (scores["accuracy_m"][0] + scores["completeness_m"][0]) / 2


def test_a_plane_through_cell_centres_has_an_exact_floor():
    mesh = plane_at(1.05)
    labels = label_cells(mesh, CELL_M, [(0, 0, 0), (4, 4, 2)])
    surface, visible = sampled(mesh), all_seen(labels)
    truth_m = visible_samples_m(surface, labels, visible)
    scores = surface_scores(voxelised_mesh_m(labels, visible), surface, truth_m, cell_m=CELL_M)
    assert scores["accuracy_m"] == (pytest.approx(0, abs=1e-12), 40 * 40)
    # The mean distance of a point of a unit square to its centre is (sqrt 2 + asinh 1) / 6.
    expected = (np.sqrt(2) + np.arcsinh(1)) / 6 * CELL_M
    assert scores["completeness_m"][0] == pytest.approx(expected, rel=0.02)
    assert scores["surface_f1_1_cell"][0] == 1


def test_the_distance_to_a_fine_mesh_is_the_distance_to_its_sphere():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    points = np.random.default_rng(2).normal(size=(2000, 3))
    exact = np.abs(np.linalg.norm(points, axis=1) - 1)
    assert np.abs(sampled(ball).distance_m(points) - exact).max() < 3e-3


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_the_distance_is_never_too_small_and_hardly_ever_too_large(seed):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0, 3, (40, 1, 3)) + rng.uniform(-0.4, 0.4, (40, 3, 3))
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(120).reshape(-1, 3), process=False)
    points = rng.uniform(-0.5, 3.5, (300, 3))
    exact = np.empty(300)
    distance_to_candidates(points, np.tile(np.arange(40), (300, 1)), corners, exact)
    distance = sampled(mesh).distance_m(points)
    assert (distance >= exact).all()
    assert (distance > exact + 1e-9).sum() <= 3
    assert (distance - exact).max() < CELL_M / 2, "half a cell is the spacing of the samples"


def test_samples_are_uniform_over_the_area():
    mesh = trimesh.util.concatenate([plane_at(0.0), trimesh.creation.box(extents=(2, 2, 2))])
    samples = sampled(mesh)
    on_plane = np.isin(samples.triangle_of, [0, 1]).mean()
    assert on_plane == pytest.approx(16 / (16 + 24), abs=0.01)
    assert samples.distance_m(samples.samples_m).max() < 1e-9


def test_only_the_visible_part_of_the_mesh_must_be_completed():
    mesh = plane_at(1.05)
    labels = label_cells(mesh, CELL_M, [(0, 0, 0), (4, 4, 2)])
    nearest_m = np.full(labels.label.shape, np.inf, np.float32)
    nearest_m[:20] = 1
    half = VisibleSet(nearest_m, np.isfinite(nearest_m))
    assert visible_samples_m(sampled(mesh), labels, half)[:, 0].max() < 2.0
    assert voxelised_mesh_m(labels, half)[:, 0].max() < 2.0


def test_an_error_behind_a_wall_counts_and_one_out_of_view_does_not():
    labels = label_cells(plane_at(1.05), CELL_M, [(0, 0, 0), (4, 4, 2)])
    in_view = np.zeros(labels.label.shape, bool)
    in_view[:20] = True
    seen = VisibleSet(np.full(labels.label.shape, np.inf, np.float32), in_view)
    ghosts = np.array([(1.0, 1.0, 0.3), (1.0, 1.0, 9.0), (3.0, 1.0, 0.3)])
    assert np.array_equal(map_surface_m(ghosts, labels, seen), ghosts[:2])


def test_an_empty_map_has_no_distance_and_an_f_of_zero():
    mesh = plane_at(1.05)
    scores = surface_scores(np.empty((0, 3)), sampled(mesh), sampled(mesh).samples_m, cell_m=CELL_M)
    assert np.isnan(scores["accuracy_m"][0]) and np.isnan(scores["completeness_m"][0])
    assert scores["surface_f1_20_cm"][0] == 0


def test_a_mesh_without_area_is_refused():
    line = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)], process=False)
    with pytest.raises(InvalidInputError, match="no area"):
        sampled(line)


def test_the_voxelised_mesh_is_the_occupied_cells():
    labels = label_cells(plane_at(1.05), CELL_M)
    assert len(voxelised_mesh_m(labels, all_seen(labels))) == (labels.label == OCCUPIED).sum()
