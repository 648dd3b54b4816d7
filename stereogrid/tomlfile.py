"""Frozen dataclasses from TOML files and back: what is unknown or of the wrong kind is refused by name."""

import difflib
import sys
from collections.abc import Mapping
from dataclasses import MISSING, Field, asdict, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from .errors import ConfigError, StereogridError
from .files import written_beside

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

T = TypeVar("T")


def config_from_table(kind: type[T], table: Mapping[str, Any], where: str = "") -> T:
    """A config dataclass from a nested table; unknown keys and values of the wrong type are refused by name.

    A field may be a number, a text, a section, or a list of any of them (`tuple[kind, ...]`); `kind | None` may be left
    out.
    """
    types = get_type_hints(kind)
    names = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ";"
            raise ConfigError(f"unknown key {where + key!r}{hint} choose from: {', '.join(names)}")
        values[key] = _checked(types[key], value, where + key)
    missing = [f.name for f in fields(kind) if _is_needed(f) and f.name not in values]  # type: ignore[arg-type]
    if missing:
        raise ConfigError(f"missing key {where + missing[0]!r}")
    try:
        return kind(**values)
    except StereogridError as error:
        raise ConfigError(f"[{where.rstrip('.') or 'config'}] {error}") from None


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


def save_config(config: Any, path: str | Path) -> None:
    """Write a config dataclass as TOML that load_config reads back to an equal one."""
    import tomli_w

    with written_beside(Path(path)) as temporary:
        temporary.write_text(tomli_w.dumps(asdict(config)), encoding="utf-8")
