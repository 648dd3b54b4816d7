"""kz2's energies and times beside those of the published reference, in the reference's units."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stereogrid.matching.kz2 import KolmogorovZabihMatcher
from stereogrid.report import ReportTable

from .matched_pairs import at_most
from .pairs import Pair, open_pairs
from .parallel import Stage

REFERENCE: dict[str, tuple[int, float]] = {
    "tsukuba": (-12801427, 3.3),
    "venus": (-22783788, 8.4),
    "teddy": (-146630201, 19.4),
    "motorcycle": (-444412761, 61.7),
}
"""By pair: the least energy of the reference (pmonasse/disparity-with-graph-cuts @ 6c6f9e3) over its seeds, and its
shortest time [CPU s], which was measured on another day than ours: compare the times only roughly."""


MOST_PIXELS = 400_000
"""Larger pairs are shrunk, as `experiments matchers` does: a full Aloe takes minutes."""


@dataclass(frozen=True)
class EnergyResult:
    """A pair's energy, and how long it took [s]; the reference's where there is one."""

    pair: str
    energy: int
    cpu_s: float
    wall_s: float
    reference: tuple[int, float] | None


def compare(folder: Path, stage: Stage) -> list[EnergyResult]:
    """Label each pair in a folder, the smallest first: it is done twice, since the first time compiles the kernels."""
    small = (at_most(pair, MOST_PIXELS) for pair in open_pairs(folder))
    pairs = sorted(small, key=lambda pair: pair.truth_px.size * pair.num_disparities)
    with stage("labelling", len(pairs) + 1) as step:
        measure(pairs[0])
        step()
        results = []
        for pair in pairs:
            results.append(measure(pair))
            step()
    return results


def measure(pair: Pair) -> EnergyResult:
    """Label one pair, in colour as the reference does."""
    matcher = KolmogorovZabihMatcher(num_disparities=pair.num_disparities)
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    _, energy = matcher.labels(pair.left, pair.right)
    cpu_s, wall_s = time.process_time() - cpu_s, time.perf_counter() - wall_s
    return EnergyResult(pair.name, energy, cpu_s, wall_s, REFERENCE.get(pair.name))


def screen_table(results: Sequence[EnergyResult]) -> ReportTable:
    """A row a pair."""
    header = ["pair", "energy", "less the reference's best", "CPU s", "wall s", "CPU / reference's"]
    rows = []
    for each in results:
        best, seconds = each.reference or (None, None)
        relation = ("-", "-") if best is None else (f"{each.energy - best}", f"{each.cpu_s / seconds:.2f}")
        rows.append([each.pair, str(each.energy), relation[0], f"{each.cpu_s:.1f}", f"{each.wall_s:.1f}", relation[1]])
    return ReportTable("Energies", header, rows)
