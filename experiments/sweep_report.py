"""What a sweep leaves in its run folder: the table, a figure, and a report of what is best."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from stereogrid.figures import save_figure
from stereogrid.report import ReportFigure, ReportTable, write_report
from stereogrid.scoring import SCORE_NAMES, Score
from stereogrid.scoring.names import COVERAGE, RANKING
from stereogrid.scoring.paired import Interval, bootstrap_mean

from .claim_statistics import THESE, Cell, Difference, Values, differences_of, over_worlds
from .claim_units import Unit
from .compared import BOOTSTRAP_SEED, interval_text, labelled, plain
from .drives import HEADLINE, obstacle_meanings
from .sweep_config import Setting, SweepConfig, SweepUnit
from .sweep_figure import sweep_figure
from .sweep_table import Made, rows_of, write_tables

BEST = 5
NOTE = (
    "Means over the seeds with bootstrap 95 % intervals; {ranked}. A difference is paired, seed by seed, with "
    "{reference}. * Its "
    "interval excludes zero and p < .05 (sign-flip test, Holm's rule for {n} settings, of which fewer than {seeds} "
    "seeds can never tell). The best of many looks better than it is: map it once more with other seeds."
)
ALL_MADE = "the best first"
SOME_FAILED = (
    "the best first of those of which every map was made, then the others by their difference on the seeds that they "
    "have: a mean over the seeds that were easy enough says too much"
)
Differences = Mapping[tuple[Cell, str], Difference]


def write_sweep(
    folder: Path, config: SweepConfig, results: Sequence[Made], *, facts: Mapping[str, str]
) -> list[ReportTable]:
    """sweep.csv, sweep.parquet, the figure and the report; the tables for the screen."""
    write_tables(folder, rows_of(config, results))
    values = values_of(results)
    failed, tables, figures = failure_table(results), [], []
    if values.cells:
        tables = [best_table(config, values)]
        path = save_figure(sweep_figure(config, values), folder / "sweep.png", 110)
        figures = [ReportFigure(path, caption(config))]
    write_report(
        folder,
        "A sweep",
        summary=summary(config, results),
        arms=first_and_best(config, values),
        figures=figures,
        facts=facts,
        headline=HEADLINE,
        meanings=obstacle_meanings(config.base.obstacles_m),
        tables=[*tables, *([failed] if failed else [])],
        config=config,
    )
    return tables


def summary(config: SweepConfig, results: Sequence[Made]) -> str:
    """What was run, and how much of it failed, in a few sentences."""
    varied = "; ".join(axis.label for axis in config.axes) or "nothing"
    n_failed = sum(bool(each.error) for each in results)
    return (
        f"{len(config.settings)} settings x {len(config.the_worlds)} worlds x {len(config.the_seeds)} seeds: "
        f"{len(results)} maps of simulated drives, scored against the true mesh. Varied: {varied}. "
        + (f"{n_failed} of them failed and are listed. " if n_failed else "None of them failed. ")
        + "All scores of all maps stand in sweep.csv and sweep.parquet."
    )


def caption(config: SweepConfig) -> str:
    """How to read the figure."""
    rest = ", ".join(axis.label for axis in config.axes[3:])
    return (
        f"{config.score} ({'higher' if higher_is_better(config.score) else 'lower'} is better): means over the seeds "
        "with bootstrap 95 % intervals; small dots: the seeds." + (f" Means over all values of {rest}." if rest else "")
    )


def higher_is_better(score: str) -> bool:
    """Whether the better of two maps has more of it."""
    name = score.removeprefix("obstacle_").removeprefix("floor_")
    for end in ("_tolerant", "_all"):
        name = name.removesuffix(end)
    return name in COVERAGE or name in RANKING or name.startswith("surface_f1")


def values_of(results: Sequence[Made]) -> Values:
    """The scores where claim_statistics finds them: a setting is an arm."""
    return Values(
        {Unit(each.unit.world, "", each.unit.seed, "", each.unit.setting.label): each.scores for each in results}
    )


def cell_of(setting: Setting, score: str) -> Cell:
    """Where a setting's score stands among the values."""
    return Cell("", "", setting.label, score)


def name_of(unit: SweepUnit) -> str:
    """A unit, for a person."""
    return f"{unit.setting.label or 'base'}, {unit.world}, seed {unit.seed}"


def failure_table(results: Sequence[Made]) -> ReportTable | None:
    """A row a map that failed."""
    rows = [
        [each.unit.setting.label or "base", each.unit.world, str(each.unit.seed), each.error]
        for each in results
        if each.error
    ]
    header = ["setting", "world", "seed", "error"]
    note = "They are not tried again unless asked for: --retry-failed."
    return ReportTable("What failed", header, rows, n_names=4, note=note) if rows else None


def best_table(config: SweepConfig, values: Values) -> ReportTable:
    """The best settings in each world, and over all of them, beside the reference."""
    cells = [cell_of(setting, config.score) for setting in config.settings if setting != config.reference]
    cells = [cell for cell in cells if cell in values]
    found = differences_of(values, cells, config.reference.label)
    differences = {(each.cell, each.world): each for each in found}
    rows = []
    for world in (*config.the_worlds, *([THESE] if len(config.the_worlds) > 1 else [])):
        means = {setting.choices: mean_in(values, cell_of(setting, config.score), world) for setting in config.settings}
        ranked = ranking(config, values, config.the_worlds if world == THESE else [world])
        shown = [s for n, s in enumerate(ranked) if n < BEST or s == config.reference]
        rows += [_row(config, setting, world, means[setting.choices], differences) for setting in shown]
    unit = values.units.get(config.score, SCORE_NAMES.get(config.score, ("1", ""))[0])
    header = ["world", *(axis.label for axis in config.axes), labelled(config.score, unit), "difference", "seeds"]
    caption = f"Best by {config.score}"
    if len({row[-1] for row in rows}) == 1:
        caption += f", {rows[0][-1]} seeds"
        header, rows = header[:-1], [row[:-1] for row in rows]
    return ReportTable(
        caption,
        header,
        rows,
        n_names=1 + len(config.axes),
        note=NOTE.format(
            ranked=ALL_MADE
            if all(is_whole(config, values, each, config.the_worlds) for each in config.settings)
            else SOME_FAILED,
            reference=config.reference.label or "itself",
            n=len(cells),
            seeds=fewest_seeds(len(cells)),
        ),
    )


def fewest_seeds(n_settings: int) -> int:
    """With so many seeds the smallest p of a sign-flip test, 2 of 2^n, is below .05 when corrected for the settings."""
    return math.floor(math.log2(2 * max(n_settings, 1) / 0.05)) + 1


def _row(config: SweepConfig, setting: Setting, world: str, mean: Interval, differences: Differences) -> list[str]:
    names = [axis.text(choice) for axis, choice in zip(config.axes, setting.choices, strict=True)]
    # Only over all worlds is p corrected for the number of settings; of one world, that is the world.
    over_all = world == THESE or len(config.the_worlds) == 1
    found = differences.get((cell_of(setting, config.score), THESE if over_all else world))
    text = "reference" if setting == config.reference else "-"
    if found:
        text = interval_text(found.interval) + (" *" if over_all and found.excludes_zero else "")
    return [world, *names, mean_text(mean), text, str(mean.n)]


def mean_text(mean: Interval) -> str:
    """As 0.912 [0.905, 0.919]; dashes where there is no number."""
    return f"{plain(mean.mean)} [{plain(mean.low)}, {plain(mean.high)}]"


def mean_in(values: Values, cell: Cell, world: str) -> Interval:
    """The mean over the seeds, in a world or over THESE."""
    by_world = values.seeds(cell)
    numbers = over_worlds(by_world) if world == THESE else list(by_world.get(world, {}).values())
    return bootstrap_mean(numbers, rng=np.random.default_rng(BOOTSTRAP_SEED))


def ranking(config: SweepConfig, values: Values, worlds: Sequence[str]) -> list[Setting]:
    """The settings, the best in these worlds first; those that lack maps after all others, without a number last.

    Of whole ones the means are of the same worlds and seeds. Those that lack some are compared on what they have, by
    the difference from the reference there: a setting that fails on what is hard would else look the best.
    """
    sign = -1 if higher_is_better(config.score) else 1

    def place(setting: Setting) -> tuple[bool, bool, float]:
        cell = cell_of(setting, config.score)
        whole = is_whole(config, values, setting, worlds)
        found = values.seeds(cell) if whole else values.differences(cell, config.reference.label)
        by_world = ([each for each in found.get(world, {}).values() if math.isfinite(each)] for world in worlds)
        means = [np.mean(numbers) for numbers in by_world if numbers]
        mean = float(np.mean(means)) if means else math.nan
        return not whole, math.isnan(mean), 0.0 if math.isnan(mean) else sign * mean

    return sorted(config.settings, key=place)


def is_whole(config: SweepConfig, values: Values, setting: Setting, worlds: Sequence[str]) -> bool:
    """Whether a setting has a number in each of these worlds with every seed."""
    found = values.seeds(cell_of(setting, config.score))
    return all(math.isfinite(found.get(world, {}).get(seed, math.nan)) for world in worlds for seed in config.the_seeds)


def first_and_best(config: SweepConfig, values: Values) -> dict[str, list[Score]]:
    """All scores of the reference and of the best setting over the worlds: means."""
    shown = [config.reference, ranking(config, values, config.the_worlds)[0]]
    return {setting.label or "base": _means(values, setting) for setting in shown}


def _means(values: Values, setting: Setting) -> list[Score]:
    return [
        Score(name, values.mean(cell), unit, sum(map(len, values.worlds(cell).values())))
        for name, unit in values.units.items()
        if (cell := cell_of(setting, name)) in values
    ]
