"""Laws of what the map answers about points and boxes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError, MapTooLargeError
from stereogrid.grid import OccupancyGrid, State
from stereogrid.sensor_model import SensorModel

from .maps import every_cell, filled, known, random_map

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=8, deadline=None, derandomize=True)
thresholds = st.sampled_from([(0.5, None), (0.5, 0.5), (0.7, 0.3), (0.9, 0.0), (0.0, 0.0), (0.999, 0.999)])


def state_of(p, p_occupied, p_free):
    """The definition, for numbers."""
    free = p_occupied if p_free is None else p_free
    return np.select([p > p_occupied, p <= free], [State.OCCUPIED, State.FREE], State.UNKNOWN)


# States at points


@given(seed=seeds, limits=thresholds, clamp=st.sampled_from([4.0, None, (-2.0, 3.511)]))
@few
def test_the_state_follows_from_the_probability(seed, limits, clamp):
    p_occupied, p_free = limits
    grid = random_map(seed, clamp=clamp, model=SensorModel(prior=0.45))
    points = np.random.default_rng(seed).uniform(-5, 5, (2000, 3))
    expected = state_of(grid.probability(points), p_occupied, p_free)
    states = grid.state(points, p_occupied=p_occupied, p_free=p_free)
    assert states.dtype == np.int8
    np.testing.assert_array_equal(states, expected)
    assert (states == State.UNKNOWN).any()


def test_a_cell_just_at_the_threshold_is_free():
    grid = filled([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [0.0, 1 / 256, -1 / 256])
    points = [[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [0.6, 0.1, 0.1]]
    assert [str(State(s)) for s in grid.state(points)] == ["free", "occupied", "free"]
    assert [str(State(s)) for s in grid.state(points, p_free=0.49)] == ["unknown", "occupied", "unknown"]


@pytest.mark.filterwarnings("error")
def test_points_that_are_nowhere_are_unknown():
    grid = random_map(0)
    nowhere = [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf], [1e300, 0, 0]]
    assert (grid.state(nowhere) == State.UNKNOWN).all()
    assert grid.state(np.empty((0, 3))).shape == (0,)


@pytest.mark.parametrize("points", [[0.0, 0, 0], np.zeros((2, 2)), np.zeros((2, 3, 3))])
def test_points_of_another_shape_are_refused(points):
    with pytest.raises(InvalidInputError, match=r"points must be \(N, 3\)"):
        random_map(0).state(points)


@pytest.mark.parametrize(("p_occupied", "p_free"), [(1.0, None), (np.nan, None), (-0.1, None), (0.5, 0.6), (0.5, -1)])
def test_thresholds_that_are_no_probabilities_or_cross_are_refused(p_occupied, p_free):
    with pytest.raises(InvalidInputError, match=r"p_occupied|p_free"):
        random_map(0).state(np.zeros((1, 3)), p_occupied=p_occupied, p_free=p_free)


# Boxes


@given(seed=seeds)
@few
def test_a_dense_box_holds_what_the_map_answers_at_its_cells(seed):
    grid = random_map(seed)
    rng = np.random.default_rng(seed)
    low = rng.uniform(-6, 3, 3)
    box = grid.box(low, low + rng.uniform(0.01, 6, 3))
    cells = box.origin + np.stack(np.indices(box.probability.shape), axis=-1).reshape(-1, 3)
    p = grid.probability((cells + 0.5) * grid.cell_m)
    np.testing.assert_allclose(box.probability.ravel(), p, rtol=1e-6)
    np.testing.assert_array_equal(box.low_m, box.origin * grid.cell_m)


@given(low=st.integers(-200, 200), size=st.integers(1, 40), cell_m=st.sampled_from([0.1, 0.05, 0.3, 0.07]))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_box_of_whole_cells_has_exactly_these_whatever_the_rounding(low, size, cell_m):
    box = OccupancyGrid(cell_m).box(
        [low * cell_m] * 3, [(low + size) * cell_m, low * cell_m + cell_m, (low + 1) * cell_m]
    )
    assert box.origin.tolist() == [low] * 3
    assert box.probability.shape == (size, 1, 1)
    assert np.isnan(box.probability).all()


@given(seed=seeds, limits=thresholds)
@few
def test_counts_of_boxes_agree_with_a_walk_through_their_cells(seed, limits):
    p_occupied, p_free = limits
    grid, rng = random_map(seed), np.random.default_rng(seed)
    held = known(grid)
    low = rng.uniform(-5, 5, (40, 3))
    boxes = np.stack([low, low + rng.choice([0, 0.1, 1.0, 4.0], (40, 3))], axis=1)
    counts = grid.count_boxes(boxes, p_occupied=p_occupied, p_free=p_free)
    for n, (a, b) in enumerate(boxes):
        first, past = np.floor(a / 0.25).astype(int), np.ceil(b / 0.25).astype(int)
        cells = every_cell(first, np.maximum(past, first + 1))
        p = np.array([held.get(tuple(cell), np.nan) for cell in cells.tolist()])
        states = state_of(p, p_occupied, p_free)
        found = counts.n_occupied[n], counts.n_free[n], counts.n_unknown[n], counts.n_cells[n]
        assert found == (*((states == code).sum() for code in (State.OCCUPIED, State.FREE, State.UNKNOWN)), len(cells))
        largest = np.nan if np.isnan(p).all() else np.nanmax(p)
        np.testing.assert_equal(counts.max_probability[n], largest)


def test_boxes_far_from_the_map_and_without_volume_are_answered():
    grid = filled([[0, 0, 0]], 2.0)
    counts = grid.count_boxes([[[0.1] * 3, [0.1] * 3], [[900, 0, 0], [901, 1, 1]], [[-1e4] * 3, [1e4] * 3]])
    assert counts.n_occupied.tolist() == [1, 0, 1]
    assert counts.n_unknown.tolist() == [0, 64, 80000**3 - 1]
    empty = OccupancyGrid(0.1).count_boxes(np.zeros((2, 2, 3)))
    assert empty.n_unknown.tolist() == [1, 1]
    assert np.isnan(empty.max_probability).all()
    assert len(grid.count_boxes(np.empty((0, 2, 3))).n_cells) == 0


@pytest.mark.parametrize(
    ("boxes", "message"),
    [
        (np.zeros((2, 3)), r"\(N, 2, 3\)"),
        ([[[0, 0, 0], [1, 1, np.nan]]], "NaN"),
        ([[[0, 0, 0], [1, 1, np.inf]]], "infinite"),
        ([[[0, 0, 0], [1, -1, 1]]], "inverted"),
        ([[[-1e9] * 3, [1e9] * 3]], "too large"),
    ],
)
def test_boxes_that_cannot_be_meant_are_refused(boxes, message):
    with pytest.raises(InvalidInputError, match=message):
        random_map(0).count_boxes(boxes)


@pytest.mark.parametrize(("low", "high"), [((0, 0, 0), (1, 1, 0)), ((0, 0), (1, 1)), ((0, 0, np.nan), (1, 1, 1))])
def test_a_dense_box_needs_a_low_and_a_high_corner(low, high):
    with pytest.raises(InvalidInputError, match="box"):
        random_map(0).box(low, high)


def test_answers_larger_than_the_memory_limit_are_refused_in_one_line_that_names_it():
    grid = random_map(0, memory_limit_gb=0.001)
    for ask in (
        lambda: grid.box([0] * 3, [100] * 3),
        lambda: grid.distance_field([0] * 3, [30] * 3),
        lambda: grid.section(np.eye(4), (0, 1000), (0, 1000)),
        lambda: grid.refined(20),
    ):
        with pytest.raises(MapTooLargeError, match=r"needs [\d,.]+ GB, the map's memory_limit_gb is 0.001") as error:
            ask()
        assert "\n" not in str(error.value)


def test_the_bounds_hold_all_known_cells_and_no_row_more():
    grid = filled([[-9, 2, 3], [5, 1, 7]], [1.0, -1.0])
    low, high = grid.bounds_m()
    np.testing.assert_array_equal([low, high], [[-2.25, 0.25, 0.75], [1.5, 0.75, 2.0]])
    with pytest.raises(InvalidInputError, match="knows no cell"):
        OccupancyGrid(0.1).bounds_m()
