"""Arms that saw the same: their scores unit by unit, and what separates them, as tables."""

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stereogrid.report import ReportTable
from stereogrid.scoring import Score
from stereogrid.scoring.paired import Interval, bootstrap_mean, paired_difference
from stereogrid.scoring.score import DIMENSIONLESS

BOOTSTRAP_SEED = 0
"""One for every difference: all are resampled alike."""


@dataclass(frozen=True)
class Compared:
    """scores[arm][unit]: of each arm for the same units (noise seeds, held-out pairs, ...), which `unit` names.

    reference: the arm that the others are compared with. shown: the scores that tables show.
    """

    name: str
    scores: Mapping[str, Mapping[Hashable, Sequence[Score]]]
    reference: str
    shown: Sequence[str]
    unit: str

    @property
    def n_units(self) -> int:
        """Of how many units each arm has scores."""
        return len(next(iter(self.scores.values())))

    def values(self, arm: str, name: str) -> list[float]:
        """The score of that name for each unit, in their order."""
        return [each.value for scores in self.scores[arm].values() for each in scores if each.name == name]

    def mean(self, arm: str, name: str) -> Interval:
        """Its mean over the units, with a bootstrap interval."""
        return bootstrap_mean(self.values(arm, name), rng=np.random.default_rng(BOOTSTRAP_SEED))

    def difference(self, arm: str, name: str) -> Interval:
        """How much higher the arm's score is than the reference's, unit by unit."""
        return self.between(arm, self.reference, name)

    def between(self, arm: str, other: str, name: str) -> Interval:
        """How much higher the arm's score is than the other arm's, unit by unit."""
        rng = np.random.default_rng(BOOTSTRAP_SEED)
        return paired_difference(self.values(arm, name), self.values(other, name), rng=rng)

    def label(self, name: str) -> str:
        """The score's name, with its unit where the name does not say it."""
        scores = next(iter(next(iter(self.scores.values())).values()))
        return labelled(name, next(score.unit for score in scores if score.name == name))


def mean_table(compared: Compared, note: str = "") -> ReportTable:
    """A row a score, a column an arm: means over the units."""
    rows = [
        [compared.label(name), *(plain(compared.mean(arm, name).mean) for arm in compared.scores)]
        for name in compared.shown
    ]
    note = f"Means over {compared.n_units} {compared.unit}. {note}".strip()
    return ReportTable(compared.name, ["score", *compared.scores], rows, note=note)


def difference_table(compared: Compared) -> ReportTable:
    """What separates each arm from the reference, with intervals."""
    others = [arm for arm in compared.scores if arm != compared.reference]
    rows = [
        [compared.label(name), *(interval_text(compared.difference(arm, name)) for arm in others)]
        for name in compared.shown
    ]
    header = ["score", *(f"{arm} - {compared.reference}" for arm in others)]
    note = (
        f"Means of the differences over {compared.n_units} {compared.unit}, with bootstrap 95 % intervals over them, "
        "which are not corrected for the number of arms or of scores, and say nothing of other worlds."
    )
    return ReportTable(f"{compared.name}: differences from {compared.reference}", header, rows, note=note)


def labelled(name: str, unit: str) -> str:
    """A score's name, with its unit where the name does not say it."""
    return name if unit == DIMENSIONLESS or name.endswith(f"_{unit}") else f"{name} [{unit}]"


def plain(value: float) -> str:
    """Three decimals; a dash where there is no number."""
    return "-" if math.isnan(value) else f"{value:.3f}"


def interval_text(interval: Interval) -> str:
    """As +0.0040 [+0.0021, +0.0062]; a dash where there is no number."""
    mean, low, high = ("-" if math.isnan(v) else f"{v:+.4f}" for v in (interval.mean, interval.low, interval.high))
    return f"{mean} [{low}, {high}]"
