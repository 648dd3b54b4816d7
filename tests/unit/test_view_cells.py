"""The cells of a page: at every moment, at every size, in every box, and beside the truth."""

import numpy as np
import pytest
import trimesh
from browsers import until

from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, Array, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.scoring import FREE, INTERIOR, OCCUPIED, CellLabels, VisibleSet
from stereogrid.scoring.truth import MapTruth
from stereogrid.viewer.beside_truth import FALSE, MISSED, TRUE, UNJUDGED, BesideTruth
from stereogrid.viewer.cell_blocks import UNKNOWN, CellBlocks
from stereogrid.viewer.cells_drawn import Ages, legend_of
from stereogrid.viewer.controls import Choices
from stereogrid.viewer.history import History
from stereogrid.viewer.judging import Judging, below
from stereogrid.viewer.snapshot import Snapshot

CELL_M = 0.1
CAMERA = StereoCamera(170, 79.5, 59.5, 0.06, 160, 120)


def random_grid(seed: int, n: int = 300, reach: int = 20) -> OccupancyGrid:
    rng = np.random.default_rng(seed)
    cells = np.unique(rng.integers(-reach, reach, (n, 3)), axis=0)
    return OccupancyGrid.from_cells(CELL_M, cells, rng.normal(0, 2, len(cells)))


def grown(n: int) -> tuple[OccupancyGrid, list[Snapshot]]:
    """A map made of n others, and how it was after each."""
    grid, moments = OccupancyGrid(CELL_M), []
    for seed in range(n):
        grid.merge(random_grid(seed))
        moments.append(Snapshot.of(grid))
    return grid, moments


def same(cells: CellBlocks, snapshot: Snapshot) -> bool:
    return np.array_equal(cells.values, snapshot.values()) and np.array_equal(cells.indices, snapshot.indices)


def rows(cells: Array) -> set[tuple[int, ...]]:
    return {tuple(map(int, row)) for row in cells}


def test_the_map_of_every_moment_comes_back_as_it_was() -> None:
    _, moments = grown(6)
    history = History(6)
    for number, snapshot in enumerate(moments):
        history.add(number, snapshot, (b"left", bytes([number])))
    for number in (5, 0, 3, 1, 4, 2):
        cells = history.cells(number)
        assert cells is not None and same(cells, moments[number])
        assert history.pictures(number) == (number, (b"left", bytes([number])))
    assert history.cells(-1) is None and history.pictures(-1) is None


def test_a_cell_bears_the_last_observation_that_changed_it() -> None:
    _, moments = grown(5)
    history = History(5)
    expected: dict[tuple[int, int], int] = {}
    before = np.full((0, 512), UNKNOWN)
    for number, snapshot in enumerate(moments):
        history.add(number, snapshot)
        values = snapshot.values()
        old = np.full_like(values, UNKNOWN)
        old[: len(before)] = before
        expected |= {(int(row), int(place)): number for row, place in zip(*np.nonzero(values != old), strict=True)}
        before = values
        cells = history.cells(number)
        assert cells is not None and cells.changed is not None
        assert all(cells.changed[at] == last for at, last in expected.items())


def test_beyond_its_memory_a_history_keeps_fewer_moments_each_as_it_was() -> None:
    n = 40
    _, moments = grown(n)
    history = History(n, limit_bytes=4_000_000)
    whole = History(n)
    for number, snapshot in enumerate(moments):
        whole.add(number, snapshot)
        if history.wants(number):
            history.add(number, snapshot)
        assert history.n_bytes <= 4_000_000
    assert whole.n_bytes > 4_000_000 and history.every > 1
    numbers = history.numbers()
    assert numbers[-1] == n - 1 and len(numbers) < n
    for number in numbers:
        cells = history.cells(number)
        assert cells is not None and same(cells, moments[number])
    between = history.cells(numbers[2] - 1)
    assert between is not None and same(between, moments[numbers[1]])


@pytest.mark.parametrize("most", [900, 450, 216])
def test_cells_that_are_too_many_are_drawn_as_the_coarser_map_has_them(most: int) -> None:
    grid = random_grid(1, n=6000, reach=20)
    drawn = Snapshot.of(grid).cells().fitting(most)
    assert drawn.coarser > 1 and drawn.count_above(0.5) <= most
    for p in (0.5, 0.8):
        centres = drawn.centres_m(drawn.select(p).cells)
        expected = grid.coarsened(drawn.coarser).occupied_centres(p)
        assert rows(np.rint(centres * 1000)) == rows(np.rint(expected * 1000))
    assert Snapshot.of(grid).cells().fitting(100_000).coarser == 1


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("keep_lower", [True, False])
def test_a_slice_hides_one_side_of_it_and_the_heights_hide_the_rest(axis: str, keep_lower: bool) -> None:
    cells = Snapshot.of(random_grid(1)).cells()
    choices = Choices(0.5, (-1.2, 1.0), slice_axis=axis, slice_m=0.31, keep_lower=keep_lower)
    drawn = cells.centres_m(cells.select(0.5, choices.box(CELL_M)).cells)
    centres = cells.centres_m(cells.select(0.5).cells)
    along = centres[:, "xyz".index(axis)]
    side = along < 0.3 if keep_lower else along > 0.4
    expected = centres[side & (centres[:, 2] > -1.2) & (centres[:, 2] < 1.0)]
    assert 0 < len(drawn) < len(centres)
    assert rows(np.rint(drawn * 1000)) == rows(np.rint(expected * 1000))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_layer_is_what_the_map_says_there(axis: int) -> None:
    grid = random_grid(3, n=3000, reach=12)
    cells = Snapshot.of(grid).cells()
    values, first = cells.layer(axis, -3)
    index = np.stack(np.meshgrid(*(np.arange(n) for n in values.shape), indexing="ij"), axis=-1).reshape(-1, 2) + first
    points = (np.insert(index, axis, -3, axis=1) + 0.5) * CELL_M
    p = grid.probability(points)
    assert np.isnan(p).any() and np.isfinite(p).any()
    assert np.allclose(cells.probability(values).ravel(), p, atol=1e-3, equal_nan=True)
    assert cells.layer(axis, 1000)[0].size == 0


def test_beside_the_truth_every_cell_is_right_wrong_missed_or_hidden() -> None:
    rng = np.random.default_rng(7)
    label = rng.choice([FREE, OCCUPIED, INTERIOR], (12, 10, 8)).astype(np.uint8)
    seen = rng.random(label.shape) < 0.6
    labels = CellLabels(CELL_M, np.array([-5, -4, -3]), label)
    nearest = np.where(seen, 1.0, np.inf).astype(np.float32)
    beside = BesideTruth(MapTruth(trimesh.creation.box(), CAMERA, labels, VisibleSet(nearest, seen)))
    grid = random_grid(5, n=900, reach=8)
    found = Snapshot.of(grid).cells().select(0.5)
    cells, kinds = beside.judge(found)
    occupied = rows(found.cells)
    expected = {}
    for at in np.ndindex(label.shape):
        cell = tuple(int(each) for each in np.array(at) + labels.origin_index)
        if seen[at] and cell in occupied:
            expected[cell] = TRUE if label[at] == OCCUPIED else FALSE
        elif seen[at] and label[at] == OCCUPIED:
            expected[cell] = MISSED
    expected |= {cell: UNJUDGED for cell in occupied if cell not in expected}
    assert {tuple(map(int, c)): int(k) for c, k in zip(cells, kinds, strict=True)} == expected
    assert set(kinds.tolist()) == {TRUE, FALSE, MISSED, UNJUDGED} and len(cells) == len(expected)


def test_of_the_true_mesh_what_lies_above_the_heights_is_left_out() -> None:
    box = trimesh.creation.box((2, 2, 2))
    corners, faces = below(box, 0.5)
    assert len(faces) == len(box.faces) - 2
    assert corners[faces][..., 2].min(axis=1).max() < 0.5


def test_coarser_cells_bear_the_latest_change_within_them() -> None:
    _, moments = grown(5)
    history = History(5)
    for number, snapshot in enumerate(moments):
        history.add(number, snapshot)
    cells = history.cells(4)
    assert cells is not None and cells.changed is not None
    fine = cells.select(0.0)  # all that is known
    assert fine.changed is not None and len(set(fine.changed.tolist())) == 5
    for most in (400, 100):
        drawn = cells.fitting(most)
        assert drawn.coarser > 1
        found = drawn.select(0.5)
        latest: dict[tuple[int, ...], int] = {}
        for cell, number in zip((fine.cells // drawn.coarser).tolist(), fine.changed.tolist(), strict=True):
            latest[tuple(cell)] = max(latest.get(tuple(cell), 0), number)
        assert found.changed is not None and len(found.cells)
        assert found.changed.tolist() == [latest[tuple(cell)] for cell in found.cells.tolist()]


@pytest.mark.parametrize(("total", "unit"), [(0xFFFF, 1), (0x10000, 2), (200_000, 4)])
def test_of_a_long_drive_ages_are_counted_in_so_many_observations_that_two_bytes_hold_them(
    total: int, unit: int
) -> None:
    history = History(total)
    assert history.unit == unit
    _, moments = grown(2)
    history.add(0, moments[0])
    history.add(total - 1, moments[1])
    cells = history.cells(total - 1)
    assert cells is not None and cells.changed is not None
    assert cells.changed.max() == (total - 1) // unit <= 0xFFFF
    ages = Ages(unit, (total - 1) // unit)
    last = int(legend_of(Choices(0.5, (0, 1), colour="age"), ages).rpartition("<span>")[2].partition("<")[0])
    assert total - unit < last <= total


class Claims:
    """A recording of which only the truth matters."""

    camera = CAMERA

    def __init__(self) -> None:
        self.asked = 0

    def true_poses(self) -> Array:
        return np.stack([from_rotation(R_BASE_OPTICAL, [0.1 * n, 0.0, 0.0]) for n in range(2)])

    def truth_mesh_ply(self) -> bytes:
        self.asked += 1
        ply: bytes = self._ply()
        return ply

    def _ply(self) -> bytes:
        box = trimesh.creation.box((1, 8, 8))
        box.apply_translation([2.53, 0, 0])
        wall = trimesh.creation.box((0.3, 0.3, 0.3)).apply_translation([1.03, 0.02, 0.01])
        return trimesh.util.concatenate([box, wall]).export(file_type="ply")  # type: ignore[no-any-return]


def prepared(judging: Judging, range_m: float) -> BesideTruth:
    until(lambda: judging.beside(CELL_M, range_m))
    found = judging.beside(CELL_M, range_m)
    assert found is not None
    return found


def test_the_truth_within_one_range_is_never_taken_for_that_within_another() -> None:
    pytest.importorskip("embreex")
    judging = Judging(Claims())  # type: ignore[arg-type]
    near = prepared(judging, 1.5)
    assert judging.beside(CELL_M, 1.5) is near
    assert judging.beside(CELL_M, 4.0) is None  # it is to be prepared first
    far = prepared(judging, 4.0)
    assert far is not near and len(far._to_find) > 2 * len(near._to_find)


class Broken(Claims):
    """Its truth leads to an error that nobody foresaw."""

    def _ply(self) -> bytes:
        raise RuntimeError("a parser stumbled")


def test_a_truth_that_cannot_be_prepared_is_tried_once() -> None:
    recording = Broken()
    judging = Judging(recording)  # type: ignore[arg-type]
    until(lambda: judging.beside(CELL_M, 1.5) or judging.fault)
    for _ in range(20):
        assert judging.beside(CELL_M, 1.5) is None
    assert judging.fault == "RuntimeError('a parser stumbled')" and recording.asked == 1
