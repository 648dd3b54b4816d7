"""Frozen dataclasses from TOML files and back: what is unknown or of the wrong kind is refused by name."""

import difflib
import sys
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, asdict, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from .described import Doc, docs_of
from .documented import documented_toml
from .errors import ConfigError, StereogridError
from .files import written_beside

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

T = TypeVar("T")
CONFIG_TOML = "config.toml"
"""In a run folder: every parameter of the run."""


def config_from_table(kind: type[T], table: Mapping[str, Any], where: str = "") -> T:
    """A config dataclass from a nested table; unknown keys, wrong types and values out of range are refused by name.

    A field may be a number, a text, a section, a list of any of them (`tuple[kind, ...]`) or a table
    (`dict[str, kind]`); `kind | None` may be left out. where: the section that the table is, with a dot at its end.
    """
    types, docs = get_type_hints(kind), docs_of(kind)
    names = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ";"
            raise ConfigError(f"unknown key {where + key!r}{hint} choose from: {', '.join(names)}")
        values[key] = _checked(types[key], value, where + key)
        if key in docs:
            _check(docs[key], values[key], where + key)
    missing = [f.name for f in fields(kind) if _is_needed(f) and f.name not in values]  # type: ignore[arg-type]
    if missing:
        raise ConfigError(f"missing key {where + missing[0]!r}")
    try:
        return kind(**values)
    except StereogridError as error:
        section = where.rstrip(".")
        raise ConfigError(f"[{section}] {error}" if section else str(error)) from None


def _check(doc: Doc, value: object, name: str) -> None:
    try:
        doc.check(value, name)
    except StereogridError as error:
        raise ConfigError(str(error)) from None


def _is_needed(field: "Field[Any]") -> bool:
    return field.default is MISSING and field.default_factory is MISSING


def _checked(expected: Any, value: Any, where: str) -> Any:
    if get_origin(expected) is UnionType:
        (expected,) = (kind for kind in get_args(expected) if kind is not NoneType)
    if is_dataclass(expected):
        if not isinstance(value, Mapping):
            raise ConfigError(f"{where!r} must be a section, not {value!r}")
        return config_from_table(expected, value, f"{where}.")  # type: ignore[arg-type]
    if get_origin(expected) is tuple:
        if not isinstance(value, list | tuple):
            raise ConfigError(f"{where!r} must be a list, not {value!r}")
        return tuple(_checked(get_args(expected)[0], item, f"{where}[{n}]") for n, item in enumerate(value))
    if get_origin(expected) is dict:
        if not isinstance(value, Mapping):
            raise ConfigError(f"{where!r} must be a section, not {value!r}")
        return {key: _checked(get_args(expected)[1], item, f"{where}.{key}") for key, item in value.items()}
    if expected is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not expected:
        raise ConfigError(f"{where!r} must be {expected.__name__}, not {value!r}")
    return value


def load_config(kind: type[T], path: str | Path) -> T:
    """A config dataclass from a TOML file. Raises ConfigError naming the file and the culprit."""
    table = read_table(path)
    try:
        return config_from_table(kind, table)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def read_table(path: str | Path) -> dict[str, Any]:
    """What a TOML file says, unchecked. Raises ConfigError naming the file."""
    path = Path(path)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is no text in UTF-8, as TOML must be") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: {error}") from None
    except RecursionError:
        raise ConfigError(f"{path}: its lists or tables are nested too deeply") from None


def save_config(config: Any, path: str | Path, *, heading: str = "") -> None:
    """Write a config dataclass as TOML that load_config reads back to an equal one; what is None is left out.

    What each key is stands above it; heading: the first line.
    """
    with written_beside(Path(path)) as temporary:
        temporary.write_text(documented_toml(config, heading=heading), encoding="utf-8")


def with_settings(config: T, settings: Iterable[str]) -> T:
    """The config with settings such as `grid.cell_m=0.1` or `matcher.name=sgbm`; a text needs no quotes.

    Raises ConfigError, naming the key, for one that there is not, or a value that cannot be.
    """
    table: dict[str, Any] = asdict(config)  # type: ignore[call-overload]
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not (equals and key.strip()):
            raise ConfigError(f"{setting!r}: expected section.key=value, as in grid.cell_m=0.1")
        change: Any = _value(text.strip())
        for name in reversed(key.strip().split(".")):
            change = {name: change}
        table = merged(table, change)
    return config_from_table(type(config), _without_none(table))


def _value(text: str) -> Any:
    """What a text is as a TOML value, and else the number (.5) or the text that it is."""
    try:
        table = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        table = {}
    if table.keys() == {"value"}:
        return table["value"]
    try:
        return float(text)
    except ValueError:
        return text


def merged(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A nested table with changes to it."""
    both = {**table}
    for key, value in changes.items():
        before = both.get(key)
        both[key] = merged(before, value) if isinstance(before, Mapping) and isinstance(value, Mapping) else value
    return both


def _without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in table.items()
        if value is not None
    }
