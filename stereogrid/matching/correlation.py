"""How far a matcher's errors go together: over the image, and from one observation to the next.

Numbers a matcher, measured against known disparity by `python -m experiments correlation`, which says how. They are
those of its default options: a larger window reaches further.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

from ..errors import InvalidInputError
from .sigma import GENERIC


@dataclass(frozen=True)
class ErrorReach:
    """How far the errors of a matcher go together.

    correlation_px: side L of the square of pixels that carries one independent look: the mean over a window of A >> L^2
    pixels has the variance L^2 / A of one pixel's. temporal_share: of the variance, what changes from frame to frame
    while nothing moves, 0 to 1. decorrelation_px: image motion beyond which the errors of one surface point correlate
    by less than .3 (inf: never). lasting_share: their correlation after motions of 16 to 64 px, -1 to 1.
    """

    correlation_px: float
    temporal_share: float
    decorrelation_px: float
    lasting_share: float

    def __post_init__(self) -> None:
        if not 1 <= self.correlation_px < math.inf:
            raise InvalidInputError(f"correlation_px must be finite and >= 1, not {self.correlation_px}")
        if not self.decorrelation_px >= 0:
            raise InvalidInputError(f"decorrelation_px must be >= 0, not {self.decorrelation_px}")
        for name, least in (("temporal_share", 0), ("lasting_share", -1)):
            if not least <= getattr(self, name) <= 1:
                raise InvalidInputError(f"{name} must be {least} to 1, not {getattr(self, name)}")


def error_reach(matcher: str) -> ErrorReach:
    """The reach of the errors of the matcher of this name; of one that was not measured, GENERIC's: the longest."""
    measured = error_reaches()
    return measured.get(matcher, measured[GENERIC])


def error_correlation_px(matcher: str) -> float:
    """Side [px] of the square of pixels that carries one independent look at the disparity; see ErrorReach."""
    return error_reach(matcher).correlation_px


def temporal_share(matcher: str) -> float:
    """Share of the error variance that changes from frame to frame while nothing moves; see ErrorReach."""
    return error_reach(matcher).temporal_share


@cache
def error_reaches() -> Mapping[str, ErrorReach]:
    """What was measured, by matcher, and GENERIC."""
    text = resources.files(__package__).joinpath("correlation_lengths.json").read_text(encoding="utf-8")
    return {name: _from_json(held) for name, held in json.loads(text)["matchers"].items()}


def _from_json(held: Mapping[str, float | None]) -> ErrorReach:
    """JSON has no infinity: null stands for it."""
    return ErrorReach(**{name: math.inf if value is None else value for name, value in held.items()})
