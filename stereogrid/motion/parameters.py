"""The numbers of a fit one by one, each with its interval and its unit, for tables and files."""

from collections.abc import Iterator
from dataclasses import dataclass

from .fit import MotionFit

UNITS = {
    "along": ("m", "1", "m", "m"),
    "across": ("m", "1", "m", "m"),
    "heading": ("rad^2/m", "rad/m", "rad", "m"),
    "turn": ("rad", "1", "rad", "rad"),
}
"""Of a, of b and the bias, of sigma, and of the length that they grow with."""
DIGITS = 3


@dataclass(frozen=True)
class Parameter:
    """One number of a fit: of which part, its name, itself, the bounds of its interval, its unit, how many runs."""

    part: str
    name: str
    value: float
    low: float
    high: float
    unit: str
    n: int

    @property
    def cells(self) -> list[str]:
        """Part, name, value, interval, unit and n, as text."""
        value, low, high = (f"{each:.{DIGITS}g}" for each in (self.value, self.low, self.high))
        return [self.part, self.name, value, f"{low} to {high}", self.unit, str(self.n)]


HEADER = ("error", "parameter", "estimate", "95 % interval", "unit", "runs")
"""Above the cells of a Parameter."""


def parameters(fit: MotionFit) -> Iterator[Parameter]:
    """a, b, the bias and sigma after the runs' length, of each part that was fitted."""
    for part, found in fit.parts.items():
        of_a, of_b, of_sigma, of_length = UNITS[part]
        yield Parameter(part, "a", found.growth.a, *found.a_bounds, of_a, found.n)
        yield Parameter(part, "b", found.growth.b, *found.b_bounds, of_b, found.n)
        yield Parameter(part, "bias", found.bias, *found.bias_bounds, of_b, found.n)
        after = f"sigma after {found.reached:.3g} {of_length}"
        yield Parameter(part, after, found.sigma, *found.sigma_bounds, of_sigma, found.n)
