"""What an experiment on one drive leaves in its run folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from stereogrid.map_report import (
    Drawn,
    draw_all,
    map_drawings,
    reliability_drawing,
    save_trajectory,
    trajectory_drawing,
)
from stereogrid.map_truth import KnownTruth
from stereogrid.mapping_run import Mapped
from stereogrid.observation import Recording
from stereogrid.report import ReportTable, write_metrics, write_report
from stereogrid.scoring import Score, scores_to_dict
from stereogrid.scoring.meanings import OF_CELLS
from stereogrid.scoring.score import DIMENSIONLESS
from stereogrid.scoring.truth import KnowsTruth, MapTruth

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
    config: object = None,
    heights_m: Sequence[float],
    step: Step,
) -> None:
    """Maps, metrics, figures and the report of the run, into its folder."""
    for name, outcome in outcomes.items():
        outcome.mapped.grid.save(folder / f"map-{_slug(name)}.sgrid")
        save_trajectory(outcome.mapped, folder / f"trajectory-{_slug(name)}.tum")
    notes = [OF_CELLS, truth.interval_note]
    metrics = {"facts": facts, "notes": notes, "arms": {n: scores_to_dict(o.scores) for n, o in outcomes.items()}}
    write_metrics(folder, metrics)
    drawn = draw(folder, drive, truth, outcomes, step=step)
    write_report(
        folder,
        story.title,
        summary=story.summary,
        arms={name: outcome.scores for name, outcome in outcomes.items()},
        figures=drawn.figures,
        facts={**facts, **{f"map sha256, {n}": o.mapped.grid.sha256() for n, o in outcomes.items()}},
        headline=HEADLINE,
        meanings=obstacle_meanings(heights_m),
        notes=[*notes, *drawn.left_out],
        config=config,
    )


def draw(folder: Path, drive: Recording, truth: MapTruth, outcomes: Mapping[str, Outcome], *, step: Step) -> Drawn:
    """The figures of the main arm, the noisy one's way, and both their reliabilities; step after each."""
    poses = drive.true_poses() if isinstance(drive, KnowsTruth) else None
    known = KnownTruth(truth, poses=poses)
    disparity, section, cubes, *_ = map_drawings(outcomes[IDEAL].mapped, drive, KnownTruth(truth))
    noisy = outcomes[NOISY].mapped
    drawings = [
        disparity,
        section,
        cubes,
        trajectory_drawing(noisy.path_m, known.path_m(len(noisy.path_m)), f"{NOISY} arm"),
        *(reliability_drawing(f"reliability-{n}", outcomes[n].mapped, truth, f"{n} arm") for n in (IDEAL, NOISY)),
    ]
    return draw_all(drawings, folder, counted(step))


def _slug(name: str) -> str:
    """An arm's name in the name of a file."""
    return name.replace(",", "").replace(" ", "-")


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
