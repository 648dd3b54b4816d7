"""The claim's numbers as tables."""

from collections.abc import Mapping, Sequence

import numpy as np

from stereogrid.report import ReportTable

from .claim_config import ClaimConfig, NoiseConfig
from .claim_statistics import LIKE_THESE, THESE, Cell, Difference, Values
from .claim_units import ANY, CONTROLS, END_ERROR
from .compared import interval_text, labelled, plain

CORE = ("auc_all", "log_loss_all", "ece_width_all")
"""Over all visible cells, with unknown ones at the prior: a map that abstains gains nothing by it."""
HEADLINE = (
    *CORE,
    "auc",
    "log_loss",
    "ece_width",
    "log_loss_balanced",
    "brier_balanced",
    "occupied_f1",
    "obstacle_auc",
    "obstacle_occupied_f1",
    "unsafe_occupied",
    "coverage",
    "accuracy_m",
    "completeness_m",
)
COVERED = tuple(f"bound_coverage_{kind}" for kind in ("along", "along_inliers", "across", "surface", "slant"))
OF_CONTROLS = ("auc", "auc_all", "obstacle_auc", "occupied_f1", "log_loss_all", "ece_width")
Differences = dict[tuple[Cell, str], Difference]


def shown(values: Values, names: Sequence[str]) -> list[str]:
    """Those of the scores that there are."""
    return [name for name in names if name in values.units]


def mean_tables(config: ClaimConfig, values: Values) -> list[ReportTable]:
    """For each noise and rule of fusion: a row a score, a column an arm."""
    return [
        ReportTable(
            f"{noise.name}, {fusion}: means",
            ["score", *config.by_arm],
            [
                [
                    labelled(name, values.units[name]),
                    *(plain(values.mean(Cell(noise.name, fusion, arm, name))) for arm in config.by_arm),
                ]
                for name in shown(values, HEADLINE)
            ],
            note=f"Means over {_seeds_text(config, noise, fusion)} a world, and then over {len(config.worlds)} worlds.",
        )
        for noise in config.noises
        for fusion in config.fusions
    ]


def _seeds_text(config: ClaimConfig, noise: NoiseConfig, fusion: str) -> str:
    """How many seeds means are of; arms with fewer are named, for their means are not of the same drives."""
    fewer = [
        f"{name}: the first {len(seeds)}"
        for name, arm in config.by_arm.items()
        if (seeds := config.seeds_of(arm, noise, fusion)) != config.seeds(noise) and fusion in config.fusions_of(arm)
    ]
    return f"{len(config.seeds(noise))} seeds" + (f" ({', '.join(fewer)})" if fewer else "")


def difference_tables(config: ClaimConfig, values: Values, differences: Differences) -> list[ReportTable]:
    """For each noise and rule of fusion: a row a score and world, a column an arm."""
    others = [arm for arm in config.by_arm if arm != config.reference]
    note = (
        f"Means of the paired differences from {config.reference} with bootstrap 95 % intervals over the seeds. "
        f"{THESE}: the mean over them, with other seeds (resampled as wholes: a seed draws the same errors in every "
        f"world); {LIKE_THESE}: with other worlds too (hierarchical bootstrap, "
        "at least Student's t over the worlds). * The interval excludes zero; for these worlds, besides, p < .05 of a "
        "sign-flip test, corrected by Holm's rule for all arms (ways and rules of fusion) of this noise and score. "
        "Higher is better of auc, f1 and coverage, lower of all else."
    )
    return [
        ReportTable(
            f"{noise.name}, {fusion}: differences from {config.reference}",
            ["score", "world", *others],
            [
                [
                    labelled(name, values.units[name]),
                    world,
                    *(difference_text(differences.get((Cell(noise.name, fusion, arm, name), world))) for arm in others),
                ]
                for name in shown(values, HEADLINE)
                for world in (*config.worlds, THESE, LIKE_THESE)
            ],
            n_names=2,
            note=note,
        )
        for noise in config.noises
        for fusion in config.fusions
        if others
    ]


def difference_text(found: Difference | None) -> str:
    """A difference with its interval, and a star where that excludes zero."""
    return "-" if found is None else interval_text(found.interval) + (" *" if found.excludes_zero else "")


def short_text(found: Difference | None) -> str:
    """A difference without its interval."""
    return "-" if found is None else f"{found.interval.mean:+.4f}" + (" *" if found.excludes_zero else "")


def coverage_table(config: ClaimConfig, values: Values, worlds: Sequence[str]) -> ReportTable:
    """Which share of the hits errs as little as is claimed: a row a noise, error and world, if several."""
    rows = [
        [
            noise.name,
            name.removeprefix("bound_coverage_"),
            *([world] if len(worlds) > 1 else []),
            *(coverage_text(values, Cell(noise.name, ANY, arm, name), world) for arm in config.by_arm),
        ]
        for noise in config.noises
        for name in shown(values, COVERED)
        for world in worlds
    ]
    note = (
        "Share of the hits whose error is within 1.96 of the claimed sigma, mean over the seeds; nominal .950. Along: "
        "of the point along its ray; inliers: without mismatches; across: across the ray, where the arm claims "
        "anything of it; surface: to the true mesh on the claimed ray; slant: the same, against the pose's whole "
        "covariance on that surface's slant, where the arm claims one (surface falls with the slant even where all is "
        "right)."
    )
    names = ["noise", "error", *(["world"] if len(worlds) > 1 else [])]
    return ReportTable("Is the error bounded?", [*names, *config.by_arm], rows, n_names=len(names), note=note)


def coverage_text(values: Values, cell: Cell, world: str) -> str:
    """The mean over the seeds of one world, or over the worlds."""
    return plain(values.mean(cell) if world == THESE else _mean(values.worlds(cell).get(world, [])))


def end_table(config: ClaimConfig, values: Values) -> ReportTable:
    """How large the noise is: root mean square of the last pose's error over the seeds, a column a world."""
    rows = []
    for noise in config.noises:
        ends = values.worlds(Cell(noise.name, ANY, config.reference, END_ERROR))
        rows.append([noise.name, *(plain(_mean(np.square(ends.get(world, []))) ** 0.5) for world in config.worlds)])
    note = f"Root mean square over the seeds; cells are {config.mapping.grid.cell_m:g} m wide."
    return ReportTable("Error of the last pose [m]", ["noise", *config.worlds], rows, note=note)


def control_table(config: ClaimConfig, values: Values) -> ReportTable | None:
    """The controls: a row each, a column a score."""
    ways = sorted({cell.way for cell in values.cells if cell.noise == CONTROLS})
    names = shown(values, OF_CONTROLS)
    rows = [
        [way, fusion, *(plain(values.mean(Cell(CONTROLS, fusion, way, name))) for name in names)]
        for fusion in config.fusions
        for way in ways
    ]
    note = (
        "True depth and poses: the ceiling. Nothing seen (prior only): chance. Shuffled poses: must collapse where it "
        "matters, among obstacles (a level floor survives). Told zero: poses are exact, and the mapper is told so: all "
        "ways must be alike."
    )
    return ReportTable("Controls", ["control", "fusion", *names], rows, n_names=2, note=note) if rows else None


def overview_table(config: ClaimConfig, differences: Differences, *, short: bool = False) -> ReportTable:
    """What the claim stands on: over all worlds; short: without intervals."""
    text = short_text if short else difference_text
    others = [arm for arm in config.by_arm if arm != config.reference]
    rows = [
        [
            noise.name,
            fusion,
            name,
            *(text(differences.get((Cell(noise.name, fusion, arm, name), THESE))) for arm in others),
        ]
        for noise in config.noises
        for fusion in config.fusions
        for name in CORE
    ]
    caption = f"Over these worlds: differences from {config.reference}"
    note = "Marks and intervals as in the tables of differences below."
    return ReportTable(caption, ["noise", "fusion", "score", *others], rows, n_names=3, note=note)


def tuning_means(config: ClaimConfig, values: Values) -> dict[Cell, float]:
    """The mean of every score that candidates are chosen by."""
    names = shown(values, (*CORE, "log_loss_balanced", "brier_balanced"))
    return {
        cell: values.mean(cell)
        for noise in config.noises
        for fusion in config.fusions
        for arm in config.by_arm
        for name in names
        if (cell := Cell(noise.name, fusion, arm, name)) in values
    }


def tuning_table(config: ClaimConfig, means: Mapping[Cell, float]) -> ReportTable:
    """A row a candidate, noise and rule of fusion, a column a score."""
    names = list(dict.fromkeys(cell.score for cell in means))
    keys = dict.fromkeys((cell.noise, cell.fusion, cell.way) for cell in means)
    rows = [[*key, *(plain(means.get(Cell(*key, name), np.nan)) for name in names)] for key in keys]
    note = f"Means over {config.n_seeds} seeds a world, and then over {', '.join(config.worlds)}."
    return ReportTable("Candidates", ["noise", "fusion", "candidate", *names], rows, n_names=3, note=note)


def _mean(values: Sequence[float]) -> float:
    return float(np.nanmean(values)) if len(values) and not np.isnan(values).all() else np.nan
