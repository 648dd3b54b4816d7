"""What a robot's raw numbers mean: it depends on the subclass that it names in the handshake."""

from dataclasses import dataclass

from .errors import ArcosError


@dataclass(frozen=True)
class Robot:
    """Factors from the wire's units. In brackets the names that the vendor's parameter files use.

    distance_mm: of one unit of x and y (DistConvFactor). angle_rad: of one unit of heading (AngleConvFactor).
    velocity_mmps, range_mm: of one unit of speed and of a sonar's range (VelConvFactor, RangeConvFactor).
    turn_per_difference: [rad/mm] turn rate from half the difference of the wheels' speeds (DiffConvFactor).
    vel2_mmps: of one unit of VEL2 (Vel2Divisor). max_mmps, max_turn_degps: what a client may ask for.
    baud: the serial speed that clients switch to.
    """

    distance_mm: float
    angle_rad: float = 0.001534
    velocity_mmps: float = 1.0
    range_mm: float = 1.0
    turn_per_difference: float = 0.0034
    vel2_mmps: int = 20
    max_mmps: int = 1200
    max_turn_degps: int = 300
    baud: int = 38400

    @property
    def effective_track_m(self) -> float:
        """The distance of two wheels that would turn the robot as its tyres do by skidding [m]."""
        return 2 / self.turn_per_difference / 1000


ROBOTS: dict[str, Robot] = {
    "p3at": Robot(distance_mm=0.465),
    "p3at-sh": Robot(distance_mm=1.0),
}


def robot_of(subclass: str) -> Robot:
    """The factors of a subclass, in any case; one with what it carries, as p3at-sh-lms500, has those of p3at-sh.

    Raises ArcosError, with the choices, for an unknown one.
    """
    name = subclass.strip().lower()
    for known in sorted(ROBOTS, key=len, reverse=True):
        if name == known or name.startswith(f"{known}-"):
            return ROBOTS[known]
    raise ArcosError(f"no robot of the subclass {subclass!r}; choose from: {', '.join(sorted(ROBOTS))}")
