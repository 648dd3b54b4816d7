"""What varies in a sweep: parameters by their dotted names, and the lists of values that they take."""

import json
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

from stereogrid.errors import ConfigError, InvalidInputError

RANGE = {"from", "to"}
MOST_VALUES = 1_000_000
LARGEST = 2**63 - 1
SET_OTHERWISE = {
    "world": "it is set by worlds = [...]",
    "noise_seed": "it is set by seeds = [...]",
    "seed": "with new_worlds = true it is set by seeds = [...], and else by base.seed",
}


@dataclass(frozen=True)
class Axis:
    """Parameters that vary together, and the values (V, P) that they take; mostly one parameter."""

    names: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]

    @property
    def label(self) -> str:
        """Its parameters, for a person."""
        return ", ".join(name.removeprefix("mapping.") for name in self.names)

    def text(self, choice: int) -> str:
        """One of its values, for a person."""
        return ", ".join(plain_text(value) for value in self.values[choice])


def with_ranges(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The table, with lists in place of {from = 1, to = 3}."""
    return {name: _with_ranges(value, where + name) for name, value in table.items()}


def _with_ranges(value: Any, where: str) -> Any:
    if isinstance(value, list):
        return [_with_ranges(each, f"{where}[{n}]") for n, each in enumerate(value)]
    if not isinstance(value, Mapping):
        return value
    if not RANGE & {*value}:
        return with_ranges(value, f"{where}.")
    ends = [value.get("from"), value.get("to"), value.get("step", 1)]
    if {*value} - RANGE - {"step"} or any(type(end) is not int for end in ends) or ends[2] < 1:
        raise ConfigError(f"{where!r} must be like {{from = 1, to = 20}}, whole numbers, with a step if need be")
    values = range(ends[0], ends[1] + 1, ends[2])
    if (ends[1] - ends[0]) // ends[2] >= MOST_VALUES:
        raise ConfigError(f"{where!r} would have more than {MOST_VALUES:,} values; raise its step")
    return list(values)


def flat(table: Mapping[str, Any], where: str = "") -> dict[str, Any]:
    """Dotted name -> value of a nested table: TOML reads a.b = [1] as a table in a table."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        # An empty table is no parameter's list, and refused as such.
        is_table = isinstance(value, Mapping) and value
        found |= flat(value, f"{where}{key}.") if is_table else {where + key: value}
    return found


def nested(name: str, value: Any) -> dict[str, Any]:
    """The nested table that a dotted name and its value are."""
    for key in reversed(name.split(".")):
        value = {key: value}
    return value


def value_at(config: Any, name: str) -> Any:
    """A config's value at a dotted name; None where there is no such name."""
    return reduce(lambda found, key: getattr(found, key, None), name.split("."), config)


def is_same(value: Any, of_config: Any) -> bool:
    """Whether a value of a TOML file is what a config has; of a section, what it sets."""
    if isinstance(value, Mapping):
        return all(is_same(each, getattr(of_config, key, None)) for key, each in value.items())
    return bool((tuple(value) if isinstance(value, list) else value) == of_config)


def plain_text(value: Any) -> str:
    """A value of a parameter for a person: lists and sections as JSON."""
    return value if isinstance(value, str) else json.dumps(value, default=str)


def axis_of(group: Mapping[str, Any]) -> Axis:
    """An axis from parameters and their lists of values, which must be as long as each other."""
    for name, values in group.items():
        check_list(name, values, distinct=len(group) == 1)
    lengths = {name: len(values) for name, values in group.items()}
    if not lengths or len(set(lengths.values())) > 1:
        text = ", ".join(f"{name}: {n}" for name, n in lengths.items()) or "nothing"
        raise InvalidInputError(f"together: parameters that vary together need equally many values, not {text}")
    rows = tuple(zip(*group.values(), strict=True))
    if len(group) > 1:
        check_list(f"together of {', '.join(group)}", rows)
    return Axis(tuple(group), rows)


def check_list(name: str, values: Any, *, distinct: bool = True) -> None:
    """Raise InvalidInputError unless it is a list of one or more, distinct ones if need be."""
    if not isinstance(values, list | tuple):
        raise InvalidInputError(f"{name} must be a list of values, or {{from = 1, to = 20}}, not {plain_text(values)}")
    if not values:
        raise InvalidInputError(f"{name} is an empty list: nothing would be run")
    seen = set()
    for value in values:
        if isinstance(value, int) and not -LARGEST <= value <= LARGEST:
            raise InvalidInputError(f"{name} lists {value}, beyond what a table holds: {LARGEST}")
        known = _hashable(value)
        if distinct and known in seen:
            raise InvalidInputError(f"{name} lists {plain_text(value)} twice")
        seen.add(known)


def _hashable(value: Any) -> Hashable:
    """The same for values that are the same: lists and tables are no members of a set."""
    if isinstance(value, Mapping):
        return "table", frozenset((key, _hashable(each)) for key, each in value.items())
    return ("list", *map(_hashable, value)) if isinstance(value, list | tuple) else value


def check_names(names: Sequence[str]) -> None:
    """Raise InvalidInputError for parameters that are set elsewhere or twice."""
    for name in names:
        if name in SET_OTHERWISE:
            raise InvalidInputError(f"{name!r} cannot be varied: {SET_OTHERWISE[name]}")
        twice = [other for other in names if other.startswith(f"{name}.")]
        if names.count(name) > 1 or twice:
            raise InvalidInputError(f"{(twice or [name])[0]!r} is varied twice")
