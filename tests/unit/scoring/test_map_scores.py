import numpy as np
import pytest
import trimesh

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_yaw, transform
from stereogrid.scoring import (
    INTERIOR,
    OCCUPIED,
    SCORE_NAMES,
    CellLabels,
    VisibleSet,
    label_cells,
    map_reliability,
    sample_cells,
    score_map,
)
from stereogrid.scoring.surface import SeenSurface

CELL_M = 0.1


@pytest.fixture(scope="module")
def mesh(box):
    return trimesh.util.concatenate(
        [box((0.03, 0.02, 0.04), (2.97, 1.48, 0.26)), box((1.03, 0.52, 0.26), (1.57, 0.98, 1.07))]
    )


@pytest.fixture(scope="module")
def labels(mesh):
    return label_cells(mesh, CELL_M, [(0, -0.5, -0.3), (3, 2, 2)])


@pytest.fixture(scope="module")
def visible(labels):
    """All but the solids, seen from 1 m."""
    depth = np.where(labels.label == INTERIOR, np.inf, 1.0).astype(np.float32)
    return VisibleSet(depth, np.ones(labels.label.shape, bool))


def values(scores):
    return {score.name: score.value for score in scores}


def noisy(labels, seed=0):
    """A fair map with unknown cells and clamps."""
    rng = np.random.default_rng(seed)
    mean = np.where(labels.label == OCCUPIED, 0.7, 0.2)
    p = np.round(np.clip(rng.normal(mean, 0.25), 0.03, 0.97), 2)
    return np.where(rng.random(p.shape) < 0.2, np.nan, p)


def test_every_score_is_in_the_table_with_its_unit(labels, visible, mesh, camera, array_map):
    scores = score_map(
        array_map(labels, noisy(labels)), labels, visible, seen=SeenSurface.of(mesh, labels, visible), camera=camera
    )
    assert [(s.name, s.unit) for s in scores] == [(name, unit) for name, (unit, _) in SCORE_NAMES.items()]
    assert np.isfinite([s.value for s in scores]).all()


def test_the_surface_is_scored_only_against_a_mesh(labels, visible, array_map):
    names = {s.name for s in score_map(array_map(labels, noisy(labels)), labels, visible)}
    assert "auc" in names and not any(name.endswith("_m") or "surface" in name for name in names)


def test_the_perfect_map_is_perfect(labels, visible, mesh, array_map):
    perfect = array_map(labels, (labels.label == OCCUPIED).astype(float))
    scores = values(score_map(perfect, labels, visible, seen=SeenSurface.of(mesh, labels, visible)))
    for name in ("auc", "average_precision", "occupied_f1", "occupied_iou", "coverage", "cell_accuracy"):
        assert scores[name] == 1
    for name in ("brier", "brier_balanced", "ece_width", "ece_count", "unsafe_occupied", "entropy"):
        assert scores[name] == pytest.approx(0, abs=1e-9)
    assert scores["log_loss"] < 2e-6
    for name in ("accuracy_m", "completeness_m", "surface_f1_5_cm"):
        assert scores[name] == scores[f"floor_{name}"]


def test_the_prior_alone_ranks_nothing(labels, visible, array_map):
    scores = values(score_map(array_map(labels, np.full(labels.label.shape, 0.5)), labels, visible))
    assert scores["auc"] == scores["auc_all"] == 0.5
    assert scores["brier_balanced"] == pytest.approx(0.25)
    assert scores["entropy"] == pytest.approx(1)
    assert scores["occupied_recall"] == 0


def test_an_empty_map_is_the_prior_over_all_and_undefined_where_touched(labels, visible, mesh, array_map):
    scores = values(
        score_map(
            array_map(labels, np.full(labels.label.shape, np.nan)),
            labels,
            visible,
            seen=SeenSurface.of(mesh, labels, visible),
        )
    )
    assert scores["coverage"] == 0 and scores["auc_all"] == 0.5 and scores["brier_all"] == pytest.approx(0.25)
    assert np.isnan(scores["auc"]) and np.isnan(scores["brier"]) and np.isnan(scores["accuracy_m"])


def test_abstaining_does_not_win(labels, visible, array_map):
    truth = labels.label == OCCUPIED
    knows_a_tenth = np.where(np.random.default_rng(0).random(truth.shape) < 0.1, truth, np.nan)
    scores = values(score_map(array_map(labels, knows_a_tenth), labels, visible))
    assert scores["auc"] == 1 and scores["auc_all"] < 0.65
    assert scores["coverage_occupied"] == pytest.approx(0.1, abs=0.05)


def test_unknown_cells_count_as_the_given_prior(labels, visible, array_map):
    unknown = array_map(labels, np.full(labels.label.shape, np.nan))
    scores = values(score_map(unknown, labels, visible, prior=0.1))
    assert scores["brier_balanced_all"] == pytest.approx((0.81 + 0.01) / 2)
    assert scores["unsafe_occupied"] == 1


def test_interior_cells_do_not_count(labels, visible, array_map):
    p = noisy(labels)
    other = np.where(labels.label == INTERIOR, 0.97, p)
    assert values(score_map(array_map(labels, p), labels, visible)) == pytest.approx(
        values(score_map(array_map(labels, other), labels, visible)), nan_ok=True
    )


def test_a_free_cell_beside_the_surface_is_forgiven_by_the_tolerant_scores_alone(labels, visible, array_map):
    truth = labels.label == OCCUPIED
    thick = truth.copy()
    for axis in range(3):
        thick |= np.roll(truth, 1, axis) | np.roll(truth, -1, axis)
    scores = values(score_map(array_map(labels, np.where(thick, 0.9, 0.1)), labels, visible))
    assert scores["occupied_precision"] < 0.7
    assert scores["occupied_f1_tolerant"] == scores["auc_tolerant"] == 1


def test_the_tolerance_is_two_standard_deviations_of_the_depth_where_that_exceeds_a_cell(box):
    labels = CellLabels(CELL_M, np.zeros(3, np.int64), np.zeros((60, 1, 1), np.uint8))
    labels.label[0] = OCCUPIED
    seen = VisibleSet(np.full((60, 1, 1), 4.0, np.float32), np.ones((60, 1, 1), bool))
    camera = StereoCamera(focal_px=320, cx_px=160, cy_px=120, baseline_m=0.1, width_px=320, height_px=240)

    class Blank:
        def probability(self, points_m):
            return np.full(len(points_m), 0.5)

        def occupied_centres(self):
            return np.empty((0, 3))

    # 2 dl = 2 * 4^2 * .5 / (.1 * 320) = .5 m, five cells.
    assert sample_cells(Blank(), labels, seen, camera=camera, sigma_px=0.5).near_surface.sum() == 5
    assert sample_cells(Blank(), labels, seen).near_surface.sum() == 1


def test_scores_do_not_change_when_the_world_is_rotated(labels, visible, mesh, camera, array_map):
    shift = np.array([12, -7, 3])
    T_new_old = from_yaw(np.pi / 2, shift * CELL_M)
    corners = transform(T_new_old, labels.bounds_m)
    turned_mesh = trimesh.Trimesh(transform(T_new_old, mesh.vertices), mesh.faces, process=False)
    turned = label_cells(turned_mesh, CELL_M, [corners.min(axis=0), corners.max(axis=0)])
    assert np.array_equal(turned.label, np.rot90(labels.label))
    seen = VisibleSet(np.rot90(visible.nearest_m), np.rot90(visible.in_view))
    p = noisy(labels)
    before = score_map(array_map(labels, p), labels, visible, seen=SeenSurface.of(mesh, labels, visible), camera=camera)
    after = score_map(
        array_map(turned, np.rot90(p)), turned, seen, seen=SeenSurface.of(turned_mesh, turned, seen), camera=camera
    )
    assert values(after) == pytest.approx(values(before), rel=1e-6, abs=1e-9)


def test_scores_are_the_same_run_after_run(labels, visible, mesh, array_map):
    grid = array_map(labels, noisy(labels))
    assert score_map(grid, labels, visible, seen=SeenSurface.of(mesh, labels, visible)) == score_map(
        grid, labels, visible, seen=SeenSurface.of(mesh, labels, visible)
    )


def test_the_reliability_diagram_counts_the_touched_visible_cells(labels, visible, array_map):
    p = noisy(labels)
    table = map_reliability(array_map(labels, p), labels, visible)
    assert table.count.sum() == (~np.isnan(p) & visible.mask).sum()


def test_a_visible_set_of_another_shape_is_refused(labels, array_map):
    other = VisibleSet(np.ones((2, 2, 2), np.float32), np.ones((2, 2, 2), bool))
    with pytest.raises(InvalidInputError, match=r"visible set is \(2, 2, 2\)"):
        score_map(array_map(labels, noisy(labels)), labels, other)


def test_a_world_of_which_nothing_is_visible_is_refused(labels, array_map):
    shape = labels.label.shape
    blind = VisibleSet(np.full(shape, np.inf, np.float32), np.zeros(shape, bool))
    with pytest.raises(InvalidInputError, match="nothing is visible"):
        score_map(array_map(labels, noisy(labels)), labels, blind)


def test_log_odds_in_place_of_probabilities_are_refused(labels, visible, array_map):
    with pytest.raises(InvalidInputError, match=r"in \[0, 1\]"):
        score_map(array_map(labels, noisy(labels) * 3 - 1), labels, visible)


@pytest.mark.parametrize("prior", [0.0, 1.0, -1.0, np.nan])
def test_a_prior_that_is_no_probability_is_refused(labels, visible, array_map, prior):
    with pytest.raises(InvalidInputError, match="prior"):
        score_map(array_map(labels, noisy(labels)), labels, visible, prior=prior)
