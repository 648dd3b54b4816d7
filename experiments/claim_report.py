"""What the test of the claim leaves in its run folder, and what of it is fit for the documentation."""

import csv
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path

from stereogrid.errors import InvalidInputError
from stereogrid.figures import save_figure
from stereogrid.report import ReportFigure, ReportTable, write_report
from stereogrid.scoring import BOUND_NAMES, Score
from stereogrid.scoring.paired import Interval
from stereogrid.tomlfile import CONFIG_TOML

from .claim_bins import PREFIX
from .claim_calibration import Calibrations, calibration_table, calibrations
from .claim_config import ClaimConfig
from .claim_figures import coverage_figure, forest_figure
from .claim_statistics import LIKE_THESE, THESE, Cell, Difference, Values, differences_of
from .claim_tables import (
    CORE,
    COVERED,
    HEADLINE,
    Differences,
    control_table,
    coverage_table,
    difference_tables,
    end_table,
    mean_tables,
    overview_table,
    tuning_means,
    tuning_table,
)
from .claim_units import END_ERROR, Unit
from .drives import OBSTACLE_MEANINGS
from .parallel import Stage
from .tidy import write_scores, write_table

KEYS = ("world", "noise", "seed", "fusion", "way")
CALIBRATION = "calibration.csv"
FLOOR = "floor_"
"""Scores of the voxelised mesh: the same for every map of a world."""
PUBLISHED = (*CORE, "obstacle_auc", COVERED[0])
SUMMARY = (
    "Does it make better maps when the mapper is told how far the poses may be off, and what it should make of that? "
    "Every arm maps the same drives, with the same images and the same noise of the poses, seed by seed; the noise is "
    "of known size, and the mapper is told of just that size ('perfect': of an error that is not there). Maps are "
    "scored against the true mesh, on the cells that the cameras could see. "
)
MEANINGS = {
    **OBSTACLE_MEANINGS,
    END_ERROR: "distance of the last pose from the true one",
}
Results = Mapping[Unit, list[Score]]


def write_claim(
    folder: Path,
    config: ClaimConfig,
    found: Results,
    *,
    failed: Mapping[Unit, str],
    facts: Mapping[str, str],
    stage: Stage,
) -> list[ReportTable]:
    """claim.csv, summary.csv, calibration.csv, figures and the report; the tables for the screen."""
    write_units(folder / "claim.csv", found)
    values = Values(found)
    differences = compare(config, values, stage)
    write_summary(folder / "summary.csv", differences.values())
    controls = control_table(config, values)
    bounds = [coverage_table(config, values, (*config.worlds, THESE))] if config.bound else []
    ends = [end_table(config, values)] if config.bound else []
    calibrated = calibrations(config, values)
    write_calibrations(folder / CALIBRATION, calibrated)
    tables = [
        overview_table(config, differences),
        calibration_table(config, calibrated),
        *bounds,
        *mean_tables(config, values),
        *difference_tables(config, values, differences),
        *([controls] if controls else []),
        *ends,
    ]
    with stage("drawing", 1):
        figures = draw(folder, config, values, differences)
        write_report(
            folder,
            "The claim: does the motion error make better maps?",
            summary=SUMMARY + left_out(failed),
            arms=first_noise_means(config, values),
            figures=figures,
            facts=facts,
            meanings=MEANINGS,
            tables=tables,
            config=config,
        )
    narrow = [overview_table(config, differences, short=True), calibration_table(config, calibrated, short=True)]
    return [*narrow, *([coverage_table(config, values, [THESE])] if config.bound else [])]


def write_tuning(folder: Path, config: ClaimConfig, found: Results, *, command: str) -> list[ReportTable]:
    """tune.csv, candidates.csv and the report; the table for the screen."""
    write_units(folder / "tune.csv", found)
    means = tuning_means(config, Values(found))
    table = tuning_table(config, means)
    header = ["noise", "fusion", "candidate", "score", "mean"]
    lines = ([*asdict(cell).values(), mean] for cell, mean in means.items())
    write_table(folder / "candidates.csv", header, lines, digits=6)
    facts = {"command": command}
    title, summary = "Candidates for the claim", "On worlds that the claim is not scored on."
    write_report(folder, title, summary=summary, arms={}, figures=[], facts=facts, tables=[table], config=config)
    return [table]


def compare(config: ClaimConfig, values: Values, stage: Stage) -> Differences:
    """Of every score of every arm but the reference, under every noise."""
    cells = [
        cell
        for cell in values.cells
        if cell.way in config.by_arm and cell.way != config.reference and not cell.score.startswith((FLOOR, PREFIX))
    ]
    with stage("comparing", len(cells)) as step:
        found = differences_of(values, cells, config.reference, step)
    return {(each.cell, each.world): each for each in found}


def draw(folder: Path, config: ClaimConfig, values: Values, differences: Differences) -> list[ReportFigure]:
    """A forest of differences for each rule of fusion, and the coverage of the hits."""
    figures = []
    for fusion in config.fusions:
        if config.others(fusion):
            path = save_figure(forest_figure(config, fusion, differences), folder / f"differences-{fusion}.png", 110)
            caption = (
                f"{fusion}: paired differences from {config.reference} with bootstrap 95 % intervals over the seeds; "
                f"filled: marked in the tables. Thick: the mean over {THESE}; thin: over {LIKE_THESE}, cut off at the "
                "edges."
            )
            figures.append(ReportFigure(path, caption))
    if config.bound:
        path = save_figure(coverage_figure(config, values), folder / "coverage.png", 110)
        caption = "Is the error bounded? A dot a world; the line: nominal .95, the band: +- .02."
        figures.append(ReportFigure(path, caption))
    return figures


def write_units(path: Path, found: Results, only: Iterable[str] = (), *, digits: int = 17) -> None:
    """A line a score of a unit; `only` some of the scores, if any are named."""
    wanted = {*only}
    write_scores(
        path,
        KEYS,
        {
            tuple(asdict(unit).values()): [each for each in scores if not wanted or each.name in wanted]
            for unit, scores in found.items()
        },
        digits=digits,
    )


def write_summary(path: Path, differences: Iterable[Difference]) -> None:
    """A line a difference, with its interval."""
    header = ["noise", "fusion", "way", "score", "world", "difference", "low", "high", "n", "p_holm"]
    lines = ([*asdict(each.cell).values(), each.world, *_numbers(each.interval), each.p] for each in differences)
    write_table(path, header, lines, digits=6)


def write_calibrations(path: Path, found: Calibrations) -> None:
    """A line an arm and world: ECE over the seeds, and its difference from the reference arm's with its interval."""
    lines = (
        [*arm, world, error, *_numbers(calibration.difference[world])]
        for arm, calibration in found.items()
        for world, error in calibration.error.items()
    )
    header = ["noise", "fusion", "way", "world", "ece", "difference", "low", "high", "n"]
    write_table(path, header, lines, digits=6)


def _numbers(interval: Interval) -> tuple[float, float, float, int]:
    return interval.mean, interval.low, interval.high, interval.n


def check_place(place: Path) -> None:
    """Make the folder; raises InvalidInputError where none can be."""
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{place}: nothing can be written there ({error.strerror})") from None


def publish_results(folder: Path, found: Results, place: Path) -> None:
    """What of a finished run is small enough for the documentation: figures, and the first scores as CSV."""
    check_place(place)
    try:
        for picture in folder.glob("*.png"):
            shutil.copyfile(picture, place / picture.name)
        for name in (CONFIG_TOML, CALIBRATION):
            shutil.copyfile(folder / name, place / name)
    except OSError as error:
        raise InvalidInputError(f"{place}: nothing can be written there ({error.strerror})") from None
    write_units(place / "claim.csv", found, PUBLISHED, digits=4)
    shown = {*HEADLINE, *BOUND_NAMES}
    with (folder / "summary.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    write_table(place / "summary.csv", rows[0], (row for row in rows[1:] if row[3] in shown))


def left_out(failed: Mapping[Unit, str]) -> str:
    """A sentence of what failed."""
    if not failed:
        return ""
    unit, why = next(iter(failed.items()))
    return f"{len(failed)} units failed and are left out; the first: {' '.join(map(str, asdict(unit).values()))}: {why}"


def first_noise_means(config: ClaimConfig, values: Values) -> dict[str, list[Score]]:
    """All scores of the arms under the first noise and rule of fusion: means."""
    noise, fusion = config.noises[0].name, config.fusions[0]
    names = [name for name in values.units if not name.startswith((FLOOR, PREFIX))]
    return {
        f"{noise}, {fusion}, {arm}": [
            Score(name, values.mean(cell), values.units[name], config.n_seeds * len(config.worlds))
            for name in names
            if (cell := Cell(noise, fusion, arm, name)) in values
        ]
        for arm in config.by_arm
    }
