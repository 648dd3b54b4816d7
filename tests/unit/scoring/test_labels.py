import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError, MapTooLargeError
from stereogrid.scoring import FREE, INTERIOR, OCCUPIED, label_cells

CELL_M = 0.05


def count(labels, kind):
    return int((labels.label == kind).sum())


@given(
    st.tuples(*[st.integers(-40, 40)] * 3),
    st.tuples(*[st.integers(1, 8)] * 3),
    st.floats(0.05, 0.45),
)
@settings(max_examples=40, deadline=None)
def test_a_box_between_the_cell_boundaries_has_the_counts_of_its_shell_and_core(box, corner, size, inset):
    low, size = np.array(corner), np.array(size)
    labels = label_cells(box((low + inset) * CELL_M, (low + size - inset) * CELL_M), CELL_M)
    outer, core = size.prod(), np.maximum(size - 2, 0).prod()
    assert count(labels, OCCUPIED) == outer - core
    assert count(labels, INTERIOR) == core
    assert count(labels, FREE) == labels.label.size - outer


@given(st.tuples(*[st.integers(-200, 200)] * 3), st.tuples(*[st.integers(3, 8)] * 3), st.floats(-1, 1))
@settings(max_examples=40, deadline=None)
def test_a_face_on_a_cell_boundary_occupies_both_its_sides_whatever_the_rounding(box, corner, size, noise):
    low, high = np.array(corner), np.add(corner, size)
    mesh = box(low * CELL_M + noise * 1e-6 * CELL_M, high * CELL_M - noise * 1e-6 * CELL_M)
    labels = label_cells(mesh, CELL_M, [(low - 2) * CELL_M, (high + 2) * CELL_M])
    outer, core = np.add(size, 2).prod(), np.subtract(size, 2).prod()
    assert count(labels, OCCUPIED) == outer - core
    assert count(labels, INTERIOR) == core


def test_float32_vertices_far_from_the_origin_do_not_change_the_labels(box):
    mesh = box((90.05, -60.15, 3.3), (91.1, -59.05, 4.35))
    rounded = trimesh.Trimesh(mesh.vertices.astype(np.float32), mesh.faces, process=False)
    bounds = [(89.95, -60.25, 3.2), (91.2, -58.95, 4.45)]
    assert np.array_equal(label_cells(mesh, CELL_M, bounds).label, label_cells(rounded, CELL_M, bounds).label)


def test_the_closed_ends_of_a_hollow_box_are_solid_and_its_cavity_is_free(box):
    cavity = box((0.42, 0.42, 0.42), (1.58, 1.58, 1.58))
    cavity.invert()
    shell = trimesh.util.concatenate([box((0.02, 0.02, 0.02), (1.98, 1.98, 1.98)), cavity])
    labels = label_cells(shell, 0.1, [(0, 0, 0), (2, 2, 2)])
    assert count(labels, OCCUPIED) == (20**3 - 18**3) + (12**3 - 10**3)
    assert count(labels, INTERIOR) == 18**3 - 12**3
    assert labels.label[10, 10, 10] == FREE


def test_furniture_in_a_room_is_solid_and_the_room_is_not(box):
    room = box((0.05, 0.05, 0.05), (1.95, 1.95, 1.95))
    room.invert()
    labels = label_cells(trimesh.util.concatenate([room, box((0.55,) * 3, (1.05,) * 3)]), 0.1)
    inside = labels.label[tuple(labels.index_of(np.array([0.8, 0.8, 0.8])))]
    beside = labels.label[tuple(labels.index_of(np.array([1.5, 1.5, 1.5])))]
    assert (inside, beside) == (INTERIOR, FREE)


def test_an_open_surface_has_no_interior(box):
    mesh = box((0.02,) * 3, (0.98,) * 3)
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    assert count(label_cells(mesh, 0.1), INTERIOR) == 0


def test_a_solid_whose_faces_share_no_vertices_is_still_closed(box):
    mesh = box((0.02,) * 3, (0.98,) * 3)
    soup = trimesh.Trimesh(mesh.triangles.reshape(-1, 3), np.arange(36).reshape(12, 3), process=False)
    assert np.array_equal(label_cells(soup, 0.1).label, label_cells(mesh, 0.1).label)
    assert count(label_cells(soup, 0.1), INTERIOR) == 8**3


def test_boxes_that_touch_or_overlap_are_one_solid(box):
    bounds = [(-0.1, -0.1, -0.1), (2.1, 1.1, 1.1)]
    parts = [box((0.02, 0.02, 0.02), (1.0, 0.98, 0.98)), box((0.6, 0.02, 0.02), (1.98, 0.98, 0.98))]
    labels = label_cells(trimesh.util.concatenate(parts), 0.1, bounds)
    assert count(labels, FREE) == labels.label.size - 20 * 10 * 10
    assert labels.label[5, 5, 5] == INTERIOR


def test_the_interior_of_a_sphere_is_where_the_radius_says():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    labels = label_cells(ball, 0.1)
    radius = np.linalg.norm(labels.centres_m(np.ones(labels.label.shape, bool)), axis=1)
    label = labels.label.ravel()
    assert (label[radius < 0.85] == INTERIOR).all()
    assert (label[radius > 1.1] == FREE).all()


QUARTER_TURN = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])


@given(st.integers(0, 2**32 - 1), st.tuples(*[st.integers(-30, 30)] * 3))
@settings(max_examples=20, deadline=None)
def test_labels_turn_and_move_with_the_world(seed, shift):
    triangles = np.random.default_rng(seed).uniform(-0.5, 0.5, (12, 3))
    faces = np.arange(12).reshape(4, 3)
    bounds = np.array([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
    labels = label_cells(trimesh.Trimesh(triangles, faces, process=False), CELL_M, bounds)
    offset = np.array(shift) * CELL_M
    moved = trimesh.Trimesh(triangles @ QUARTER_TURN.T + offset, faces, process=False)
    turned = label_cells(moved, CELL_M, bounds + offset)
    assert np.array_equal(turned.label, np.rot90(labels.label))
    assert np.array_equal(turned.origin_index, labels.origin_index + shift)


def test_bounds_are_widened_to_whole_cells_and_exact_ones_gain_no_layer(box):
    mesh = box((0, 0, 0), (0.3, 0.3, 0.3))
    assert label_cells(mesh, 0.1, [(0, 0, 0), (0.3, 0.6, 0.7)]).label.shape == (3, 6, 7)
    assert label_cells(mesh, 0.1, [(0.05, 0, 0), (0.31, 0.6, 0.7)]).label.shape == (4, 6, 7)
    assert np.allclose(label_cells(mesh, 0.1).bounds_m, [(-0.1,) * 3, (0.4,) * 3])


@pytest.mark.parametrize("cell_m", [0.0, -0.1, np.nan, np.inf])
def test_a_senseless_cell_size_is_refused(box, cell_m):
    with pytest.raises(InvalidInputError, match="cell_m"):
        label_cells(box((0, 0, 0), (1, 1, 1)), cell_m)


def test_bounds_the_wrong_way_round_are_refused(box):
    with pytest.raises(InvalidInputError, match="lower corner first"):
        label_cells(box((0, 0, 0), (1, 1, 1)), 0.1, [(1, 1, 1), (0, 0, 0)])


def test_a_mesh_without_faces_is_refused():
    with pytest.raises(InvalidInputError, match="no faces"):
        label_cells(trimesh.Trimesh(), 0.1)


def test_cells_too_small_for_memory_are_refused_with_the_need(box):
    with pytest.raises(MapTooLargeError, match=r"1e-05 m needs .* GiB, the limit is 4\.0 GiB"):
        label_cells(box((0, 0, 0), (1, 1, 1)), 1e-5)
