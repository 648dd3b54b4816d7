"""What a comparison of fusion arms leaves in its run folder."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import date
from math import isfinite
from pathlib import Path

from stereogrid.figures import save_figure
from stereogrid.files import written_beside
from stereogrid.report import ReportFigure, ReportTable, environment, write_metrics, write_report
from stereogrid.scoring import scores_to_dict
from stereogrid.scoring.held_out import HELD_OUT_NAMES

from .compared import Compared, difference_table, mean_table
from .drives import OBSTACLE_MEANINGS
from .fusion_arms import FIRST, MEASURED, ONE_LOOK, SUM
from .fusion_figures import arms_figure
from .tidy import write_scores

SIMULATED, REAL, CLAMPS = "simulated", "real", "clamps"
IN_FIGURE = {
    SIMULATED: ("occupied_f1", "log_loss", "brier_balanced"),
    REAL: ("held_out_auc", "held_out_brier_balanced", "held_out_log_likelihood"),
    CLAMPS: ("occupied_f1", "log_loss", "ece_width"),
}
CAPTIONS = {
    SIMULATED: "Simulated worlds, scored against their meshes",
    REAL: "Real sequences, scored by observations that were held out",
    CLAMPS: "Where log-odds stop: the limits of a cell",
}
SUMMARY = (
    "How many looks is a footprint worth? A cell is seen by many pixels of one observation. If their errors were "
    "independent, their mean would be known the better the more they are; if they go together, no better than one. "
    f"Arms: errors independent from pixel to pixel ({FIRST}); the length that the matcher states ({MEASURED}); the "
    f"whole footprint errs together ({ONE_LOOK}); every ray adds, as the paper has it ({SUM}). "
)
Worlds = Mapping[str, Sequence[Compared]]
"""SIMULATED, REAL, CLAMPS: what was compared on each kind of world."""


def write_results(
    folder: Path, worlds: Worlds, *, skipped: Sequence[str], facts: Mapping[str, str], config: object = None
) -> list[ReportTable]:
    """Numbers, figures, results.md and the report of the run; the tables for the screen."""
    every = [world for kind in worlds.values() for world in kind]
    means = [mean_table(world) for world in every]
    tables = [table for world, mean in zip(every, means, strict=True) for table in (mean, difference_table(world))]
    write_numbers(folder, every, facts)
    write_report(
        folder,
        "Fusion: how many looks is a footprint worth?",
        summary=SUMMARY + " ".join(skipped),
        arms=_first_units(every),
        figures=draw(folder, worlds),
        facts=facts,
        meanings={**OBSTACLE_MEANINGS, **{name: meaning for name, (_, meaning) in HELD_OUT_NAMES.items()}},
        tables=tables,
        config=config,
    )
    write_markdown(folder / "results.md", tables, skipped, facts)
    return means


def draw(folder: Path, worlds: Worlds) -> list[ReportFigure]:
    """A figure for each kind of world that there is."""
    figures = []
    for kind, compared in worlds.items():
        if compared:
            path = save_figure(arms_figure(compared, IN_FIGURE[kind]), folder / f"{kind}.png")
            caption = f"{CAPTIONS[kind]}: means with bootstrap 95 % intervals; ringed: what differences are taken from."
            figures.append(ReportFigure(path, caption))
    return figures


def write_numbers(folder: Path, every: Sequence[Compared], facts: Mapping[str, str]) -> None:
    """scores.csv, a line a score of an arm on a unit (repeat: its seed or number), and metrics.json."""
    flat = {
        (world.name, arm, unit): scores
        for world in every
        for arm, units in world.scores.items()
        for unit, scores in units.items()
    }
    write_scores(folder / "scores.csv", ("world", "arm", "repeat"), flat)
    metrics = {
        world.name: {
            "reference": world.reference,
            "units": world.unit,
            "scores": {
                arm: {str(unit): scores_to_dict(scores) for unit, scores in units.items()}
                for arm, units in world.scores.items()
            },
            "differences": {
                arm: {name: _plain(asdict(world.difference(arm, name))) for name in world.shown}
                for arm in world.scores
                if arm != world.reference
            },
        }
        for world in every
    }
    write_metrics(folder, {"facts": facts, "worlds": metrics})


def write_markdown(path: Path, tables: Sequence[ReportTable], skipped: Sequence[str], facts: Mapping[str, str]) -> None:
    """The tables for docs/results.md, with what made them."""
    around = environment()
    lines = [
        f"## How many looks is a footprint worth? {date.today().isoformat()}",
        f"`{facts['command']}` on {around['machine']}, Python {around['python']} ({around['versions']}). "
        f"Drive: {facts['pairs']} pairs of the world {facts.get('drive world')}, seed {facts.get('drive seed')}, "
        f"every {facts.get('drive every_m')} m.",
        *skipped,
        *(table.markdown for table in tables),
    ]
    with written_beside(path) as temporary:
        temporary.write_text("\n\n".join(lines), encoding="utf-8")


def _first_units(every: Sequence[Compared]) -> dict[str, list]:
    return {
        f"{world.name}: {arm}": list(next(iter(units.values())))
        for world in every
        for arm, units in world.scores.items()
    }


def _plain(interval: Mapping[str, float]) -> dict[str, float | None]:
    return {name: value if isfinite(value) else None for name, value in interval.items()}
