"""What separates the arms of the claim: paired differences by world and over all worlds, corrected for many arms."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from stereogrid.scoring import Score
from stereogrid.scoring.paired import Interval, bootstrap_mean, hierarchical_mean, holm, sign_flip_p

from .claim_units import Unit
from .compared import BOOTSTRAP_SEED
from .parallel import in_parallel

THESE, LIKE_THESE = "these worlds", "worlds like these"
"""Where a world's name stands for the mean over the worlds: with other seeds; and in other worlds of the kind."""


@dataclass(frozen=True, order=True)
class Cell:
    """Where a number stands: which score of which arm under which noise."""

    noise: str
    fusion: str
    way: str
    score: str


@dataclass(frozen=True)
class Difference:
    """How much higher a score is than the reference arm's in one world, or over THESE or those LIKE_THESE.

    p: of no difference in THESE, corrected by Holm's rule for the number of arms; else NaN.
    """

    cell: Cell
    world: str
    interval: Interval
    p: float = np.nan

    @property
    def excludes_zero(self) -> bool:
        """Whether the 95 % interval does; of THESE, whether p is below .05 besides."""
        beyond = self.interval.low > 0 or self.interval.high < 0
        return bool(beyond and not self.p >= 0.05)


class Values:
    """The values of all scores, by cell, world and seed."""

    def __init__(self, found: Mapping[Unit, Iterable[Score]]) -> None:
        self.units: dict[str, str] = {}
        self._by_cell: dict[Cell, dict[str, dict[int, float]]] = {}
        for unit, scores in found.items():
            for each in scores:
                self.units[each.name] = each.unit
                by_world = self._by_cell.setdefault(Cell(unit.noise, unit.fusion, unit.way, each.name), {})
                by_world.setdefault(unit.world, {})[unit.seed] = each.value

    def __contains__(self, cell: Cell) -> bool:
        return cell in self._by_cell

    @property
    def cells(self) -> list[Cell]:
        """All cells that there are."""
        return list(self._by_cell)

    def seeds(self, cell: Cell) -> Mapping[str, Mapping[int, float]]:
        """Its values by world and seed."""
        return self._by_cell.get(cell, {})

    def worlds(self, cell: Cell) -> dict[str, list[float]]:
        """Its values by world."""
        return {world: list(seeds.values()) for world, seeds in self.seeds(cell).items()}

    def mean(self, cell: Cell) -> float:
        """Its mean over the worlds, each of which counts alike; NaN where there is none."""
        means = [np.nanmean(values) for values in self.worlds(cell).values() if not np.isnan(values).all()]
        return float(np.mean(means)) if means else np.nan

    def differences(self, cell: Cell, reference: str) -> dict[str, dict[int, float]]:
        """Its values minus those of the reference arm, by world and seed, of the seeds that both have."""
        others = self.seeds(replace(cell, way=reference))
        return {
            world: {seed: value - others[world][seed] for seed, value in seeds.items() if seed in others.get(world, {})}
            for world, seeds in self.seeds(cell).items()
        }


def over_worlds(by_world: Mapping[str, Mapping[int, float]]) -> list[float]:
    """The mean over the worlds for each seed that all of them have.

    One seed draws the same errors in every world (common random numbers), and a drive that came out long is long in
    all of them: the seeds are the units that are independent, not the pairs of world and seed.
    """
    common = set.intersection(*(set(seeds) for seeds in by_world.values())) if by_world else set()
    return [float(np.mean([seeds[seed] for seeds in by_world.values()])) for seed in sorted(common)]


def differences_of(
    values: Values, cells: Iterable[Cell], reference: str, step: Callable[[], None] = lambda: None
) -> list[Difference]:
    """By world and over all, cell by cell; p is corrected over the cells of one noise and score, which are its arms."""
    pairs = {cell: values.differences(cell, reference) for cell in cells}
    found = in_parallel({cell: partial(_of_cell, cell, by_world) for cell, by_world in pairs.items()}, step)
    families: dict[tuple[str, str], list[Cell]] = {}
    for cell in found:
        families.setdefault((cell.noise, cell.score), []).append(cell)
    corrected = {}
    for family in families.values():
        p = holm([sign_flip_p([over_worlds(pairs[cell])], rng=_rng()) for cell in family])
        corrected |= dict(zip(family, p, strict=True))
    return [
        replace(each, p=float(corrected[each.cell])) if each.world == THESE else each
        for of_cell in found.values()
        for each in of_cell
    ]


def _of_cell(cell: Cell, by_world: Mapping[str, Mapping[int, float]]) -> list[Difference]:
    """Without p."""
    values = {world: list(seeds.values()) for world, seeds in by_world.items()}
    return [
        *(Difference(cell, world, bootstrap_mean(each, rng=_rng())) for world, each in values.items()),
        Difference(cell, THESE, bootstrap_mean(over_worlds(by_world), rng=_rng())),
        Difference(cell, LIKE_THESE, hierarchical_mean(list(values.values()), rng=_rng()).other_worlds),
    ]


def _rng() -> np.random.Generator:
    return np.random.default_rng(BOOTSTRAP_SEED)
