"""Maps made of cells, and maps added to maps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError, MapTooLargeError
from stereogrid.grid import OccupancyGrid, compose
from stereogrid.sensor_model import SensorModel

from .scenes import contents, drive, empty, mapped

MODEL = SensorModel(prior=0.4, max_range_m=3.0)


def saved(grid, folder):
    return grid.save(folder / "map.sgrid").read_bytes()


def halves(seed, n=4, **options):
    """The map of a drive, and the maps of its two halves."""
    poses, disparities = drive(seed, n)
    half = n // 2
    return (
        mapped(poses, disparities, **options),
        mapped(poses[:half], disparities[:half], **options),
        mapped(poses[half:], disparities[half:], **options),
    )


# A map of cells


@given(seed=st.integers(0, 2**32 - 1), clamp=st.sampled_from([4.0, (-2.0, 3.511), None]))
def test_a_map_of_cells_holds_them_and_nothing_else(seed, clamp):
    rng = np.random.default_rng(seed)
    cells = np.unique(rng.integers(-(10**6), 10**6, (50, 3)) // rng.integers(1, 10**5), axis=0)
    log_odds, counts = rng.uniform(-6, 6, len(cells)), rng.integers(1, 4000, len(cells))
    order = rng.permutation(len(cells))
    grid = OccupancyGrid.from_cells(0.1, cells[order], log_odds[order], counts[order], clamp=clamp, model=MODEL)
    low, high = grid.clamp or (-np.inf, np.inf)
    found, values, n_updates = contents(grid)
    np.testing.assert_array_equal(found, cells)
    np.testing.assert_array_equal(n_updates, counts)
    # Rounded to 1 / 256 nat, clamped to limits that are themselves rounded.
    np.testing.assert_allclose(values, np.clip(log_odds, low, high), atol=1 / 512 + 1e-6)


def test_a_map_taken_apart_into_its_cells_is_the_same_map_when_put_together(tmp_path):
    for options in ({}, {"clamp": None}, {"model": MODEL}):
        grid = mapped(*drive(5), **options)
        again = OccupancyGrid.from_cells(0.1, *contents(grid), **{"model": grid.model, "clamp": grid.clamp})
        assert saved(again, tmp_path) == saved(grid, tmp_path)


def test_a_map_of_no_cells_is_empty():
    assert OccupancyGrid.from_cells(0.1, [], []).n_known == 0
    assert OccupancyGrid.from_cells(0.1, np.zeros((0, 3), int), np.zeros(0)).n_known == 0


CELLS = np.array([[0, 0, 0], [1, 0, 0]])


@pytest.mark.parametrize(
    ("cells", "log_odds", "n_updates", "culprit"),
    [
        (CELLS.astype(float), [1, 2], 1, r"cells must be integers \(N, 3\), not float64"),
        (CELLS[:, :2], [1, 2], 1, r"cells must be integers \(N, 3\), not int64 \(2, 2\)"),
        (CELLS[0], [1], 1, "cells must be integers"),
        (CELLS + 2**60, [1, 2], 1, "within"),
        (CELLS, [1], 1, r"log_odds must be \(2,\), one a cell, not \(1,\)"),
        (CELLS, 1.0, 1, "log_odds"),
        (CELLS, [1, np.nan], 1, "log_odds must be finite"),
        (CELLS, [1, -np.inf], 1, "log_odds must be finite"),
        (CELLS, [1, 2], 0, "n_updates"),
        (CELLS, [1, 2], [1, 0], "n_updates"),
        (CELLS, [1, 2], [1, 2, 3], "n_updates"),
        (CELLS, [1, 2], 1.5, "n_updates"),
        (CELLS[[0, 1, 0]], [1, 2, 3], 1, "1 of 3 cells occur more than once"),
    ],
)
def test_cells_that_make_no_map_are_refused(cells, log_odds, n_updates, culprit):
    with pytest.raises(InvalidInputError, match=culprit):
        OccupancyGrid.from_cells(0.1, cells, log_odds, n_updates)


def test_cells_that_would_fill_more_than_the_memory_limit_are_refused_before_they_are_stored():
    scattered = np.arange(3 * 2000).reshape(-1, 3) * 100
    with pytest.raises(MapTooLargeError, match="the map would grow to"):
        OccupancyGrid.from_cells(0.1, scattered, np.zeros(2000), memory_limit_gb=1e-3)


# Maps added to maps


@pytest.mark.parametrize("fusion", ["cell", "sum_of_rays"])
def test_without_a_clamp_two_halves_of_a_drive_merge_into_the_whole_drive_bit_by_bit(tmp_path, monkeypatch, fusion):
    monkeypatch.setattr(compose, "PIECE_BLOCKS", 7)
    whole, first, second = halves(11, clamp=None, fusion=fusion)
    first.merge(second)
    assert saved(first, tmp_path) == saved(whole, tmp_path)


@pytest.mark.parametrize("clamp", [4.0, (-2.0, 3.511), None])
def test_maps_merge_in_any_order_to_the_same_bytes(tmp_path, clamp):
    _, first, second = halves(12, clamp=clamp)
    _, other_first, other_second = halves(12, clamp=clamp)
    first.merge(second)
    other_second.merge(other_first)
    assert saved(first, tmp_path) == saved(other_second, tmp_path)


def test_merged_log_odds_and_counts_are_the_sums_and_the_clamp_holds():
    _, first, second = halves(13)
    cells = np.unique(np.concatenate([contents(first)[0], contents(second)[0]]), axis=0)
    (a, n_a), (b, n_b) = first.blocks.at(cells), second.blocks.at(cells)
    first.merge(second)
    values, counts = first.blocks.at(cells)
    np.testing.assert_array_equal(values, np.clip(a + b, -4, 4))
    np.testing.assert_array_equal(counts, n_a + n_b)
    assert first.n_known == len(cells)


def test_the_other_map_and_an_empty_one_change_nothing(tmp_path):
    _, first, second = halves(14)
    before, other_before = saved(first, tmp_path), saved(second, tmp_path)
    first.merge(empty())
    assert saved(first, tmp_path) == before
    nothing = empty()
    nothing.merge(first)
    assert saved(nothing, tmp_path) == before
    first.merge(second)
    assert saved(second, tmp_path) == other_before


def test_a_map_merged_with_itself_has_seen_everything_twice():
    grid = mapped(*drive(15), clamp=None)
    _, values, counts = contents(grid)
    grid.merge(grid)
    np.testing.assert_array_equal(contents(grid)[1], 2 * values)
    np.testing.assert_array_equal(contents(grid)[2], 2 * counts)


@pytest.mark.parametrize(
    ("options", "culprit"),
    [
        ({"cell_m": 0.2}, "different cells cannot be merged: 0.1 m and 0.2 m"),
        ({"model": MODEL}, "different prior cannot be merged: 0.5 and 0.4"),
        ({"clamp": 3.0}, r"different clamp cannot be merged: \(-6.0, 6.0\) and \(-3.0, 3.0\)"),
        ({"clamp": None}, "different clamp .* and None"),
        ({"fusion": "sum_of_rays"}, "different fusion cannot be merged: cell and sum_of_rays"),
    ],
)
def test_maps_that_do_not_fit_are_refused_and_left_as_they_were(tmp_path, options, culprit):
    grid, other = mapped(*drive(16, 1)), mapped(*drive(17, 1), **options)
    before, other_before = saved(grid, tmp_path), saved(other, tmp_path)
    with pytest.raises(InvalidInputError, match=culprit):
        grid.merge(other)
    assert (saved(grid, tmp_path), saved(other, tmp_path)) == (before, other_before)


def test_a_merge_beyond_the_memory_limit_is_refused_and_leaves_the_map_as_it_was(tmp_path):
    grid, other = mapped(*drive(18, 1)), mapped(*drive(19, 1))
    before = saved(grid, tmp_path)
    grid.memory_limit_gb = (grid.n_bytes + 2048) / 1e9
    with pytest.raises(MapTooLargeError, match="the map would grow to"):
        grid.merge(other)
    assert saved(grid, tmp_path) == before
