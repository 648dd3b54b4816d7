"""What each parameter of a config is, said once beside its field: for TOML files, and for what is refused."""

import math
from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass, fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from .errors import InvalidInputError, unknown_name

NUMBER_WITHOUT = "1"
"""The unit of a number that has none."""


@dataclass(frozen=True)
class Doc:
    """Of a field: `cell_m: Annotated[float, Doc("Edge of a cell.", "m", above=0)] = 0.05`.

    text: a sentence or two. unit: of a number, "1" where it has none. least and above, most and below: what it may be,
    with the limit itself or without. choices: what a text may be. What is said holds for each item of a list.
    """

    text: str
    unit: str = ""
    _: KW_ONLY
    least: float | None = None
    above: float | None = None
    most: float | None = None
    below: float | None = None
    choices: tuple[str, ...] = ()

    @property
    def limits(self) -> str:
        """`positive`, `>= 0`, `> 0 and < 1`: what a number may be, "" for anything."""
        low = "positive" if self.above == 0 and self.below is None and self.most is None else _limit(">", self.above)
        parts = (low, _limit(">=", self.least), _limit("<", self.below), _limit("<=", self.most))
        return " and ".join(part for part in parts if part)

    def check(self, value: object, name: str) -> None:
        """Raise InvalidInputError, naming `name`, for a number out of its limits or a text that is not to be chosen."""
        if isinstance(value, list | tuple):
            for n, item in enumerate(value):
                self.check(item, f"{name}[{n}]")
        elif isinstance(value, int | float) and not isinstance(value, bool) and not self._holds(value):
            finite = " and finite" if isinstance(value, float) else ""
            raise InvalidInputError(f"{name} must be {self.limits}{finite}, not {value}")
        elif isinstance(value, str) and self.choices and value not in self.choices:
            raise unknown_name(name, value, self.choices)

    def _holds(self, value: float) -> bool:
        if not self.limits:
            return True
        low = value > self.above if self.above is not None else self.least is None or value >= self.least
        high = value < self.below if self.below is not None else self.most is None or value <= self.most
        return math.isfinite(value) and low and high


def _limit(sign: str, limit: float | None) -> str:
    return "" if limit is None else f"{sign} {limit:g}"


def docs_of(kind: type) -> dict[str, Doc]:
    """The Doc of each field of a dataclass that has one; a subclass that gives another default keeps the words."""
    found: dict[str, Doc] = {}
    for each in reversed(kind.__mro__):
        if is_dataclass(each):
            for name, hint in get_type_hints(each, include_extras=True).items():
                words = _docs_in(hint)
                if words:
                    found[name] = words[0]
    return found


def _docs_in(hint: Any) -> list[Doc]:
    return [each for each in get_args(hint)[1:] if isinstance(each, Doc)] if get_origin(hint) is Annotated else []


def check_fields(config: object, but: Iterable[str] = ()) -> None:
    """Raise InvalidInputError for the first field of a dataclass that is not what its Doc says; for __post_init__.

    but: fields that are looked at elsewhere.
    """
    docs = docs_of(type(config))
    for field in fields(config):  # type: ignore[arg-type]
        if field.name in docs and field.name not in but:
            docs[field.name].check(getattr(config, field.name), field.name)
