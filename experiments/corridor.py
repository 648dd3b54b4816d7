"""The main experiment: drive down a corridor, map it, and compare the map with the truth.

The arms are those of drive_experiment. Cells of 5 cm and a range of 5 m: a corridor is 2.5 m wide, and everything in
it is near.
"""

from dataclasses import dataclass
from functools import partial

from .drive_experiment import DriveExperimentConfig, run_story
from .drive_report import IDEAL, NOISY, SHUFFLED, TRUE_DEPTH, Outcome, Story

__all__ = ["IDEAL", "NOISY", "SHUFFLED", "STORY", "TRUE_DEPTH", "CorridorConfig", "Outcome", "run"]

STORY = Story(
    "corridor",
    "The corridor experiment",
    "A simulated drive down a corridor, mapped by stereo and scored against the true mesh, on the cells that the "
    "cameras could see.",
)


@dataclass(frozen=True)
class CorridorConfig(DriveExperimentConfig):
    """The defaults of DriveExperimentConfig are the corridor's."""


run = partial(run_story, STORY)
