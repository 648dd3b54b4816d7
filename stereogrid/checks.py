"""What one check found, and what to do about it."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from .errors import InvalidInputError

OK, WARNING, PROBLEM, NOT_THERE = "ok", "warning", "problem", "not there"
STATES = (OK, WARNING, PROBLEM, NOT_THERE)


@dataclass(frozen=True)
class Check:
    """name: what was looked at; state: one of STATES; found: in one line; remedy: what puts it right, in one line.

    A warning and a problem have one; of what is not there it says how to get it, if that is wanted. values: the numbers
    behind it, for machines.
    """

    name: str
    state: str
    found: str
    remedy: str = ""
    values: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.state not in STATES:
            raise InvalidInputError(f"a check is one of {', '.join(STATES)}, not {self.state!r}")
        if self.state in (WARNING, PROBLEM) and not self.remedy:
            raise InvalidInputError(f"{self.name}: a {self.state} needs a remedy")
        for line in (self.name, self.found, self.remedy):
            if "\n" in line:
                raise InvalidInputError(f"{self.name}: {line!r} is more than one line")


def split_trouble(message: str, otherwise: str) -> tuple[str, str]:
    """What is wrong, and what to do: errors here say the one and, behind the last colon, mostly the other."""
    what, colon, remedy = " ".join(message.split()).rpartition(": ")
    return (what, remedy) if colon else (remedy, otherwise)


def healthy(checks: Iterable[Check]) -> bool:
    """Whether none of them found a problem."""
    return all(check.state != PROBLEM for check in checks)


def as_table(checks: Iterable[Check]) -> dict[str, Any]:
    """All of them as JSON values: {"healthy": bool, "checks": [{name, state, found, remedy, values}, ...]}."""
    listed = list(checks)
    return {"healthy": healthy(listed), "checks": [asdict(check) for check in listed]}
