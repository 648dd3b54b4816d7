"""What the comparison of simulated and real images leaves in its run folder."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from math import isfinite
from pathlib import Path

import numpy as np

from stereogrid.figures import save_figure
from stereogrid.files import written_beside
from stereogrid.report import ReportFigure, ReportTable, environment, write_metrics, write_report

from .realism_figures import pictures_figure, strips_figure
from .realism_measures import MEASURES
from .realism_scenes import Scene

SUMMARY = (
    "How real is it? bm and sgbm on simulated pairs, with each preset of the cameras' faults, beside the same on real "
    "pairs; and what the images are like. Simulated and real scenes are different scenes: only what lies far outside "
    "the range of the real ones says that something is not as in a photograph."
)
NOTE = "Means over the pairs; - : no truth. " + "; ".join(
    f"{each.heading} [{each.unit}]: {each.meaning}" for each in MEASURES.values() if each.meaning != "as for bm"
)
OF_MATCHING = ("density", "bad_1_0", "bad_2_0")
"""How the names of measures of matchers end; on a screen they have a table of their own."""
LIKENESS = ("bm_density", "sgbm_density", "bm_bad_2_0", "sgbm_bad_2_0", "local_gray", "slope", "noise_gray")
"""What the distance is taken over."""


@dataclass(frozen=True)
class Measured:
    """A scene and its MEASURES by name."""

    scene: Scene
    values: Mapping[str, float]


Groups = Mapping[tuple[str, str], Sequence[Measured]]
"""By place and preset, "" of real ones, in the order of the scenes."""


def write_results(
    folder: Path,
    measured: Sequence[Measured],
    *,
    skipped: Sequence[str],
    facts: Mapping[str, str],
    config: object = None,
) -> list[ReportTable]:
    """metrics.json, tables.md, figures and the report of the run; the tables for the screen."""
    groups = grouped(measured)
    likeness = [distance_table(groups)] if any(not preset for _, preset in groups) else []
    tables = [measures_table(groups, list(MEASURES)), *likeness]
    write_metrics(folder, {"facts": facts, "pairs": [_plain(each) for each in measured], "skipped": list(skipped)})
    figures = [
        ReportFigure(
            save_figure(strips_figure(groups), folder / "realism.png"),
            "Each dot is a pair, each bar the mean of its row. Above: real pairs; below: simulated ones by preset, "
            "coloured by world. Grey: the range of the real ones.",
        ),
        ReportFigure(
            save_figure(pictures_figure(groups), folder / "pictures.png", dots_per_inch=110),
            "Above: real images; below: one place of each world with each preset.",
        ),
    ]
    write_report(
        folder,
        "How real is it?",
        summary=" ".join([SUMMARY, *skipped]),
        arms={},
        figures=figures,
        facts=facts,
        tables=tables,
        config=config,
    )
    write_markdown(folder / "tables.md", tables, skipped, facts)
    halves = ([n for n in MEASURES if n.endswith(OF_MATCHING)], [n for n in MEASURES if not n.endswith(OF_MATCHING)])
    return [*(measures_table(groups, half) for half in halves), *likeness]


def grouped(measured: Iterable[Measured]) -> dict[tuple[str, str], list[Measured]]:
    """By place and preset, real ones first."""
    groups: dict[tuple[str, str], list[Measured]] = {}
    for each in sorted(measured, key=lambda m: not m.scene.is_real):
        groups.setdefault((each.scene.place, each.scene.preset), []).append(each)
    return groups


def mean(group: Iterable[Measured], name: str) -> float:
    """The mean of a measure over the pairs where it is known; NaN of none."""
    values = np.array([each.values[name] for each in group])
    return float(np.nanmean(values)) if np.isfinite(values).any() else np.nan


def measures_table(groups: Groups, names: Sequence[str]) -> ReportTable:
    """A row a place and preset, a column a measure of these names."""
    header = ["images", "cameras", "pairs", *(MEASURES[name].heading for name in names)]
    rows = [
        [
            place,
            preset or "real",
            str(len(group)),
            *(_text(mean(group, name), MEASURES[name].decimals) for name in names),
        ]
        for (place, preset), group in groups.items()
    ]
    return ReportTable("Simulated pairs beside real ones", header, rows, n_names=2, note=NOTE)


def distance_table(groups: Groups) -> ReportTable:
    """How far each preset's means, over all worlds, lie from the mean of the real places, in their deviations."""
    real = [group for (_, preset), group in groups.items() if not preset]
    presets = list(dict.fromkeys(preset for _, preset in groups if preset))
    rows = []
    for preset in presets:
        of_preset = [group for (_, each), group in groups.items() if each == preset]
        offs = np.array([distance(of_preset, real, name) for name in LIKENESS])
        known = offs[np.isfinite(offs)]
        overall = float(np.sqrt(np.mean(np.square(known)))) if len(known) else np.nan
        rows.append([preset, *(_signed(off) for off in offs), _text(overall, 2)])
    header = ["cameras", *(MEASURES[name].heading for name in LIKENESS), "all"]
    note = (
        f"(Mean over the worlds - mean over the {len(real)} real places) / deviation of the real places; all: root "
        "mean square. Within 1: as a photograph may be."
    )
    return ReportTable("Distance from real images", header, rows, note=note)


def distance(groups: Sequence[Sequence[Measured]], real: Sequence[Sequence[Measured]], name: str) -> float:
    """How far the mean of some places lies from that of the real ones, in standard deviations of these."""
    ours, theirs = (np.array([mean(group, name) for group in each]) for each in (groups, real))
    theirs = theirs[np.isfinite(theirs)]
    if len(theirs) < 2 or not np.isfinite(ours).any() or theirs.std() == 0:
        return np.nan
    return float((np.nanmean(ours) - theirs.mean()) / theirs.std(ddof=1))


def write_markdown(path: Path, tables: Sequence[ReportTable], skipped: Sequence[str], facts: Mapping[str, str]) -> None:
    """The tables for docs/results.md, with what made them."""
    around = environment()
    lines = [
        f"## How real is it? {date.today().isoformat()}",
        f"`{facts['command']}` on {around['machine']}, Python {around['python']} ({around['versions']}). "
        f"Worlds: {facts['worlds']}, seed {facts['seed']}.",
        *skipped,
        *(table.markdown for table in tables),
    ]
    with written_beside(path) as temporary:
        temporary.write_text("\n\n".join(lines), encoding="utf-8")


def _plain(each: Measured) -> dict[str, object]:
    values = {name: value if isfinite(value) else None for name, value in each.values.items()}
    return {"place": each.scene.place, "cameras": each.scene.preset or "real", **values}


def _text(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if isfinite(value) else "-"


def _signed(value: float) -> str:
    return f"{value:+.1f}" if isfinite(value) else "-"
