"""How uncertain a disparity is: a standard deviation for every pixel, by a small fitted table for each matcher.

log sigma is a sum of one part a cue (see sigma_cues), so that a table holds a few numbers a cue. The tables are fitted
to pairs whose disparity is known so that of the errors of matched, visible pixels 68 % are within one sigma and 95 %
within two; `python -m experiments sigma` fits them and tests each on pairs that it was fitted without. Errors have
longer tails than a normal distribution's, of which these two shares say nothing.

Where the truth is a multiple of a step, its own rounding is no error of the matcher: the tables are fitted to what
remains when step^2 / 12 is taken from the squared error, so that against such a truth the shares are those of
sqrt(sigma^2 + step^2 / 12).
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from ..errors import InvalidInputError
from ..geometry import FloatArray
from ..observation import FloatImage, Image
from .sigma_cues import CUES, cues, look_up

SMALLEST_PX = 0.03
LARGEST_PX = 8.0
"""No sigma is larger; a window without texture has this one."""
GENERIC = "any"
"""The table of matchers that have none of their own, fitted to all the others at once."""
KNOTS: dict[str, tuple[float, ...]] = {
    "roughness_px": (0.03, 0.06, 0.12, 0.25, 0.5, 1.0),
    "around_px": (0.03, 0.06, 0.12, 0.25, 0.5, 1.0),
    "shift_px": (0.01, 0.02, 0.05, 0.12, 0.25, 0.5),
    "unmatched": (0.0, 0.05, 0.15, 0.3, 0.5, 1.0),
    "gradient": (0.5, 1.0, 2.0, 4.0, 8.0, 16.0),
}
"""Values of each cue between which its part of log sigma is a straight line."""


@dataclass(frozen=True)
class SigmaTable:
    """log_sigma: for each of CUES, its part of log(sigma / px) at KNOTS."""

    log_sigma: Mapping[str, tuple[float, ...]]

    def __post_init__(self) -> None:
        if set(self.log_sigma) != set(CUES):
            raise InvalidInputError(f"a sigma table needs the cues {', '.join(CUES)}, not {', '.join(self.log_sigma)}")
        for cue, parts in self.log_sigma.items():
            if len(parts) != len(KNOTS[cue]) or not np.isfinite(parts).all():
                raise InvalidInputError(f"{cue}: expected {len(KNOTS[cue])} finite numbers, not {parts}")

    def sigma_px(self, left: Image, right: Image, disparity_px: FloatImage) -> FloatImage:
        """sigma (H, W) [px], SMALLEST_PX to LARGEST_PX, of disparities (H, W); NaN exactly where these are."""
        sigma_px = np.array(disparity_px, np.float32)
        limits = np.array([SMALLEST_PX, LARGEST_PX], np.float32)
        look_up(cues(left, right, sigma_px), rows(KNOTS), rows(self.log_sigma), limits, sigma_px)
        return sigma_px


def rows(of_cues: Mapping[str, tuple[float, ...]]) -> FloatArray:
    """(cues, knots) float32, in the order of CUES."""
    return np.array([of_cues[cue] for cue in CUES], np.float32)


def disparity_sigma_px(left: Image, right: Image, disparity_px: FloatImage, *, matcher: str) -> FloatImage:
    """Standard deviation (H, W) [px] of the disparities (H, W) that a matcher of this name found in a pair (H, W).

    NaN exactly where the disparity is; elsewhere SMALLEST_PX to LARGEST_PX. Matchers without a table have GENERIC's.
    """
    tables = sigma_tables()
    return tables.get(matcher, tables[GENERIC]).sigma_px(left, right, disparity_px)


@cache
def sigma_tables() -> Mapping[str, SigmaTable]:
    """The fitted tables by matcher, and GENERIC."""
    text = resources.files(__package__).joinpath("sigma_tables.json").read_text(encoding="utf-8")
    return {name: SigmaTable({c: tuple(p) for c, p in t.items()}) for name, t in json.loads(text)["tables"].items()}
