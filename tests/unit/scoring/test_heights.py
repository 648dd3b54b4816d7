"""Heights above the ground, which need not be level, and the obstacles that are told by them."""

import numpy as np
import pytest
import trimesh

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.scoring.heights import ground_height_m
from stereogrid.scoring.labels import label_cells
from stereogrid.scoring.truth import MapTruth
from stereogrid.scoring.visibility import VisibleSet

CELL_M = 0.1
SLOPE = 0.1
FORWARD = from_rotation(R_BASE_OPTICAL)


def ramp(box):
    """Ground that climbs along x by SLOPE, with a closed bottom, and z = 0 at x = 0."""
    ground = box([-4, -4, -2], [4, 4, 0])
    top = ground.vertices[:, 2] == 0
    ground.vertices[top, 2] = SLOPE * ground.vertices[top, 0]
    return ground


@pytest.fixture(scope="module")
def mesh(box):
    post, table = box([1.0, 1.0, -0.5], [1.3, 1.3, 1.5]), box([-2, -2, 0.6], [-1, -1, 0.7])
    return trimesh.util.concatenate([ramp(box), post, table])


def test_the_ground_is_the_lowest_surface_that_faces_upwards(mesh):
    labels = label_cells(mesh, CELL_M)
    nx, ny, _ = labels.label.shape
    x_m = (labels.origin_index[0] + np.arange(nx) + 0.5) * CELL_M
    ground_m = ground_height_m(mesh, labels)
    inside = np.abs(x_m) < 4
    # Neither under the table nor through the post is there anything lower that faces upwards.
    for row in ground_m[:, ny // 2], ground_m[:, ny // 4], ground_m[:, ny // 2 + 11]:
        np.testing.assert_allclose(row[inside], SLOPE * x_m[inside], atol=1e-5)
        assert np.isnan(row[~inside]).all()


def truth_of(mesh, camera):
    labels = label_cells(mesh, CELL_M)
    seen = VisibleSet(np.ones(labels.label.shape, np.float32), np.ones(labels.label.shape, bool))
    return MapTruth(mesh, camera, labels, seen)


def test_obstacles_are_told_by_their_height_above_the_ground_below_them(mesh, camera):
    part = truth_of(mesh, camera).above_ground(0.2, 1.0)
    centres = part.labels.centres_m(part.visible.mask)
    height_m = centres[:, 2] - SLOPE * centres[:, 0]
    assert height_m.min() == pytest.approx(0.2, abs=0.011)
    assert height_m.max() == pytest.approx(1.0, abs=0.011)
    # Each column over the ground is there, however high it lies: 80 x 80 columns of 8 cells, of .8 m.
    assert len(centres) == pytest.approx(80 * 80 * 8, rel=0.03)


def test_on_level_ground_heights_above_it_are_heights(box, camera):
    mesh = trimesh.util.concatenate([box([-2, -2, -0.5], [2, 2, 0]), box([1, 0, 0], [1.2, 1, 1])])
    truth = truth_of(mesh, camera)
    by_height, by_ground = truth.between(0.15, 0.8), truth.above_ground(0.15, 0.8)
    np.testing.assert_array_equal(by_height.labels.label, by_ground.labels.label)
    over = np.isfinite(ground_height_m(mesh, truth.labels))
    np.testing.assert_array_equal(by_height.visible.mask & over[..., None], by_ground.visible.mask)


def test_a_mesh_without_ground_is_refused(camera):
    ceiling = trimesh.Trimesh([[0, 0, 2], [0, 1, 2], [1, 0, 2]], [[0, 1, 2]], process=False)
    with pytest.raises(InvalidInputError, match="faces upwards"):
        truth_of(ceiling, camera).above_ground(0.1, 1.0)
