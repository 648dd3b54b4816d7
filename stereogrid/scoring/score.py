"""One number with its unit, and the plain form in which numbers are kept in metrics.json."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import InvalidInputError

DIMENSIONLESS = "1"
"""The unit of shares, areas under curves and other pure numbers, as in the SI."""


@dataclass(frozen=True)
class Score:
    """A number that never travels without its unit; NaN means undefined (an empty class, an empty map).

    unit: "m", "bit", "nat", or "1" for a pure number. n: how many cells, points or hits it was taken over.
    low, high: its 95 % interval, where it has one (else None both); who gives it says of what.
    """

    name: str
    value: float
    unit: str
    n: int
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        if not self.name or not self.unit:
            raise InvalidInputError(f"a score needs a name and a unit, not {self.name!r} and {self.unit!r}")
        if self.n < 0:
            raise InvalidInputError(f"score {self.name}: n must be >= 0, not {self.n}")
        if (self.low is None) != (self.high is None):
            raise InvalidInputError(f"score {self.name}: an interval has two ends, not {self.low} and {self.high}")
        if self.low is not None and self.high is not None and not self.low <= self.high:
            raise InvalidInputError(f"score {self.name}: an interval goes up, not from {self.low} to {self.high}")
        object.__setattr__(self, "value", float(self.value))
        object.__setattr__(self, "n", int(self.n))

    @property
    def text(self) -> str:
        """The value for a table, without its unit: three decimals, whole counts in full, - for NaN."""
        return _text(self.value)

    @property
    def interval_text(self) -> str:
        """Its interval for a table, without the unit; nothing where there is none."""
        return "" if self.low is None or self.high is None else f"{_text(self.low)} to {_text(self.high)}"


def _text(value: float) -> str:
    if math.isnan(value):
        return "-"
    if abs(value) >= 1000 and value == round(value):
        return f"{value:,.0f}"
    return f"{value:.3f}" if abs(value) >= 0.001 or value == 0 else f"{value:.1e}"


def scores_to_dict(scores: Iterable[Score]) -> dict[str, dict[str, Any]]:
    """{name: {value, unit, n}}, with low and high where there is an interval, ready for json.dump: a value that is not
    finite becomes None (null).

    Raises InvalidInputError when two scores bear one name.
    """
    plain: dict[str, dict[str, Any]] = {}
    for score in scores:
        if score.name in plain:
            raise InvalidInputError(f"two scores are named {score.name!r}")
        value = score.value if math.isfinite(score.value) else None
        plain[score.name] = {"value": value, "unit": score.unit, "n": score.n}
        if score.low is not None:
            plain[score.name] |= {"low": score.low, "high": score.high}
    return plain


def scores_from_dict(plain: Mapping[str, Mapping[str, Any]]) -> list[Score]:
    """The scores that `scores_to_dict` wrote, in the same order; null becomes NaN.

    Raises InvalidInputError naming the score that lacks a value, a unit or n.
    """
    scores = []
    for name, row in plain.items():
        missing = {"value", "unit", "n"} - set(row)
        if missing:
            raise InvalidInputError(f"score {name!r} lacks {', '.join(sorted(missing))}")
        value = math.nan if row["value"] is None else row["value"]
        scores.append(Score(name, value, row["unit"], row["n"], row.get("low"), row.get("high")))
    return scores
