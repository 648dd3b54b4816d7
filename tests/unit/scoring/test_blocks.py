"""Intervals of one map's scores: blocks that are drawn again, seeded, around the score itself."""

import numpy as np
import pytest

from stereogrid.errors import InvalidInputError
from stereogrid.scoring import Score, scores_from_dict, scores_to_dict
from stereogrid.scoring.blocks import FEWEST_BLOCKS, BlockBootstrap, cell_scores
from stereogrid.scoring.calibration import brier, entropy_bit, log_loss
from stereogrid.scoring.map_scores import CellSample
from stereogrid.scoring.ranking import ranking_scores

BLOCKS = BlockBootstrap(1.0)
Bounds = dict[str, tuple[float, float]]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def drawn(rng: np.random.Generator, n_blocks: int = 40, n: int = 60) -> tuple[CellSample, np.ndarray]:
    """Cells of a map that is better in some blocks than in others, some of them untouched, and their centres."""
    block = np.repeat(np.arange(n_blocks), n)
    occupied = rng.random(len(block)) < 0.3
    skill = rng.uniform(0.2, 3.0, n_blocks)[block]
    p = 1 / (1 + np.exp(-(skill * (2 * occupied - 1) + rng.normal(size=len(block)))))
    p[rng.random(len(block)) < 0.1] = np.nan
    near = ~occupied & (rng.random(len(block)) < 0.1)
    x, y = block % 8 + rng.random(len(block)), block // 8 + rng.random(len(block))
    return CellSample(p, occupied, near), np.stack([x, y, rng.random(len(block))], axis=1)


def exact(cells: CellSample) -> dict[str, tuple[float, int]]:
    """Some scores of the cells as they are, by other code."""
    p, occupied, touched = cells.known(0.5), cells.occupied, cells.touched
    values = {f"{k}_all": v for k, v in ranking_scores(p, occupied).items()}
    values |= ranking_scores(p[touched], occupied[touched])
    values |= {"brier": brier(p, occupied)[touched].mean(), "log_loss_all": log_loss(p, occupied).mean()}
    values |= {"coverage": touched.mean(), "coverage_occupied": touched[occupied].mean()}
    values |= {"unsafe_occupied": (p[occupied] < 0.2).mean(), "entropy": entropy_bit(p).mean()}
    return {name: (float(value), len(p)) for name, value in values.items()}


def test_blocks_that_are_drawn_once_each_give_the_scores_of_the_map_itself(rng: np.random.Generator) -> None:
    cells, centres = drawn(rng)
    block, n = BLOCKS.block_of(centres)
    scores = cell_scores(cells, block, np.ones((1, n)), 0.5)
    for name, (value, _) in exact(cells).items():
        coarse = name.startswith(("auc", "average"))
        assert scores[name][0] == pytest.approx(value, abs=2e-3 if coarse else 1e-9), name


def test_a_block_that_is_drawn_twice_counts_as_two(rng: np.random.Generator) -> None:
    cells, centres = drawn(rng)
    block, n = BLOCKS.block_of(centres)
    weights = np.ones((1, n))
    weights[0, 3] = 2
    again = np.concatenate([np.arange(len(block)), np.flatnonzero(block == 3)])
    twice = CellSample(cells.p[again], cells.occupied[again], cells.near_surface[again])
    scores = cell_scores(cells, block, weights, 0.5)
    for name, (value, _) in exact(twice).items():
        assert scores[name][0] == pytest.approx(value, abs=2e-3), name


def bounds_of(cells: CellSample, centres: np.ndarray, blocks: BlockBootstrap = BLOCKS) -> Bounds:
    known = set(exact(cells))
    values = dict.fromkeys(cell_scores(cells, *_one_block(cells), 0.5), (0.0, 1)) | exact(cells)
    found = blocks.of_cells(cells, centres, prior=0.5, values=values)
    return {name: bounds for name, bounds in found.items() if name in known}


def _one_block(cells: CellSample) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(len(cells.p), np.int64), np.ones((1, 1))


def test_an_interval_holds_its_score_and_is_the_same_each_time(rng: np.random.Generator) -> None:
    cells, centres = drawn(rng)
    bounds = bounds_of(cells, centres)
    assert bounds == bounds_of(cells, centres)
    assert bounds != bounds_of(cells, centres, BlockBootstrap(1.0, seed=1))
    for name, (value, _) in exact(cells).items():
        low, high = bounds[name]
        assert low < value < high


def test_more_cells_in_the_same_blocks_are_no_more_evidence(rng: np.random.Generator) -> None:
    cells, centres = drawn(rng)
    fine = CellSample(*(np.repeat(each, 4) for each in (cells.p, cells.occupied, cells.near_surface)))
    of_few, of_many = bounds_of(cells, centres), bounds_of(fine, np.repeat(centres, 4, axis=0))
    assert of_many["brier"] == pytest.approx(of_few["brier"])
    assert of_many["occupied_f1"] == pytest.approx(of_few["occupied_f1"])


def test_intervals_of_independent_blocks_hold_the_truth_about_as_often_as_they_say() -> None:
    n, held = 20, 0
    large, _ = drawn(np.random.default_rng(99), n_blocks=1500)
    true = exact(large)["brier"][0]
    for seed in range(n):
        low, high = bounds_of(*drawn(np.random.default_rng(seed), n=20), BlockBootstrap(1.0, resamples=150))["brier"]
        held += low <= true <= high
    assert held >= 0.85 * n


def test_few_blocks_give_no_interval(rng: np.random.Generator) -> None:
    assert bounds_of(*drawn(rng, n_blocks=FEWEST_BLOCKS - 1)) == {}
    assert bounds_of(*drawn(rng, n_blocks=FEWEST_BLOCKS)) != {}


def test_distances_get_intervals_of_their_means(rng: np.random.Generator) -> None:
    points = rng.uniform(0, 6, size=(900, 3)), rng.uniform(0, 6, size=(700, 3))
    distances = rng.exponential(0.03, 900), rng.exponential(0.05, 700)
    means = {"accuracy_m": distances[0].mean(), "completeness_m": distances[1].mean()}
    means |= {"chamfer_m": sum(means.values()) / 2}
    shares = {f"surface_f1_{n}": 0.9 for n in ("1_cell", "2_cells", "5_cm", "10_cm", "20_cm")}
    values = {name: (float(value), 900) for name, value in (means | shares).items()}
    bounds = BLOCKS.of_surface(points, distances, cell_m=0.05, values=values)
    for name, value in means.items():
        low, high = bounds[name]
        assert low < value < high
        assert high - low == pytest.approx(4 * value / np.sqrt(800), rel=0.6)
    assert BLOCKS.of_surface((np.empty((0, 3)), points[1]), distances, cell_m=0.05, values=values) == {}


def test_a_block_has_a_size() -> None:
    with pytest.raises(InvalidInputError, match="block_m must be positive"):
        BlockBootstrap(0.0)


def test_an_interval_is_kept_with_its_score_and_old_files_without_one_are_read() -> None:
    scores = [Score("auc", 0.9, "1", 5, 0.85, 0.93), Score("accuracy_m", 0.02, "m", 7)]
    plain = scores_to_dict(scores)
    assert plain["auc"] == {"value": 0.9, "unit": "1", "n": 5, "low": 0.85, "high": 0.93}
    assert plain["accuracy_m"] == {"value": 0.02, "unit": "m", "n": 7}
    assert scores_from_dict(plain) == scores


@pytest.mark.parametrize(("low", "high"), [(0.5, None), (None, 0.5), (0.6, 0.5)])
def test_an_interval_has_two_ends_in_order(low: float | None, high: float | None) -> None:
    with pytest.raises(InvalidInputError, match="an interval"):
        Score("auc", 0.5, "1", 5, low, high)
