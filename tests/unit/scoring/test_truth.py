"""One truth for all maps of a drive: labels, visible set and scores from the recording's own mesh and poses."""

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError, RecordingError, StereogridError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.scoring import SCORE_NAMES, scores_to_dict
from stereogrid.scoring.labels import OCCUPIED, label_cells
from stereogrid.scoring.truth import KnowsTruth, MapTruth, load_ply

FORWARD = from_rotation(R_BASE_OPTICAL)
CELL_M = 0.1


class Drive:
    """A recording of which only the truth matters."""

    def __init__(self, camera, mesh, poses):
        self.camera, self._mesh, self._poses = camera, mesh, poses

    def true_poses(self):
        return self._poses

    def truth_mesh_ply(self):
        return None if self._mesh is None else self._mesh.export(file_type="ply")


@pytest.fixture(scope="module")
def wall(box):
    """A wall 2 m ahead, 0.2 m thick, not on the borders of cells."""
    return box([2.03, -2, -2], [2.23, 2, 2])


@pytest.fixture(scope="module")
def drive(camera, wall):
    return Drive(camera, wall, np.stack([FORWARD, from_rotation(R_BASE_OPTICAL, [0.2, 0.1, 0])]))


@pytest.fixture(scope="module")
def truth(drive):
    return MapTruth.of_recording(drive, CELL_M, max_range_m=5)


def perfect(truth, array_map):
    return array_map(truth.labels, np.where(truth.labels.label == OCCUPIED, 0.9, 0.1))


def by_name(scores):
    return {score.name: score.value for score in scores}


def test_the_labels_are_those_of_the_recordings_mesh(truth, wall):
    expected = label_cells(wall, CELL_M)
    np.testing.assert_array_equal(truth.labels.label, expected.label)
    np.testing.assert_array_equal(truth.labels.origin_index, expected.origin_index)


def test_the_wall_is_seen_from_the_front_only(truth):
    seen = truth.labels.centres_m(np.isfinite(truth.visible.nearest_m))
    assert len(seen) > 100
    assert seen[:, 0].max() < 2.1
    occupied = truth.labels.centres_m(np.isfinite(truth.visible.nearest_m) & (truth.labels.label == OCCUPIED))
    np.testing.assert_allclose(occupied[:, 0], 2.05)


def test_without_any_true_pose_there_is_nothing_to_score_against(camera, wall):
    """As in a part of a recording in which the true poses are missing."""
    with pytest.raises(RecordingError, match="of no observation the true pose is known"):
        MapTruth.of_recording(Drive(camera, wall, np.full((3, 4, 4), np.nan)), CELL_M, max_range_m=5, around_path=True)


def test_an_observation_without_a_true_pose_is_left_out(drive, camera, wall, truth):
    with_hole = np.concatenate([drive.true_poses(), np.full((1, 4, 4), np.nan)])[[2, 0, 1]]
    other = MapTruth.of_recording(Drive(camera, wall, with_hole), CELL_M, max_range_m=5)
    np.testing.assert_array_equal(other.visible.nearest_m, truth.visible.nearest_m)


def test_a_perfect_map_scores_one_and_its_negative_nothing(truth, array_map):
    best = by_name(truth.score(perfect(truth, array_map)))
    assert best["auc"] == best["occupied_f1"] == best["coverage"] == 1
    assert best["brier"] == pytest.approx(0.01)
    worst = by_name(truth.score(array_map(truth.labels, 1 - perfect(truth, array_map).p)))
    assert worst["auc"] == 0
    assert worst["brier"] == pytest.approx(0.81)


def test_every_score_has_a_meaning_and_its_unit(truth, array_map):
    scores = truth.score(perfect(truth, array_map))
    assert {score.name: score.unit for score in scores} == {name: unit for name, (unit, _) in SCORE_NAMES.items()}


def test_without_the_surface_the_other_scores_are_the_same(truth, array_map):
    grid = perfect(truth, array_map)
    everything, less = by_name(truth.score(grid)), by_name(truth.score(grid, surface=False))
    assert set(everything) - set(less) >= {"accuracy_m", "completeness_m"}
    for name, value in less.items():
        np.testing.assert_equal(everything[name], value)


def test_the_reliability_diagram_counts_the_cells_that_were_seen_and_mapped(truth, array_map):
    table = truth.reliability(perfect(truth, array_map))
    known = np.isfinite(truth.visible.nearest_m)
    assert table.count.sum() == known.sum()
    full = table.count > 0
    np.testing.assert_array_equal(table.frequency[full], [0, 1])


@pytest.mark.parametrize(("low_m", "high_m"), [(-0.3, 0.3), (-np.inf, np.inf), (0.04, 0.06)])
def test_layers_of_the_truth_hold_the_cells_between_two_heights_as_they_were(truth, low_m, high_m):
    part = truth.between(low_m, high_m)
    mask = np.ones(part.labels.label.shape, dtype=bool)
    centres = part.labels.centres_m(mask)
    assert (centres[:, 2] >= low_m).all()
    assert (centres[:, 2] <= high_m).all()
    everywhere = truth.labels.centres_m(np.ones(truth.labels.label.shape, dtype=bool))
    assert len(centres) == ((everywhere[:, 2] >= low_m) & (everywhere[:, 2] <= high_m)).sum()
    at = tuple(truth.labels.index_of(centres).T)
    np.testing.assert_array_equal(part.labels.label[mask], truth.labels.label[at])
    np.testing.assert_array_equal(part.visible.nearest_m[mask], truth.visible.nearest_m[at])
    np.testing.assert_array_equal(part.visible.in_view[mask], truth.visible.in_view[at])


def test_layers_where_there_is_nothing_are_refused(truth):
    with pytest.raises(InvalidInputError, match="between 50 and 60 m"):
        truth.between(50, 60)


def test_the_section_is_the_walls_outline_at_that_height(truth):
    segments = truth.section_m(0.5)
    np.testing.assert_allclose(segments[:, :, 2], 0.5)
    ends = segments[:, :, :2].reshape(-1, 2)
    np.testing.assert_allclose([ends.min(axis=0), ends.max(axis=0)], [[2.03, -2], [2.23, 2]], atol=1e-6)
    lengths = np.linalg.norm(np.diff(segments[:, :, :2], axis=1), axis=-1).sum()
    assert lengths == pytest.approx(2 * (4 + 0.2), rel=1e-6)
    assert truth.section_m(9.0).shape == (0, 2, 3)


# Without a truth


class NoTruth:
    camera = None


def test_a_recording_without_a_truth_cannot_be_scored_against(camera, wall):
    for recording in (
        NoTruth(),
        None,
        Drive(camera, None, FORWARD[None]),
        Drive(camera, wall, None),
    ):
        with pytest.raises(RecordingError, match="no true mesh and poses"):
            MapTruth.of_recording(recording, CELL_M, max_range_m=5)
    assert isinstance(Drive(camera, wall, None), KnowsTruth)
    assert not isinstance(NoTruth(), KnowsTruth)


def test_a_mesh_comes_back_from_its_ply(wall):
    back = load_ply(wall.export(file_type="ply"))
    np.testing.assert_allclose(back.vertices, wall.vertices, atol=1e-6)
    np.testing.assert_array_equal(back.faces, wall.faces)


def test_points_without_triangles_are_refused():
    cloud = trimesh.PointCloud(np.eye(3)).export(file_type="ply")
    with pytest.raises(RecordingError, match="true mesh"):
        load_ply(cloud)


@given(data=st.data())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_a_damaged_ply_is_refused_or_read_and_nothing_else(data, wall):
    ply = bytearray(wall.export(file_type="ply"))
    ply = ply[: data.draw(st.integers(0, len(ply)))]
    for _ in range(data.draw(st.integers(0, 3))):
        if ply:
            ply[data.draw(st.integers(0, len(ply) - 1))] = data.draw(st.integers(0, 255))
    try:
        mesh = load_ply(bytes(ply))
    except RecordingError:
        return
    assert isinstance(mesh, trimesh.Trimesh)


@given(ply=st.binary(max_size=80))
@example(b"")
@example(b"ply\n")
@example(b"ply\nformat ascii 1.0\nend_header\n")
@example(b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n")
@settings(max_examples=100, deadline=None, derandomize=True)
def test_what_is_no_ply_is_refused(ply):
    with pytest.raises(StereogridError):
        load_ply(ply)


def test_an_empty_mesh_has_no_labels():
    with pytest.raises(InvalidInputError, match="no faces"):
        label_cells(trimesh.Trimesh(), CELL_M)


def test_labels_around_the_path_alone_see_and_score_the_same(camera, wall, box, array_map):
    far = trimesh.util.concatenate([wall, box([14, -1, -1], [15, 1, 1])])
    poses = np.stack([FORWARD, from_rotation(R_BASE_OPTICAL, [0.2, 0.1, 0])])
    whole, part = (
        MapTruth.of_recording(Drive(camera, far, poses), CELL_M, max_range_m=5, around_path=around)
        for around in (False, True)
    )
    assert part.labels.label.size < 0.5 * whole.labels.label.size
    every = array_map(whole.labels, np.random.default_rng(0).random(whole.labels.label.shape))
    assert scores_to_dict(part.score(every)) == scores_to_dict(whole.score(every))
    assert by_name(part.score(every))["coverage"] == 1
