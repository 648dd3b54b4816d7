"""Where the robot truly is, as a person types it: with a unit or in the one that was asked for."""

import math
import re

from stereogrid.errors import InvalidInputError
from stereogrid.motion.runs_csv import ANGLES, LENGTHS

_ANSWER = re.compile(r"([+-]?\d+(?:[.,]\d+)?|[+-]?[.,]\d+)\s*([a-z°]*)")
_ALSO = {"°": "deg", "degree": "deg", "degrees": "deg", "radians": "rad"}


def length_m(answer: str) -> float:
    """A length [m] from "2012", "2012 mm", "201.2 cm" or "2.012 m"; a bare number counts millimetres."""
    return _value(answer, LENGTHS, "mm", "a length such as 2012, 2012 mm or 2.012 m")


def angle_rad(answer: str) -> float:
    """An angle [rad] from "1.5", "1.5 deg" or "0.026 rad"; a bare number counts degrees."""
    return _value(answer, ANGLES, "deg", "an angle such as 1.5, 1.5 deg or 0.026 rad")


def _value(answer: str, units: dict[str, float], bare: str, wanted: str) -> float:
    found = _ANSWER.fullmatch(answer.strip().lower())
    unit = found and (_ALSO.get(found[2], found[2]) or bare)
    if not found or unit not in units:
        raise InvalidInputError(f"{answer.strip()!r} is not {wanted}")
    return float(found[1].replace(",", ".")) * units[unit]


def far_off(true: tuple[float, float, float], odo: tuple[float, float, float]) -> str:
    """Why a measured pose (ahead [m], left [m], heading [rad]) is doubtful beside the odometry's; "" where it is not.

    No robot errs by so much on an ordinary floor; a digit too many does.
    """
    reach_m = math.hypot(*odo[:2])
    away_m = math.dist(true[:2], odo[:2])
    if away_m > 0.05 + 0.1 * reach_m:
        return (
            f"odometry says {round(1000 * odo[0])} mm ahead and {round(1000 * odo[1])} mm to the left, which is "
            f"{round(1000 * away_m)} mm from there"
        )
    turned_rad = math.remainder(true[2] - odo[2], 2 * math.pi)
    if abs(turned_rad) > math.radians(15):
        return f"odometry says {math.degrees(odo[2]):.1f} degrees to the left, which is far from that"
    return ""
