"""What an experiment on one drive leaves in its run folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stereogrid.figures import reliability_figure, save_figure
from stereogrid.mapping_run import Mapped, draw_map
from stereogrid.observation import Recording
from stereogrid.report import ReportFigure, ReportTable, write_metrics, write_report
from stereogrid.scoring import Score, scores_to_dict
from stereogrid.scoring.score import DIMENSIONLESS
from stereogrid.scoring.truth import MapTruth

from .drives import HEADLINE, obstacle_meanings
from .parallel import Step, counted

IDEAL, NOISY, TRUE_DEPTH, SHUFFLED = "ideal", "noisy", "true depth", "shuffled poses"
KNOWN_TILT = "noisy, known tilt"


@dataclass(frozen=True)
class Story:
    """What an experiment is called: name, of its run folders; title and summary, of its report."""

    name: str
    title: str
    summary: str


@dataclass(frozen=True)
class Outcome:
    """One arm's map and its scores."""

    mapped: Mapped
    scores: list[Score]

    def value(self, name: str) -> float:
        """The score of that name."""
        return next(score.value for score in self.scores if score.name == name)


def write_results(
    folder: Path,
    story: Story,
    drive: Recording,
    truth: MapTruth,
    outcomes: Mapping[str, Outcome],
    *,
    facts: Mapping[str, str],
    heights_m: Sequence[float],
    step: Step,
) -> None:
    """Maps, metrics, figures and the report of the run, into its folder."""
    for name, outcome in outcomes.items():
        outcome.mapped.grid.save(folder / f"map-{name.replace(',', '').replace(' ', '-')}.sgrid")
    write_metrics(folder, {"facts": facts, "arms": {n: scores_to_dict(o.scores) for n, o in outcomes.items()}})
    write_report(
        folder,
        story.title,
        summary=story.summary,
        arms={name: outcome.scores for name, outcome in outcomes.items()},
        figures=draw(folder, drive, truth, outcomes, step=step),
        facts=facts,
        headline=HEADLINE,
        meanings=obstacle_meanings(heights_m),
    )


def draw(
    folder: Path, drive: Recording, truth: MapTruth, outcomes: Mapping[str, Outcome], *, step: Step
) -> list[ReportFigure]:
    """The figures of the main arm, and its reliability beside the noisy one's; step after each of the five."""
    main = outcomes[IDEAL].mapped
    section_m = truth.section_m(float(np.median(main.path_m[:, 2])))
    figures = draw_map(main, drive, folder, counted(step), truth_segments_m=section_m)
    for name in (IDEAL, NOISY):
        figure = reliability_figure(truth.reliability(outcomes[name].mapped.grid), title=f"Reliability, {name}")
        path = save_figure(figure, folder / f"reliability-{name}.png")
        figures.append(ReportFigure(path, f"Are the probabilities of the {name} arm frequencies?"))
        step()
    return figures


def headline_table(outcomes: Mapping[str, Outcome]) -> ReportTable:
    """The first scores of every arm, for the screen."""
    units = {score.name: score.unit for score in next(iter(outcomes.values())).scores}
    rows = [
        [
            name,
            "" if units[name] == DIMENSIONLESS else units[name],
            *(f"{outcome.value(name):.3f}" for outcome in outcomes.values()),
        ]
        for name in HEADLINE
    ]
    return ReportTable("Scores", ["score", "unit", *outcomes], rows, n_names=2)
