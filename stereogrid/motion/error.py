"""How a robot's motion error grows with the way, as repeated runs tell: eps of Eq. 13, and the ways to use it."""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from ..described import Doc, check_fields
from ..errors import unknown_name
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

    Both terms are needed (the paper's "repetitive experiments" are the runs that tell them apart).
    """

    a: Annotated[
        float,
        Doc("What each part of the way adds anew (random slip).", "the error's unit^2 / the way's unit", least=0),
    ] = 0.0
    b: Annotated[
        float,
        Doc("What a run keeps from start to end (a wrong scale).", "the error's unit / the way's unit", least=0),
    ] = 0.0

    def __post_init__(self) -> None:
        check_fields(self)

    def sigma(self, length: float) -> float:
        """The standard deviation after that length."""
        return float(np.sqrt(self.a * length + np.square(self.b * length)))


@dataclass(frozen=True)
class MotionError:
    """What is wrong with a pose that odometry tells, since the pose was last certain. All errors zero: poses are exact.

    position_m and heading_rad do not grow, as of a robot that is tracked from outside; across is what the heading's own
    error does not explain.
    """

    way: Annotated[
        str,
        Doc(
            "What a map makes of the error. none: poses are taken as exact; linear: it widens every reading, as the "
            "paper has it; rss: the same, as independent errors add; pose: the covariance of each pose; submaps: "
            "pieces of the drive, laid wherever they may lie.",
            choices=WAYS,
        ),
    ] = "rss"
    kappa: Annotated[float, Doc("So many standard deviations; 1, as disparity sigmas are.", "1", least=0)] = 1.0
    submap_m: Annotated[float, Doc("Length of the pieces of the way submaps.", "m", least=0)] = 2.0
    position_m: Annotated[
        float, Doc("What each position errs by anew, and that does not grow: standard deviation.", "m", least=0)
    ] = 0.0
    heading_rad: Annotated[float, Doc("The same of each heading.", "rad", least=0)] = 0.0
    along: Annotated[
        Growth, Doc("Error along the heading [m], growing with the distance d travelled [m]: variance a d + (b d)^2.")
    ] = field(default_factory=Growth)
    across: Annotated[Growth, Doc("Error across it [m], growing with the distance travelled [m].")] = field(
        default_factory=Growth
    )
    heading: Annotated[Growth, Doc("Error of the heading [rad], growing with the distance travelled [m].")] = field(
        default_factory=Growth
    )
    turn: Annotated[Growth, Doc("Error of the heading [rad], growing with the angle turned [rad].")] = field(
        default_factory=Growth
    )

    def __post_init__(self) -> None:
        if self.way not in WAYS:
            raise unknown_name("way to use the motion error", self.way, WAYS)
        check_fields(self)

    def sigma_m(self, odometry: Odometry) -> float:
        """eps [m] of Eq. 13 at this reading: the error along the way, kappa sqrt(position^2 + a d + b^2 d^2)."""
        return float(self.kappa * np.hypot(self.position_m, self.along.sigma(odometry.travelled_m)))

    @property
    def is_zero(self) -> bool:
        """Whether poses are exact."""
        growths = (self.along, self.across, self.heading, self.turn)
        return self.kappa == 0 or not (self.position_m or self.heading_rad or any(g.a or g.b for g in growths))
