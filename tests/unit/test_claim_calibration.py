"""Calibration over many drives, on made-up bins whose answer is known."""

import numpy as np
import pytest

from experiments.claim_bins import KINDS
from experiments.claim_calibration import bins_of, calibration_of, calibration_table, calibrations, expected_error
from experiments.claim_config import NOISES, ClaimConfig, arm_of
from experiments.claim_statistics import THESE, Cell, Values
from experiments.claim_units import Unit
from stereogrid.scoring import Score
from stereogrid.scoring.calibration import BINS

MEAN_P = (np.arange(BINS) + 0.5) / BINS
WORLDS = ("corridor", "office", "entrance")


def bins(frequency, count=200.0):
    """(3, 10) of a map whose bins hold count cells each and are occupied that often."""
    return count * np.stack([np.ones(BINS), MEAN_P, np.broadcast_to(frequency, BINS)])


def drives(n, rng, *, bias=0.0, chance=0.1):
    """By seed: what is off in all drives, and what one pose error does to all cells of one drive."""
    return {seed: bins(MEAN_P + bias + chance * rng.standard_normal(BINS)) for seed in range(n)}


def units(found):
    """{(world, way, seed): (3, 10)} as the units of an experiment."""
    return {
        Unit(world, "independent", seed, "cell", way): [
            Score(f"bin_{kind}_{k}", float(table[row, k]), "1", 1)
            for row, kind in enumerate(KINDS)
            for k in range(BINS)
        ]
        for (world, way, seed), table in found.items()
    }


def test_what_is_chance_in_each_drive_is_gone_over_many_and_what_is_wrong_in_all_stays():
    rng = np.random.default_rng(0)
    honest, wrong = drives(400, rng), drives(400, rng, bias=0.05)
    assert np.mean([expected_error(each) for each in honest.values()]) > 0.06
    found = calibration_of({"a": wrong}, {"a": honest})
    assert found.error["a"] == pytest.approx(0.05, abs=0.01)
    assert found.difference["a"].mean == pytest.approx(0.05, abs=0.01)
    assert found.difference["a"].low > 0


def test_arms_are_paired_by_seed_even_where_a_unit_is_missing():
    """Each drive is off by its own amount, in both arms alike: paired, there is no difference at all."""
    rng = np.random.default_rng(1)
    both = {(world, seed): bins(MEAN_P + rng.uniform(-0.2, 0.2)) for world in WORLDS for seed in (1, 2, 3, 4)}
    found = {(world, way, seed): each for (world, seed), each in both.items() for way in ("none", "rss")}
    del found["office", "none", 1], found["office", "rss", 3]
    values = Values(units(found))
    arms = [bins_of(values, Cell("independent", "cell", way, "")) for way in ("rss", "none")]
    difference = calibration_of(*arms).difference
    assert {world: each.n for world, each in difference.items()} == dict(
        zip((*WORLDS, THESE), (4, 2, 4, 2), strict=True)
    )
    for each in difference.values():
        assert (each.mean, each.low, each.high) == (0, 0, 0)


@pytest.mark.parametrize("worlds", [1, 3])
def test_intervals_hold_the_expected_difference_of_so_many_seeds_also_where_an_arm_errs_by_chance_alone(worlds):
    """An honest map in which a drive's pose error shows much, against one that is wrong in every drive alike."""
    rng, found = np.random.default_rng(2), []
    for _ in range(100):
        # A seed draws the same errors in every world.
        honest = dict.fromkeys(map(str, range(worlds)), drives(10, rng, chance=0.15))
        wrong = dict.fromkeys(map(str, range(worlds)), drives(10, rng, bias=0.05, chance=0.03))
        found.append(calibration_of(honest, wrong).difference[THESE])
    expected = np.mean([each.mean for each in found])
    assert np.mean([each.low <= expected <= each.high for each in found]) >= 0.9
    # Nor are they so wide as to hold anything: half as wide again as what all the sets say, for t and for chance.
    width = np.mean([each.high - each.low for each in found])
    assert width < 1.75 * 2 * 1.96 * np.std([each.mean for each in found])


def test_of_one_seed_there_is_no_interval():
    one = {"a": {1: bins(MEAN_P + 0.1)}}
    difference = calibration_of(one, {"a": {1: bins(MEAN_P)}}).difference
    assert difference["a"].mean == pytest.approx(0.1)
    assert np.isnan([difference[world].low for world in ("a", THESE)]).all()


def test_the_table_stars_an_arm_that_is_better_in_every_drive():
    config = ClaimConfig(
        n_seeds=3, bound_seeds=3, fusions=("cell",), noises=NOISES[:1], arms=(arm_of("none"), arm_of("rss"))
    )
    off = {"none": 0.1, "rss": 0.02}
    found = {(w, way, s): bins(MEAN_P + off[way]) for w in WORLDS for s in (1, 2, 3) for way in off}
    table = calibration_table(config, calibrations(config, Values(units(found))))
    assert [row[2] for row in table.rows] == [*WORLDS, THESE]
    assert table.rows[-1][3:] == ["0.1000", "0.0200 (-0.0800 [-0.0800, -0.0800] *)"]
