"""A map that may lie elsewhere: probabilities are averaged over where, by the law of total probability."""

import numpy as np
import pytest
from scipy.ndimage import convolve
from scipy.stats import norm

from stereogrid.errors import InvalidInputError, MapTooLargeError
from stereogrid.grid import OccupancyGrid
from stereogrid.grid.spread import PLACES, _places
from stereogrid.sensor_model import SensorModel, log_odds

CELL_M = 0.1
ORIGIN = (0.0, 0.0)


def room(size=40, threads=None, **options):
    """Free space with a wall at x = 0 and a post; known throughout."""
    cells = np.argwhere(np.ones((size, size, 3))) - [size // 2, size // 2, 0]
    p = np.full(len(cells), 0.01)
    p[cells[:, 0] == 0] = 0.99
    p[(cells[:, :2] == [12, 5]).all(axis=1)] = 0.99
    return OccupancyGrid.from_cells(CELL_M, cells, log_odds(p), threads=threads, **options)


def p_at(grid, cells):
    return grid.probability((np.asarray(cells) + 0.5) * CELL_M)


def of(x=0.0, y=0.0, turn=0.0):
    return np.diag(np.square([x, y, turn]))


@pytest.mark.parametrize("n", [n for _, n in PLACES])
def test_the_places_have_the_covariance_that_they_stand_for(n):
    sigma = np.array([[0.04, 0.01, 0.001], [0.01, 0.02, -0.002], [0.001, -0.002, 0.0005]])
    places = _places(sigma, n)
    np.testing.assert_allclose(places.mean(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(np.cov(places.T, bias=True), sigma, atol=1e-12)


def test_a_map_that_lies_where_it_was_drawn_stays_as_it_is():
    grid = room()
    assert grid.spread(np.zeros((3, 3)), ORIGIN).sha256() == grid.sha256()


def test_a_wall_is_found_in_each_cell_as_often_as_it_lies_there():
    sigma_m = 0.2
    k = np.arange(-4, 5)
    found = p_at(room().spread(of(x=sigma_m), ORIGIN), [[x, -10, 1] for x in k])
    # A shift of s moves the wall's cell by s rounded to cells.
    share = norm.cdf((k + 0.5) * CELL_M, scale=sigma_m) - norm.cdf((k - 0.5) * CELL_M, scale=sigma_m)
    np.testing.assert_allclose(found, 0.01 + 0.98 * share, atol=0.03)


def test_a_wall_does_not_change_when_it_slides_along_itself():
    found = p_at(room().spread(of(y=0.2), ORIGIN), [[x, -10, 1] for x in (-1, 0, 1)])
    np.testing.assert_allclose(found, [0.01, 0.99, 0.01], atol=2e-3)


def test_a_turn_smears_what_is_far_from_the_axis_and_across_the_line_to_it():
    grid = room(80)
    post = np.array([12, 5])
    turned = grid.spread(of(turn=0.1), tuple((post + 0.5 - [20, 0]) * CELL_M))
    # 2 m away along x, .1 rad: .2 m along y.
    across, along = (p_at(turned, [[*(post + step), 1]])[0] for step in ([0, 2], [2, 0]))
    assert across > 0.06
    assert along < 0.03
    about_itself = grid.spread(of(turn=0.1), tuple((post + 0.5) * CELL_M))
    assert p_at(about_itself, [[*post, 1]])[0] > 0.95


def test_the_expected_number_of_occupied_cells_stays():
    grid = room()
    inner = np.argwhere(np.ones((20, 20, 3))) - [10, 10, 0]
    spread = grid.spread(of(x=0.1, y=0.1), ORIGIN)
    assert np.nansum(p_at(spread, inner)) == pytest.approx(p_at(grid, inner).sum(), rel=0.02)


def test_no_cell_is_surer_than_the_surest_was():
    spread = room().spread(of(x=0.15, y=0.1, turn=0.02), ORIGIN)
    _, p = spread.known_cells()
    assert p.min() >= 0.0099
    assert p.max() <= 0.9901


def test_it_agrees_with_a_convolution_where_nothing_turns():
    grid = room()
    spread = grid.spread(of(x=0.25, y=0.1), ORIGIN)
    moves = _places(of(x=0.25, y=0.1), PLACES[-1][1])[:, :2] / CELL_M
    kernel = np.zeros((21, 21, 1))
    # Cell c looks up the cell that holds c + 1/2 - move.
    np.add.at(kernel, (*(10 - np.floor(0.5 - moves)).astype(int).T, 0), 1 / len(moves))
    cells = np.argwhere(np.ones((40, 40, 3))) - [20, 20, 0]
    p = p_at(grid, cells).reshape(40, 40, 3)
    inner = (slice(12, 28), slice(12, 28), slice(None))
    found = p_at(spread, cells).reshape(p.shape)
    np.testing.assert_allclose(found[inner], convolve(p, kernel, mode="nearest")[inner], atol=2e-3)


def test_unknown_stays_unknown_where_the_map_mostly_does_not_reach():
    spread = room().spread(of(x=0.2), ORIGIN)
    assert np.isnan(p_at(spread, [[23, 0, 1]])).all()
    assert np.isfinite(p_at(spread, [[17, 0, 1]])).all()


def test_the_result_does_not_depend_on_the_threads():
    maps = [room(threads=threads).spread(of(0.2, 0.1, 0.05), (1.0, 0.3)).sha256() for threads in (1, 2, 3)]
    assert len(set(maps)) == 1


def test_a_cell_that_says_nothing_goes_on_saying_nothing_when_laid_into_a_map():
    model = SensorModel(prior=0.3)
    cells = np.argwhere(np.ones((20, 20, 2)))
    neutral = OccupancyGrid.from_cells(CELL_M, cells, np.full(len(cells), log_odds(0.3)), model=model)
    before = OccupancyGrid.from_cells(CELL_M, cells, np.linspace(-3, 3, len(cells)), model=model)
    after = before.crop([-np.inf] * 3, [np.inf] * 3)
    after.merge(neutral.spread(of(0.2, 0.2), (1.0, 1.0)))
    np.testing.assert_allclose(p_at(after, [[10, 10, 1]]), p_at(before, [[10, 10, 1]]), atol=2e-3)


@pytest.mark.parametrize(
    ("covariance", "about_m", "culprit"),
    [
        (np.eye(2), ORIGIN, r"covariance must be \(3, 3\)"),
        (np.full((3, 3), np.nan), ORIGIN, "finite"),
        (np.diag([1.0, -1.0, 0.0]), ORIGIN, "positive semidefinite; it has the eigenvalue -1"),
        (np.array([[1.0, 0.5, 0], [0, 1.0, 0], [0, 0, 1.0]]), ORIGIN, "symmetric"),
        (np.eye(3), (0.0, np.inf), "about_m"),
        (np.eye(3), (0.0, 0.0, 0.0), "about_m"),
    ],
)
def test_what_is_no_covariance_or_no_place_is_refused(covariance, about_m, culprit):
    with pytest.raises(InvalidInputError, match=culprit):
        room(8).spread(covariance, about_m)


def test_a_spread_beyond_the_memory_limit_is_refused_before_room_is_made():
    with pytest.raises(MapTooLargeError, match=r"a map of .* cells needs"):
        room(memory_limit_gb=0.5).spread(of(x=500.0), ORIGIN)


def test_an_empty_map_stays_empty():
    assert len(OccupancyGrid(CELL_M).spread(np.eye(3), ORIGIN).blocks) == 0
