"""The outdoor twin of the corridor: drive through a park on uneven ground, map it, and compare with the truth.

The arms are those of drive_experiment, and one more: the robot of the noisy arm believes that the ground is level.
What stands outdoors is farther away and larger: the range is 8 m and the cells are 10 cm wide. Obstacles are counted by
their height above the ground below them, which climbs and falls.
"""

from dataclasses import dataclass, field
from functools import partial

from stereogrid.config import MappingConfig

from .drive_experiment import DriveExperimentConfig, bm_mapping, run_story
from .drive_report import Story

STORY = Story(
    "outdoor",
    "The outdoor experiment",
    "A simulated drive over uneven ground between trees, bushes and benches, mapped by stereo and scored against the "
    "true mesh, on the cells that the cameras could see. Wheels know of no slope: the noisy arm's odometry is level, "
    "and 'noisy, known tilt' is the same with the true height, roll and pitch, as from an inclinometer.",
)


@dataclass(frozen=True)
class OutdoorConfig(DriveExperimentConfig):
    """The corridor's parameters with an outdoor world's numbers."""

    world: str = "outdoor"
    known_tilt: bool = True
    score_range_m: float = 8.0
    obstacles_m: tuple[float, float] = (0.25, 2.4)
    mapping: MappingConfig = field(default_factory=lambda: bm_mapping(range_m=8.0, cell_m=0.1))


run = partial(run_story, STORY)
