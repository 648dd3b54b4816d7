"""What the robot drives on: how well its tyres hold there, and what rolling costs."""

from dataclasses import dataclass

from stereogrid.errors import InvalidInputError, unknown_name


@dataclass(frozen=True)
class Surface:
    """A kind of ground.

    friction: the greatest tyre force as a share of the load. rolling: the force that rolling costs, as a share of
    the load. creep: slip as a share of the speed at which a tyre would give all its force if the force went on
    growing as it does for a small slip; soft ground has more.
    """

    friction: float
    rolling: float
    creep: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < 2:
                raise InvalidInputError(f"{name} of a surface must be in (0, 2), not {value}")


SURFACES: dict[str, Surface] = {
    "vinyl": Surface(friction=0.80, rolling=0.012, creep=0.01),
    "carpet": Surface(friction=0.95, rolling=0.030, creep=0.02),
    "wood": Surface(friction=0.60, rolling=0.012, creep=0.01),
    "tiles": Surface(friction=0.65, rolling=0.012, creep=0.01),
    "concrete": Surface(friction=0.90, rolling=0.015, creep=0.01),
    "asphalt": Surface(friction=0.85, rolling=0.018, creep=0.01),
    "paving": Surface(friction=0.75, rolling=0.020, creep=0.01),
    "gravel": Surface(friction=0.55, rolling=0.050, creep=0.04),
    "grass": Surface(friction=0.45, rolling=0.070, creep=0.06),
    "ice": Surface(friction=0.10, rolling=0.010, creep=0.01),
}


def find_surface(name: str) -> Surface:
    """The surface of that name. Raises InvalidInputError for an unknown one."""
    if name not in SURFACES:
        raise unknown_name("surface", name, SURFACES)
    return SURFACES[name]
