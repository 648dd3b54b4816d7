"""What a comparison of matchers leaves in its run folder."""

import math
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path

import numpy as np

from stereogrid.files import written_beside
from stereogrid.report import ReportFigure, ReportTable, environment, write_metrics, write_report
from stereogrid.scoring import scores_to_dict
from stereogrid.scoring.paired import Interval

from .drives import OBSTACLE_MEANINGS
from .matched_maps import DENSITY, SHOWN, MapResult
from .matched_pairs import PairResult
from .matchers_figures import draw_maps, draw_pairs, pair_slug
from .matchers_tables import full_pair_tables, map_tables, screen_tables, short_pair_table
from .tidy import write_scores

NO_PAIRS = "No pairs of known disparity were given (--pairs, or $STEREOGRID_DATA/stereo): only maps are compared. "
SUMMARY = (
    "The drive: simulated, true poses, the same image noise for every matcher, seed by seed; maps are scored against "
    "the true mesh, on the cells that the cameras could see. CPU seconds: of all threads, the median of three runs "
    "after a warm-up, with nothing beside them."
)
MEANINGS = {**OBSTACLE_MEANINGS, DENSITY: "share of the pixels that were matched, mean of the drive"}


def write_results(
    folder: Path,
    on_pairs: Sequence[PairResult],
    by_map: MapResult,
    reference: str,
    *,
    facts: Mapping[str, str],
    config: object = None,
) -> list[ReportTable]:
    """Maps, disparities, numbers, figures, results.md and the report of the run; the tables for the screen."""
    write_arrays(folder, on_pairs, by_map)
    write_numbers(folder, on_pairs, by_map, reference, facts=facts)
    of_maps = map_tables(by_map, reference)
    tables = [*(full_pair_tables(on_pairs) if on_pairs else []), *of_maps]
    figures: list[ReportFigure] = [*draw_pairs(on_pairs, folder), *draw_maps(by_map, folder)]
    first = {name: next(iter(scores.values())) for name, scores in by_map.scores.items()}
    write_report(
        folder,
        "Matchers compared",
        summary=("" if on_pairs else NO_PAIRS) + SUMMARY,
        arms={f"{name}, first seed": scores for name, scores in first.items()},
        figures=figures,
        facts=facts,
        meanings=MEANINGS,
        tables=tables,
        config=config,
    )
    short = [*([short_pair_table(on_pairs)] if on_pairs else []), *of_maps]
    write_markdown(folder / "results.md", short, facts)
    return screen_tables(on_pairs, by_map)


def write_arrays(folder: Path, on_pairs: Sequence[PairResult], by_map: MapResult) -> None:
    """The maps of the first seed, and every disparity with its sigma."""
    for name, mapped in by_map.maps.items():
        mapped.grid.save(folder / f"map-{name}.sgrid")
    for result in on_pairs:
        path = folder / f"disparity-{pair_slug(result.pair)}-{result.contender}.npz"
        found = result.disparity
        np.savez_compressed(path, disparity_px=found.disparity_px, sigma_px=found.sigma_px)


def write_numbers(
    folder: Path, on_pairs: Sequence[PairResult], by_map: MapResult, reference: str, *, facts: Mapping[str, str]
) -> None:
    """metrics.json, pairs.csv and maps.csv."""
    of_pairs = {(r.pair.name, r.contender): r.scores for r in on_pairs}
    of_maps = {(name, seed): scores for name, seeds in by_map.scores.items() for seed, scores in seeds.items()}
    if of_pairs:
        write_scores(folder / "pairs.csv", ("pair", "matcher"), of_pairs)
    write_scores(folder / "maps.csv", ("matcher", "seed"), of_maps)
    others = [name for name in by_map.scores if name != reference]
    metrics = {
        "facts": facts,
        "pairs": _nested({key: scores_to_dict(scores) for key, scores in of_pairs.items()}),
        "maps": _nested({(name, str(seed)): scores_to_dict(scores) for (name, seed), scores in of_maps.items()}),
        "times": {name: scores_to_dict(scores) for name, scores in by_map.times.items()},
        "reference": reference,
        "differences": {
            name: {score: _plain(by_map.difference(name, reference, score)) for score in SHOWN} for name in others
        },
    }
    write_metrics(folder, metrics)


def _nested(flat: Mapping[tuple[str, str], object]) -> dict[str, dict[str, object]]:
    nested: dict[str, dict[str, object]] = {}
    for (outer, inner), value in flat.items():
        nested.setdefault(outer, {})[inner] = value
    return nested


def _plain(interval: Interval) -> dict[str, float | int | None]:
    bounds = {"mean": interval.mean, "low": interval.low, "high": interval.high}
    return {**{name: value if math.isfinite(value) else None for name, value in bounds.items()}, "n": interval.n}


def write_markdown(path: Path, tables: Sequence[ReportTable], facts: Mapping[str, str]) -> None:
    """The tables for docs/results.md, with what made them."""
    around = environment()
    lines = [
        f"## Matchers, {date.today().isoformat()}",
        f"`{facts['command']}` on {around['machine']}, Python {around['python']} ({around['versions']}). "
        f"Drive: {facts['pairs']} pairs of the world {facts.get('drive world')}, seed {facts.get('drive seed')}, "
        f"every {facts.get('drive every_m')} m.",
        *(table.markdown for table in tables),
    ]
    with written_beside(path) as temporary:
        temporary.write_text("\n\n".join(lines), encoding="utf-8")
