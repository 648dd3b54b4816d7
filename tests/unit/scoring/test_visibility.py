import sys

import numpy as np
import pytest
import trimesh

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError, MissingExtraError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw, inverse, transform
from stereogrid.scoring import INTERIOR, OCCUPIED, label_cells, visible_cells

CELL_M = 0.1
T_BASE_CAM = from_rotation(R_BASE_OPTICAL)
LOOK_ALONG_X = from_rotation(R_BASE_OPTICAL, (0.05, 0.05, 1.05))
ROOM_M = np.array([(0, -3, 0), (5, 3, 2)])


@pytest.fixture(scope="module", autouse=True)
def _embree():
    pytest.importorskip("embreex", reason="the visible set casts rays with embreex")


@pytest.fixture(scope="module")
def wall(box):
    """A board 40 cm thick, 2 m in front of the eye, that covers the middle of the view."""
    return box((2.03, -0.55, 0.3), (2.43, 0.55, 1.8))


@pytest.fixture(scope="module")
def labels(wall):
    return label_cells(wall, CELL_M, ROOM_M)


def at(labels, array, *point_m):
    return array[tuple(labels.index_of(np.array(point_m)))]


def test_a_wall_hides_what_is_behind_it_and_nothing_in_front(labels, wall, camera):
    seen = visible_cells(labels, wall, camera, LOOK_ALONG_X[None], max_range_m=4.5)
    assert at(labels, seen.mask, 1.05, 0.05, 1.05) and at(labels, seen.mask, 1.95, 0.05, 1.05)
    assert at(labels, seen.mask, 2.05, 0.05, 1.05), "the wall's own face is seen"
    assert not at(labels, seen.mask, 2.65, 0.05, 1.05)
    assert not at(labels, seen.mask, 3.95, 0.05, 1.05)
    assert at(labels, seen.mask, 3.95, 1.95, 1.05), "past its edge one sees farther"


def test_what_is_hidden_is_still_in_view_and_what_is_outside_the_image_is_not(labels, wall, camera):
    seen = visible_cells(labels, wall, camera, LOOK_ALONG_X[None], max_range_m=4.5)
    assert at(labels, seen.in_view, 3.95, 0.05, 1.05)
    assert not at(labels, seen.in_view, 1.05, 1.95, 1.05)
    assert (seen.in_view | ~seen.mask).all()


def test_nothing_inside_a_solid_is_seen(labels, wall, camera):
    seen = visible_cells(labels, wall, camera, LOOK_ALONG_X[None], max_range_m=4.5)
    assert (labels.label == INTERIOR).any()
    assert not seen.mask[labels.label == INTERIOR].any()


def test_nothing_beyond_the_range_is_seen(labels, wall, camera):
    seen = visible_cells(labels, wall, camera, LOOK_ALONG_X[None], max_range_m=1.5)
    range_m = np.linalg.norm(labels.centres_m(seen.mask) - LOOK_ALONG_X[:3, 3], axis=1)
    assert 1.4 < range_m.max() <= 1.5


def test_the_nearest_depth_is_the_depth_of_the_nearest_view(labels, wall, camera):
    nearer = LOOK_ALONG_X.copy()
    nearer[0, 3] += 0.7
    poses = np.stack([LOOK_ALONG_X, nearer])
    seen = visible_cells(labels, wall, camera, poses, max_range_m=4.5)
    assert at(labels, seen.nearest_m, 1.95, 0.05, 1.05) == pytest.approx(1.2)
    assert at(labels, seen.nearest_m, 0.25, 0.05, 1.05) == pytest.approx(0.2)
    assert np.isinf(at(labels, seen.nearest_m, 3.95, 0.05, 1.05))


def test_a_cell_that_only_one_eye_sees_is_not_in_the_visible_set(box):
    camera = StereoCamera(focal_px=80, cx_px=79.5, cy_px=59.5, baseline_m=0.6, width_px=160, height_px=120)
    board = box((1.01, -2.0, 0.0), (1.11, 0.06, 2.0))
    labels = label_cells(board, CELL_M, ROOM_M)
    beyond = (3.05, 0.75, 1.05)
    left_eye, right_eye = LOOK_ALONG_X[:3, 3], transform(LOOK_ALONG_X, [0.6, 0, 0])
    y_at_board = [eye[1] + (beyond[1] - eye[1]) * (1.06 - eye[0]) / (3.05 - eye[0]) for eye in (left_eye, right_eye)]
    assert y_at_board[0] > 0.2 and y_at_board[1] < 0, "the board's edge parts the two rays"
    one_eyed = StereoCamera(80, 79.5, 59.5, 1e-3, 160, 120)
    assert at(labels, visible_cells(labels, board, one_eyed, [LOOK_ALONG_X], max_range_m=4).mask, *beyond)
    both = visible_cells(labels, board, camera, [LOOK_ALONG_X], max_range_m=4)
    assert at(labels, both.in_view, *beyond) and not at(labels, both.mask, *beyond)


def test_the_left_edge_of_the_left_image_is_not_in_the_right_one(labels, wall, camera):
    seen = visible_cells(labels, wall, camera, LOOK_ALONG_X[None], max_range_m=4.5)
    u, _, d = camera.project(transform(inverse(LOOK_ALONG_X), labels.centres_m(seen.mask))).T
    rim = 1e-6
    assert (u - d >= -0.5 - rim).all() and (u < camera.width_px - 0.5 + rim).all()


@pytest.fixture(scope="module")
def poses():
    """Off the lattice of the cells, so that no centre lies on the rim of an image but for rounding."""
    headings = ((0.013, 0.1171), (0.617, 0.513), (-0.419, 1.0271))
    return np.stack([from_yaw(yaw_rad, (x, -0.2137, 1.0243)) @ T_BASE_CAM for yaw_rad, x in headings])


def test_the_visible_set_of_several_poses_is_the_union_of_theirs(labels, wall, camera, poses):
    together = visible_cells(labels, wall, camera, poses, max_range_m=4)
    alone = [visible_cells(labels, wall, camera, [T], max_range_m=4) for T in poses]
    assert np.array_equal(together.mask, np.any([v.mask for v in alone], axis=0))
    assert np.array_equal(together.in_view, np.any([v.in_view for v in alone], axis=0))
    assert np.array_equal(together.nearest_m, np.min([v.nearest_m for v in alone], axis=0))


def test_the_visible_set_turns_and_moves_with_the_world(labels, wall, camera, poses):
    T_new_old = from_yaw(np.pi / 2, (20 * CELL_M, -31 * CELL_M, 7 * CELL_M))
    corners = transform(T_new_old, ROOM_M)
    turned_mesh = trimesh.Trimesh(transform(T_new_old, wall.vertices), wall.faces, process=False)
    turned = label_cells(turned_mesh, CELL_M, [corners.min(axis=0), corners.max(axis=0)])
    before = visible_cells(labels, wall, camera, poses, max_range_m=4).mask
    after = visible_cells(turned, turned_mesh, camera, T_new_old @ poses, max_range_m=4).mask
    assert np.array_equal(np.rot90(before), after)


def test_interpolated_depths_agree_with_a_ray_to_every_centre(labels, wall, camera, poses):
    floor = trimesh.creation.box(extents=(10, 10, 0.1), transform=trimesh.transformations.translation_matrix((2, 0, 0)))
    mesh = trimesh.util.concatenate([wall, floor])
    labels = label_cells(mesh, CELL_M, ROOM_M)
    seen = visible_cells(labels, mesh, camera, poses[:1], max_range_m=4).mask
    exact = np.zeros_like(seen)
    index = np.argwhere(labels.label != INTERIOR)
    centres = labels.centres_m(labels.label != INTERIOR)
    u, v, d = camera.project(transform(inverse(poses[0]), centres)).T
    inside = (u - d >= -0.5) & (u < 159.5) & (v >= -0.5) & (v < 119.5) & (d > 0)
    for x_m in (0.0, camera.baseline_m):
        eye = transform(poses[0], [x_m, 0, 0])
        hits, rays, _ = mesh.ray.intersects_location(np.tile(eye, (inside.sum(), 1)), centres[inside] - eye)
        first = np.full(inside.sum(), np.inf)
        np.minimum.at(first, rays, np.linalg.norm(hits - eye, axis=1))
        range_m = np.linalg.norm(centres[inside] - eye, axis=1)
        near_enough = np.linalg.norm(centres[inside] - poses[0][:3, 3], axis=1) <= 4
        inside[inside] = near_enough & (first >= range_m - np.sqrt(3) / 2 * CELL_M)
    exact[tuple(index[inside].T)] = True
    occupied = labels.label == OCCUPIED
    assert (seen != exact).sum() < 0.01 * exact.sum()
    assert ((seen != exact) & occupied).sum() < 0.03 * (exact & occupied).sum()


def test_progress_counts_the_poses(labels, wall, camera, poses):
    calls = []
    visible_cells(labels, wall, camera, poses, max_range_m=2, progress=lambda *done: calls.append(done))
    assert calls == [(1, 3), (2, 3), (3, 3)]


def test_a_bad_pose_is_named(labels, wall, camera, poses):
    with pytest.raises(InvalidInputError, match="pose 1 contains NaN"):
        visible_cells(labels, wall, camera, [poses[0], poses[1] * np.nan], max_range_m=2)


def test_a_senseless_range_is_refused(labels, wall, camera, poses):
    with pytest.raises(InvalidInputError, match="max_range_m"):
        visible_cells(labels, wall, camera, poses, max_range_m=0)


def test_without_embreex_the_extra_is_named(labels, wall, camera, poses, monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    with pytest.raises(MissingExtraError, match=r"pip install stereogrid\[score\]"):
        visible_cells(labels, wall, camera, poses, max_range_m=2)
