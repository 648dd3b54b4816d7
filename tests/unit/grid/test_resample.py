"""Laws of maps made from maps: parts, and larger and smaller cells."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.grid import resample
from stereogrid.sensor_model import SensorModel

from .maps import known, random_map
from .scenes import contents

seeds = st.integers(0, 2**32 - 1)
clamps = st.sampled_from([4.0, (-2.0, 3.511), None])
few = settings(max_examples=7, deadline=None, derandomize=True)
OPTIONS = {"fusion": "sum_of_rays", "memory_limit_gb": 1.5, "model": SensorModel(prior=0.4, max_range_m=3)}


def words(grid):
    """{cell: word}"""
    cells, _ = grid.blocks.known()
    return dict(zip(map(tuple, cells.tolist()), grid.blocks.words_at(cells).tolist(), strict=True))


# Parts


@given(seed=seeds, clamp=clamps)
@few
def test_a_part_keeps_the_words_of_the_cells_whose_centres_it_holds_and_no_others(seed, clamp):
    grid, rng = random_map(seed, clamp=clamp), np.random.default_rng(seed)
    low = rng.uniform(-4, 3, 3)
    high = low + rng.uniform(0.1, 5, 3)
    part = grid.crop(low, high)
    inside = {
        c: w
        for c, w in words(grid).items()
        if all(low <= (np.array(c) + 0.5) * 0.25) and all((np.array(c) + 0.5) * 0.25 < high)
    }
    assert words(part) == inside
    assert len(part.blocks) == len({tuple(np.array(c) // 8) for c in inside})


@given(seed=seeds, cut=st.integers(-10, 10))
@few
def test_parts_on_either_side_of_a_cut_make_the_whole(seed, cut):
    grid = random_map(seed)
    # Through the centres of a layer of cells: they belong to the upper part.
    z = (cut + 0.5) * 0.25
    below = grid.crop([-np.inf] * 3, [np.inf, np.inf, z])
    above = grid.crop([-np.inf, -np.inf, z], [np.inf] * 3)
    assert not words(below).keys() & words(above).keys()
    assert words(below) | words(above) == words(grid)


@pytest.mark.parametrize(
    ("low", "high"), [([0, 0, 0], [1, 0, 1]), ([0, 0, 2], [1, 1, 1]), ([0, 0, np.nan], [1, 1, 1]), ([0, 0], [1, 1])]
)
def test_a_part_without_volume_is_refused(low, high):
    with pytest.raises(InvalidInputError, match="box"):
        random_map(0).crop(low, high)


# Larger and smaller cells


@given(seed=seeds, factor=st.integers(1, 5), clamp=clamps)
@few
def test_a_larger_cell_has_the_largest_probability_and_count_of_its_children(seed, factor, clamp):
    grid = random_map(seed, clamp=clamp, **OPTIONS)
    parents = {}
    for cell, value, count in zip(*contents(grid), strict=True):
        parents.setdefault(tuple((cell // factor).tolist()), []).append((value, count))
    larger = grid.coarsened(factor)
    assert larger.cell_m == factor * grid.cell_m
    assert {tuple(cell) for cell in contents(larger)[0].tolist()} == parents.keys()
    for cell, value, count in zip(*contents(larger), strict=True):
        values, counts = zip(*parents[tuple(cell.tolist())], strict=True)
        assert (value, count) == (max(values), max(counts))


@given(seed=seeds)
@few
def test_asking_a_coarse_map_is_asking_its_cells_for_their_largest_probability(seed):
    grid = random_map(seed)
    larger = grid.coarsened(3)
    cells, p = larger.known_cells()
    boxes = np.stack([cells * 0.75, (cells + 1) * 0.75], axis=1)
    np.testing.assert_array_equal(grid.count_boxes(boxes).max_probability, p)


@given(seed=seeds, clamp=clamps)
@few
def test_twice_and_then_thrice_as_large_is_six_times_as_large(seed, clamp):
    grid = random_map(seed, clamp=clamp)
    assert words(grid.coarsened(2).coarsened(3)) == words(grid.coarsened(6)) == words(grid.coarsened(3).coarsened(2))


def test_a_map_in_many_pieces_of_work_is_coarsened_alike(monkeypatch):
    grid = random_map(4)
    whole = words(grid.coarsened(3))
    monkeypatch.setattr(resample, "BLOCKS_AT_ONCE", 2)
    assert words(grid.coarsened(3)) == whole


@given(seed=seeds, factor=st.integers(1, 3), clamp=clamps)
@few
def test_smaller_cells_answer_as_the_one_they_lie_in_and_make_it_again(seed, factor, clamp):
    grid = random_map(seed, clamp=clamp, **OPTIONS)
    smaller = grid.refined(factor)
    points = np.random.default_rng(seed).uniform(-5, 5, (3000, 3))
    np.testing.assert_array_equal(smaller.probability(points), grid.probability(points))
    np.testing.assert_array_equal(smaller.n_updates(points), grid.n_updates(points))
    assert smaller.n_known == grid.n_known * factor**3
    assert words(smaller.coarsened(factor)) == words(grid)


@pytest.mark.parametrize(
    "make", [lambda g: g.crop([-1] * 3, [1] * 3), lambda g: g.coarsened(2), lambda g: g.refined(2)]
)
@pytest.mark.parametrize("clamp", [3.0, (-2.0, 3.511), None])
def test_a_map_made_from_a_map_goes_on_as_that_one_does_and_leaves_it_as_it_was(make, clamp):
    grid = random_map(7, clamp=clamp, **OPTIONS)
    before = known(grid)
    made = make(grid)
    for name in ("model", "fusion", "clamp", "memory_limit_gb"):
        assert getattr(made, name) == getattr(grid, name)
    made.blocks.words[:] = 0
    assert known(grid) == before


@pytest.mark.parametrize("factor", [0, -2, 1.5, True, 10**6])
def test_a_factor_that_is_no_whole_number_is_refused(factor):
    for make in (random_map(0).coarsened, random_map(0).refined):
        with pytest.raises(InvalidInputError, match="factor"):
            make(factor)
