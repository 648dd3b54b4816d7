"""What the comparison with the print leaves in its run folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stereogrid import as_printed
from stereogrid.figures import draw_slice, save_figure
from stereogrid.figures.colours import TRUTH_COLOUR
from stereogrid.grid import OccupancyGrid
from stereogrid.report import ReportFigure, ReportTable, write_metrics, write_report
from stereogrid.scoring import SCORE_NAMES, Score, scores_to_dict
from stereogrid.scoring.truth import MapTruth
from stereogrid.sensor_model import log_odds

from .compared import Compared, interval_text, plain
from .printed_arms import ALL, CLAMP_MEANINGS, CORRECTED, FORMS, LOW_PRINTED, PRINTED, Peaks
from .tidy import write_scores

SHOWN = (
    "auc",
    "occupied_precision",
    "occupied_recall",
    "occupied_f1",
    "obstacle_occupied_f1",
    "log_loss",
    "brier_balanced",
    "ece_width",
    "unsafe_occupied",
    *CLAMP_MEANINGS,
)
DIFFERENCES = ("auc", "occupied_f1", "log_loss", "ece_width")
DRAWN = (CORRECTED, PRINTED, ALL, LOW_PRINTED)
SUMMARY = (
    "The chapter's equations as printed, on the same drive, poses and disparities as the corrected ones. Eqs. 3, 11, "
    "12: the update and the inverse sensor model, k = the cell, cut off just below 1 where they exceed it. Eq. 13: eps "
    "is added, not its square. Sum of rays: every ray updates every cell. Eq. 2: cut off to 0 and 1, since it gives "
    "nothing else. With another prior a reading is worth as much as before: its likelihood ratios are the same."
)


@dataclass(frozen=True)
class Findings:
    """scores[arm][seed]; the maps of the first seed by arm, its peaks of Eq. 11, and the truth."""

    scores: Mapping[str, Mapping[int, Sequence[Score]]]
    grids: Mapping[str, OccupancyGrid]
    peaks: Peaks
    truth: MapTruth

    @property
    def compared(self) -> Compared:
        """The arms beside the corrected one."""
        return Compared("As printed, as corrected", self.scores, CORRECTED, SHOWN, "seeds of the noise")

    @property
    def height_m(self) -> float:
        """Height of the slices [m]: the middle of the layers that the cameras saw most of."""
        seen = np.count_nonzero(self.truth.visible.mask, axis=(0, 1))
        layers = self.truth.labels.origin_index[2] + np.flatnonzero(seen >= 0.9 * seen.max()) + 0.5
        return float(np.median(layers) * self.truth.labels.cell_m)


def write_results(
    folder: Path,
    findings: Findings,
    *,
    facts: Mapping[str, str],
    config: object = None,
) -> list[ReportTable]:
    """Numbers, the figure and the report of the run; the tables for the screen."""
    tables = [scores_table(findings), differences_table(findings), eq2_table(findings), eq11_table(findings.peaks)]
    flat = {(arm, seed): scores for arm, seeds in findings.scores.items() for seed, scores in seeds.items()}
    write_scores(folder / "scores.csv", ("arm", "seed"), flat)
    first = {arm: list(next(iter(seeds.values()))) for arm, seeds in findings.scores.items()}
    of_tables = {table.caption: [dict(zip(table.header, row, strict=True)) for row in table.rows] for table in tables}
    write_metrics(
        folder,
        {"facts": facts, "tables": of_tables, "first seed": {a: scores_to_dict(s) for a, s in first.items()}},
    )
    picture = save_figure(printed_figure(findings), folder / "printed.png", dots_per_inch=110)
    caption = (
        f"Left: slices of the maps of the first seed at z = {findings.height_m:.2f} m, white free, black occupied, "
        "green the true surfaces. Right: how often cells of that probability are occupied; area: how many cells."
    )
    write_report(
        folder,
        "The equations as printed",
        summary=SUMMARY,
        arms=first,
        figures=[ReportFigure(picture, caption)],
        facts=facts,
        meanings={f"obstacle_{n}": f"{m}; obstacles" for n, (_, m) in SCORE_NAMES.items()} | CLAMP_MEANINGS,
        tables=tables,
        config=config,
    )
    (folder / "tables.md").write_text("\n".join(table.markdown for table in tables), encoding="utf-8")
    return tables


def scores_table(findings: Findings) -> ReportTable:
    """A row a score, a column an arm: means over the seeds."""
    compared = findings.compared
    rows = [
        [compared.label(name), *(plain(compared.mean(arm, name).mean) for arm in findings.scores)] for name in SHOWN
    ]
    note = f"Means over {compared.n_units} {compared.unit}."
    return ReportTable("Scores by what is as printed", ["score", *findings.scores], rows, note=note)


def differences_table(findings: Findings) -> ReportTable:
    """A row an arm: by how much it differs from the arm that is corrected and has its prior."""
    compared, rows = findings.compared, []
    for arm in findings.scores:
        twin = FORMS[arm].twin if arm in FORMS else CORRECTED
        if arm != twin:
            gaps = (compared.between(arm, twin, name) for name in DIFFERENCES)
            rows.append([arm, *map(interval_text, gaps)])
    note = f"From the corrected arm of the same prior; 95 % intervals over {compared.n_units} {compared.unit}."
    return ReportTable("Differences", ["arm", *map(compared.label, DIFFERENCES)], rows, note=note)


def eq2_table(findings: Findings) -> ReportTable:
    """What Eq. 2 as printed makes of the corrected map's log-odds: shares of its known cells."""
    grid = findings.grids[CORRECTED]
    p = as_printed.probability(log_odds(grid.known_cells()[1]))
    infinite = np.isinf(p)
    above, below = (p > 1) & ~infinite, (p < 0) & ~infinite
    shares = {"above 1": above, "below 0": below, "infinite (l = 0)": infinite, "in [0, 1]": (p >= 0) & (p <= 1)}
    rows = [[name, f"{np.mean(which):.5f}"] for name, which in shares.items()]
    note = f"Shares of the {len(p):,} known cells of the first seed's map."
    return ReportTable("Eq. 2 as printed", ["its probability", "share of cells"], rows, note=note)


def eq11_table(peaks: Peaks) -> ReportTable:
    """How often Eq. 11's peak is no probability, by range."""
    rows = [
        [f"{low:g} to {high:g}", f"{rays:,}", plain(above), plain(median), plain(largest)]
        for low, high, rays, above, median, largest in zip(
            peaks.edges_m[:-1], peaks.edges_m[1:], peaks.rays, peaks.above_one, peaks.median, peaks.largest, strict=True
        )
    ]
    header = ["range [m]", "rays", "share with a peak above 1", "median peak", "largest"]
    return ReportTable(
        "Eq. 11 as printed: its peak, k = cell", header, rows, note="Every matched pixel of the first seed."
    )


def printed_figure(findings: Findings) -> Figure:
    """A row an arm: the slice of its map, and its reliability."""
    figure = Figure(figsize=(11.5, 2.3 * len(DRAWN) + 0.5), layout="constrained")
    panels = figure.subplots(len(DRAWN), 2, squeeze=False, width_ratios=[2.6, 1])
    segments_m = findings.truth.section_m(findings.height_m)
    seen_m = findings.truth.labels.centres_m(findings.truth.visible.mask)
    low_m, high_m = seen_m.min(axis=0) - 0.3, seen_m.max(axis=0) + 0.3
    for (left, right), arm in zip(panels, DRAWN, strict=True):
        draw_slice(left, findings.grids[arm], findings.height_m)
        for segment in segments_m:
            left.plot(*segment[:, :2].T, color=TRUTH_COLOUR, linewidth=0.8)
        left.set(xlim=(low_m[0], high_m[0]), ylim=(low_m[1], high_m[1]), ylabel="y [m]", aspect="equal")
        left.set_title(arm if arm == CORRECTED else f"as printed: {arm}", fontsize=10, loc="left")
        table = findings.truth.reliability(findings.grids[arm])
        full = table.count > 0
        right.bar(table.edges[:-1], table.count / table.count.sum(), 0.1, align="edge", color="0.85", edgecolor="white")
        right.plot([0, 1], [0, 1], "--", color="0.6", linewidth=1)
        right.plot(table.mean_p[full], table.frequency[full], "o-", color="black", markersize=4)
        right.set(xlim=(0, 1), ylim=(0, 1), ylabel="truly occupied")
        right.grid(alpha=0.25)
    panels[-1, 0].set_xlabel("x [m]")
    panels[-1, 1].set_xlabel("p(occupied) of the map")
    return figure
