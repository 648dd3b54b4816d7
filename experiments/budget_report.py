"""What an error budget leaves in its run folder."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from stereogrid.figures import save_figure
from stereogrid.geometry import FloatArray
from stereogrid.report import ReportFigure, ReportTable, write_metrics, write_report
from stereogrid.scoring import SCORE_NAMES, Score
from stereogrid.scoring.paired import Interval, hierarchical_mean

from .budget_arms import REAL, Arm, Step, ladder, made_real, made_true
from .compared import BOOTSTRAP_SEED, Compared, interval_text, plain
from .tidy import write_scores, write_table

Unit = tuple[str, int]
"""World and seed."""
UNITS = "units (world x seed)"
SHOWN = (
    "log_loss_all",
    "brier_balanced_all",
    "ece_width",
    "auc_all",
    "occupied_f1_all",
    "obstacle_log_loss_all",
    "obstacle_auc_all",
    "obstacle_occupied_f1_all",
    "coverage_occupied",
)
SUMMARY = (
    "Where does a map's error come from? Each cause is made true while all others stay real (what mending it alone "
    "would gain), and made real while all others are true (what it alone would cost). The two differ, since effects do "
    "not add up: noise hides noise. Matching: the true disparity; its images: those of cameras without any fault but "
    "calibration. Calibration: the right camera's rotation is known. Odometry: true poses. Cells: half as large, laid "
    "back into usual ones. Fusion: the map's probabilities become the frequencies that they should have been, the "
    "order of the cells staying (isotonic, fitted to the truth itself: no fusion that keeps the order can do better). "
    "Labels: every cell that the map touched gets its true label; what is left is what it never touched."
)


@dataclass(frozen=True)
class Error:
    """An error that the budget splits: a score, or what it lacks to 1."""

    score: str
    label: str
    lacks: bool = False

    def of(self, values: FloatArray | Sequence[float]) -> FloatArray:
        """The error (N,) of the score's values (N,)."""
        return 1 - np.asarray(values) if self.lacks else np.asarray(values)


ERRORS = (
    Error("log_loss_all", "log-loss of all cells in view [nat]"),
    Error("auc_all", "1 - AUC of all cells in view", lacks=True),
    Error("obstacle_occupied_f1_all", "1 - F1 of obstacles", lacks=True),
)


@dataclass(frozen=True)
class Budget:
    """scores[arm][unit] of every arm. finest: cells of the arm that has the smallest, 0: none."""

    scores: Mapping[str, Mapping[Unit, Sequence[Score]]]
    arms: Mapping[str, Arm]
    finest: int

    @property
    def compared(self) -> Compared:
        """The arms beside the one in which all is real."""
        return Compared("Error budget", self.scores, REAL, SHOWN, UNITS)

    @property
    def readings(self) -> dict[str, list[Step]]:
        """The two readings by what they are called."""
        return {"made true, all else real": made_true(self.finest), "made real, all else true": made_real()}

    @property
    def ladder(self) -> list[tuple[str, str]]:
        """(what has been made true last, arm) from all real to the labels."""
        return ladder(self.arms)

    def error(self, arm: str, error: Error) -> FloatArray:
        """The arm's error (N,) for each unit."""
        return error.of(self.compared.values(arm, error.score))

    def gap(self, step: Step, error: Error) -> Interval:
        """The error of the step's worse arm less that of the better, over these worlds, with other seeds."""
        by_world = list(self._gaps(step, error).values())
        return hierarchical_mean(by_world, rng=np.random.default_rng(BOOTSTRAP_SEED)).these_worlds

    def by_world(self, step: Step, error: Error) -> dict[str, float]:
        """The same of each world alone."""
        return {world: float(gaps.mean()) for world, gaps in self._gaps(step, error).items()}

    def _gaps(self, step: Step, error: Error) -> dict[str, FloatArray]:
        """Of each world: the difference for each seed."""
        gaps = self.error(step.worse, error) - self.error(step.better, error)
        worlds = np.array([world for world, _ in self.scores[REAL]])
        return {name: gaps[worlds == name] for name in dict.fromkeys(worlds.tolist())}


def write_results(
    folder: Path,
    budget: Budget,
    *,
    facts: Mapping[str, str],
    config: object = None,
) -> list[ReportTable]:
    """Numbers, the figure and the report of the run; the tables for the screen."""
    from .budget_figure import budget_figure

    readings = [reading_table(budget, name) for name in budget.readings]
    tables = [*readings, arms_table(budget)]
    write_numbers(folder, budget, facts)
    figure = save_figure(budget_figure(budget), folder / "budget.png", dots_per_inch=110)
    caption = (
        "Bars: mean over the worlds with its 95 % interval for other seeds; marks: the worlds. Left, what mending a "
        "cause alone gains; middle, what it costs when all else is perfect; right, one cause after the other made true."
    )
    write_report(
        folder,
        "An error budget",
        summary=SUMMARY,
        arms={arm: next(iter(units.values())) for arm, units in budget.scores.items()},
        figures=[ReportFigure(figure, caption)],
        facts=facts,
        meanings={f"obstacle_{name}": f"{meaning}; obstacles" for name, (_, meaning) in SCORE_NAMES.items()},
        tables=tables,
        config=config,
    )
    (folder / "tables.md").write_text("\n".join(table.markdown for table in tables), encoding="utf-8")
    return readings


def reading_table(budget: Budget, reading: str) -> ReportTable:
    """A row a cause: by how much the errors differ."""
    rows = [
        [f"- {step.what}" if step.part else step.what, *(interval_text(budget.gap(step, error)) for error in ERRORS)]
        for step in budget.readings[reading]
    ]
    note = (
        f"Means over {budget.compared.n_units} {UNITS} with bootstrap 95 % intervals for other seeds, which are not "
        "corrected for their number and say nothing of other worlds. Indented: parts of the row above, or more of it."
    )
    return ReportTable(f"Error by cause, {reading}", ["cause", *(error.label for error in ERRORS)], rows, note=note)


def arms_table(budget: Budget) -> ReportTable:
    """A row an arm, a column a score: means over the units."""
    compared = budget.compared
    rows = [[arm, *(plain(compared.mean(arm, name).mean) for name in SHOWN)] for arm in budget.scores]
    return ReportTable("Scores of every arm", ["arm", *map(compared.label, SHOWN)], rows, note=f"Means over {UNITS}.")


def write_numbers(folder: Path, budget: Budget, facts: Mapping[str, str]) -> None:
    """scores.csv, a line a score of an arm on a unit; budget.csv, a line a step of a reading; metrics.json."""
    flat = {
        (world, seed, arm): scores for arm, units in budget.scores.items() for (world, seed), scores in units.items()
    }
    write_scores(folder / "scores.csv", ("world", "seed", "arm"), flat)
    steps = {
        (reading, step.what, error.label): asdict(budget.gap(step, error))
        for reading, lines in budget.readings.items()
        for step in lines
        for error in ERRORS
    }
    header = ["reading", "cause", "error", "mean", "low", "high", "n"]
    write_table(folder / "budget.csv", header, ([*key, *gap.values()] for key, gap in steps.items()))
    nested = {
        " | ".join(key): {name: value if isfinite(value) else None for name, value in gap.items()}
        for key, gap in steps.items()
    }
    write_metrics(folder, {"facts": facts, "budget": nested})
