"""How a robot's motion error grows with the way, as repeated runs tell: eps of Eq. 13, and the ways to use it."""

from dataclasses import dataclass, field

import numpy as np

from ..errors import InvalidInputError, unknown_name
from ..observation import Odometry

WAYS = ("none", "linear", "rss", "pose", "submaps")
"""What a map makes of the motion error.

none: poses are taken as exact. linear: eps is added to the width of every reading, as the paper has it. rss: as
independent errors add. pose: the covariance of each pose, along each ray and across it. submaps: pieces of the drive
are mapped as if poses were exact, and then laid into the map wherever they may lie.
"""


@dataclass(frozen=True)
class Growth:
    """A variance that grows with a length d: a d + (b d)^2.

    a: what each part of the way adds anew (random slip). b: what a run keeps from its start to its end (a wrong scale).
    Both terms are needed (the paper's "repetitive experiments" are the runs that tell them apart).
    """

    a: float = 0.0
    b: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise InvalidInputError(f"{name} must be >= 0 and finite, not {value}")

    def sigma(self, length: float) -> float:
        """The standard deviation after that length."""
        return float(np.sqrt(self.a * length + np.square(self.b * length)))


@dataclass(frozen=True)
class MotionError:
    """What is wrong with a pose that odometry tells, since the pose was last certain.

    along [m], across [m] the heading, and heading [rad]: growing with the distance travelled [m]; across is what the
    heading's own error does not explain. turn [rad]: of the heading, growing with the angle turned [rad].
    position_m, heading_rad: what each pose errs by anew and that does not grow, as of a robot that is tracked from
    outside. kappa: 1 for standard deviations, as disparity sigmas are. way: one of WAYS. submap_m: length of the pieces
    of the way "submaps" [m]. All errors zero: poses are exact.
    """

    way: str = "rss"
    kappa: float = 1.0
    submap_m: float = 2.0
    position_m: float = 0.0
    heading_rad: float = 0.0
    along: Growth = field(default_factory=Growth)
    across: Growth = field(default_factory=Growth)
    heading: Growth = field(default_factory=Growth)
    turn: Growth = field(default_factory=Growth)

    def __post_init__(self) -> None:
        if self.way not in WAYS:
            raise unknown_name("way to use the motion error", self.way, WAYS)
        for name in ("kappa", "submap_m", "position_m", "heading_rad"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InvalidInputError(f"{name} must be >= 0 and finite, not {getattr(self, name)}")

    def sigma_m(self, odometry: Odometry) -> float:
        """eps [m] of Eq. 13 at this reading: the error along the way, kappa sqrt(position^2 + a d + b^2 d^2)."""
        return float(self.kappa * np.hypot(self.position_m, self.along.sigma(odometry.travelled_m)))

    @property
    def is_zero(self) -> bool:
        """Whether poses are exact."""
        growths = (self.along, self.across, self.heading, self.turn)
        return self.kappa == 0 or not (self.position_m or self.heading_rad or any(g.a or g.b for g in growths))
