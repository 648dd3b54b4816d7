"""The numbers of the comparison of matchers, as tables."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from stereogrid.report import ReportTable
from stereogrid.scoring import Score

from .compared import interval_text, labelled, plain
from .matched_maps import SHOWN, MapResult
from .matched_pairs import PairResult

DIGITS = {"bad": 2, "mae": 3, "density": 1, "occlusion": 3, "within": 3, "cpu": 3, "wall": 3}
"""Decimals by the first word of a score's name."""
Columns = Mapping[str, tuple[str, ...]]
"""Scores by the header of the column that shows them."""
VALID: Columns = {
    "bad .5 %": ("bad_0_5",),
    "bad 1 %": ("bad_1_0",),
    "bad 2 %": ("bad_2_0",),
    "MAE px": ("mae",),
}
FILLED: Columns = {f"{header}, filled": (f"{name}_filled",) for header, (name,) in VALID.items()}
NON_OCCLUDED: Columns = {"density %": ("density",), **VALID, **FILLED, "CPU s": ("cpu_s",)}
ALL: Columns = {
    **{header: (f"{name}_all",) for header, (name,) in {"density %": ("density",), **VALID, **FILLED}.items()},
    "wall s": ("wall_s",),
}
BESIDES: Columns = {
    "occlusion F1": ("occlusion_f1",),
    "in 1 sigma": ("within_1_sigma",),
    "in 2 sigma": ("within_2_sigma",),
}
SHORT: Columns = {
    "density %": ("density",),
    "bad 1 / 2 %": ("bad_1_0", "bad_2_0"),
    "MAE px": ("mae",),
    "bad 1 / 2 %, filled": ("bad_1_0_filled", "bad_2_0_filled"),
    "MAE px, filled": ("mae_filled",),
    "bad 1 / 2 %, filled, all pixels": ("bad_1_0_filled_all", "bad_2_0_filled_all"),
    "occlusion F1": ("occlusion_f1",),
    "in 1 / 2 sigma": ("within_1_sigma", "within_2_sigma"),
    "CPU s": ("cpu_s",),
}
SCREEN: Columns = {
    "density %": ("density",),
    "bad 2 %": ("bad_2_0",),
    "filled": ("bad_2_0_filled",),
    "filled, all": ("bad_2_0_filled_all",),
    "occlusion F1": ("occlusion_f1",),
    "CPU s": ("cpu_s",),
}
FILLING = "Among the matched pixels, or of all with holes filled from the smaller neighbour on the row (filled)."
SIGMA = (
    "Occlusion F1: how well no match marks an occlusion. Errors within 1 and 2 sigma: .683 and .954 where sigma is "
    "right; step^2 / 12, for the rounding of the truth, is added to sigma^2."
)


def full_pair_tables(results: Sequence[PairResult]) -> list[ReportTable]:
    """Every score on the pairs, for the report."""
    return [
        pair_table(results, NON_OCCLUDED, "Pairs: the non-occluded pixels", f"{FILLING} {sizes(results)}"),
        pair_table(results, ALL, "Pairs: all pixels of known disparity, occluded ones too", FILLING),
        pair_table(results, BESIDES, "Pairs: what the matchers know of themselves", SIGMA),
    ]


def short_pair_table(results: Sequence[PairResult]) -> ReportTable:
    """The main scores, two in a column where they belong together, for docs/results.md."""
    note = f"Non-occluded pixels but for one column. {FILLING} {SIGMA} {sizes(results)}"
    return pair_table(results, SHORT, "Pairs", note)


def pair_table(results: Sequence[PairResult], columns: Columns, caption: str, note: str = "") -> ReportTable:
    """A row for each contender on each pair; the pair is named in its first row."""
    rows: list[list[str]] = []
    before = None
    for result in results:
        cells = (" / ".join(_number(result.score(name)) for name in names) for names in columns.values())
        rows.append([result.pair.name if result.pair is not before else "", result.contender, *cells])
        before = result.pair
    return ReportTable(caption, ["pair", "matcher", *columns], rows, n_names=2, note=note)


def sizes(results: Iterable[PairResult]) -> str:
    """Width x height x disparities of each pair, in words."""
    names = {pair_name(result): None for result in results}
    return f"Width x height x disparities: {'; '.join(names)}. 'pair / 2' is half as wide and high as the original."


def pair_name(result: PairResult) -> str:
    """The pair with its size and the disparities that hold its truth."""
    height, width = result.pair.truth_px.shape
    return f"{result.pair.name}, {width} x {height} x {result.pair.num_disparities}"


def _number(score: Score) -> str:
    return "-" if math.isnan(score.value) else f"{score.value:.{DIGITS[score.name.split('_')[0]]}f}"


def map_tables(result: MapResult, reference: str) -> list[ReportTable]:
    """Mean map scores by matcher, and what separates each from the reference with its interval."""
    means, others = mean_table(result), [name for name in result.scores if name != reference]
    times = [_number(result.times[name][0]) for name in result.scores]
    means = replace(means, rows=[*means.rows, ["CPU s a pair", *times]])
    if not others:
        return [means]
    rows = [
        [
            labelled(score, result.unit(score)),
            *(interval_text(result.difference(name, reference, score)) for name in others),
        ]
        for score in SHOWN
    ]
    note = (
        f"Means of the differences, seed by seed, over {result.n_seeds} seeds, with bootstrap 95 % intervals over the "
        "seeds. They are not corrected for the number of matchers or of scores, and say nothing of other worlds."
    )
    header = ["score", *(f"{name} - {reference}" for name in others)]
    return [means, ReportTable(f"Maps: differences from {reference}", header, rows, note=note)]


def mean_table(result: MapResult) -> ReportTable:
    """Mean map scores by matcher."""
    rows = [
        [labelled(score, result.unit(score)), *(plain(result.mean(name, score)) for name in result.scores)]
        for score in SHOWN
    ]
    note = f"Means over {result.n_seeds} seeds of the image noise, the same for every matcher."
    return ReportTable("Maps", ["map score", *result.scores], rows, note=note)


def screen_tables(on_pairs: Sequence[PairResult], by_map: MapResult) -> list[ReportTable]:
    """What fits a terminal: the main scores on the pairs, and the mean map scores."""
    return [*([pair_table(on_pairs, SCREEN, "Pairs")] if on_pairs else []), mean_table(by_map)]
