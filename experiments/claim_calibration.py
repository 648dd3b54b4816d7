"""Are the probabilities frequencies over many drives? Reliability summed over the seeds, and its expected error.

One drive has one pose error, which all of its cells share: where a wall may lie in any of five cells it lies in one,
and a map that rightly says .2 of each is off in all of them. What one drive's ECE holds against it is mostly chance,
the more so the more honest the map; summed over many draws of the error the chance is gone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm, t

from stereogrid.geometry import FloatArray
from stereogrid.report import ReportTable
from stereogrid.scoring.calibration import BINS
from stereogrid.scoring.paired import RESAMPLES, Interval

from .claim_bins import KINDS, PREFIX
from .claim_config import ClaimConfig
from .claim_statistics import THESE, Cell, Values
from .compared import BOOTSTRAP_SEED, interval_text


def bins_of(values: Values, cell: Cell) -> dict[str, dict[int, FloatArray]]:
    """By world and seed: (3, 10) of KINDS."""
    found: dict[str, dict[int, FloatArray]] = {}
    for row, kind in enumerate(KINDS):
        for k in range(BINS):
            for world, seeds in values.seeds(replace(cell, score=f"{PREFIX}{kind}_{k}")).items():
                for seed, value in seeds.items():
                    of_seed = found.setdefault(world, {}).setdefault(seed, np.zeros((len(KINDS), BINS)))
                    of_seed[row, k] = value
    return found


def expected_error(bins: FloatArray) -> FloatArray:
    """ECE (...,) of sums (3, 10, ...)."""
    n, p, occupied = bins
    error: FloatArray = np.abs(p - occupied).sum(axis=0) / n.sum(axis=0)
    return error


@dataclass(frozen=True)
class Calibration:
    """ECE over the seeds of an arm, and how much higher it is than the reference arm's, by world and over THESE."""

    error: Mapping[str, float]
    difference: Mapping[str, Interval]


Bins = Mapping[str, Mapping[int, FloatArray]]


def calibration_of(bins: Bins, reference: Bins) -> Calibration:
    """Of one arm and the reference, both by world and seed (3, 10), of the seeds that both have.

    Intervals: over resampled seeds, the same for both arms and in every world, as a seed draws the same errors in all
    of them; see `_interval`.
    """
    errors: dict[str, float] = {}
    intervals: dict[str, Interval] = {}
    deviations = []
    for world in (world for world in bins if world in reference):
        seeds = sorted({*bins[world]} & {*reference[world]})
        if not seeds:
            continue
        n = len(seeds)
        mine, other = (np.stack([each[world][seed] for seed in seeds], axis=-1) for each in (bins, reference))
        # How often each seed is drawn, (n, resamples): sums over seeds become products of matrices.
        rng = np.random.default_rng(BOOTSTRAP_SEED)
        times = rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLES // 5).T.astype(float)
        errors[world] = float(expected_error(mine.sum(axis=2)))
        mean = errors[world] - float(expected_error(other.sum(axis=2)))
        # Few seeds vary too little among themselves, as in scoring.paired.
        deviation = (expected_error(mine @ times) - expected_error(other @ times) - mean) * np.sqrt(n / max(n - 1, 1))
        deviations.append(deviation)
        intervals[world] = _interval(mean, deviation, n)
    if errors:
        errors[THESE] = float(np.mean(list(errors.values())))
        mean = float(np.mean([each.mean for each in intervals.values()]))
        intervals[THESE] = _interval(mean, np.mean(deviations, axis=0), min(each.n for each in intervals.values()))
    return Calibration(errors, intervals)


def _interval(mean: float, deviation: FloatArray, seeds: int) -> Interval:
    """Around the mean, as far as resampled ones deviate from their own mean: where the mean lies over other such seeds.

    Chance adds to an ECE (it is of absolute values), and resampling adds it once more: plain percentiles lie off by
    that, and over worlds, where it does not average out, they miss. Centred ones hold the expected difference of so
    many seeds in 95 to 99 % of the cases (6 and 20 seeds, 1 and 3 worlds); the chance in both ECE stays in the mean.
    """
    if seeds < 2:
        return Interval(mean, np.nan, np.nan, seeds)
    tail = norm.cdf(t.ppf(0.025, seeds - 1))
    low, high = np.quantile(deviation - deviation.mean(), [tail, 1 - tail])
    return Interval(mean, mean + float(low), mean + float(high), seeds)


Calibrations = Mapping[tuple[str, str, str], Calibration]
"""By noise, rule of fusion and arm."""


def calibrations(config: ClaimConfig, values: Values) -> Calibrations:
    """Of every arm, each beside the reference."""
    found = {}
    for noise in config.noises:
        for fusion in config.fusions:
            reference = bins_of(values, Cell(noise.name, fusion, config.reference, ""))
            for arm in (config.reference, *config.others(fusion)):
                of_arm = bins_of(values, Cell(noise.name, fusion, arm, ""))
                found[noise.name, fusion, arm] = calibration_of(of_arm, reference)
    return found


def calibration_table(config: ClaimConfig, found: Calibrations, *, short: bool = False) -> ReportTable:
    """ECE over the seeds by noise, world and arm; and the differences from the reference with their intervals.

    short: over all worlds alone, and of the differences only whether they exclude zero.
    """
    rows = []
    for noise in config.noises:
        for fusion in config.fusions:
            arms = [arm for arm in config.by_arm if (noise.name, fusion, arm) in found]
            for world in (THESE,) if short else (*config.worlds, THESE):
                texts = {arm: _text(found[noise.name, fusion, arm], world, config, arm, short) for arm in arms}
                names = [noise.name, fusion] if short else [noise.name, fusion, world]
                rows.append([*names, *(texts.get(arm, "-") for arm in config.by_arm)])
    note = (
        "Expected calibration error of the reliability summed over the seeds, all visible cells, unknown ones at the "
        f"prior; in brackets the difference from {config.reference} with its bootstrap 95 % interval over the seeds, "
        "* where that excludes zero. Lower is better. (The ece of the other tables is of each drive by itself, whose "
        "one pose error counts against a map that rightly doubts it.) Chance that is left adds to an error, the more "
        "so the fewer the seeds; differences and intervals are of as many seeds, those that both arms have."
    )
    names = ["noise", "fusion"] if short else ["noise", "fusion", "world"]
    return ReportTable("Calibration over the seeds", [*names, *config.by_arm], rows, n_names=len(names), note=note)


def _text(found: Calibration, world: str, config: ClaimConfig, arm: str, short: bool) -> str:
    if world not in found.error:
        return "-"
    text = f"{found.error[world]:.4f}"
    if arm == config.reference:
        return text
    interval = found.difference[world]
    star = " *" if interval.low > 0 or interval.high < 0 else ""
    return text + star if short else f"{text} ({interval_text(interval)}{star})"
