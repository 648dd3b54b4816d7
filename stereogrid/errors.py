"""One root for everything that a user can put right; cli.py turns it into one line and exit code 1."""

import difflib
from collections.abc import Iterable


class StereogridError(Exception):
    """Something that the caller can put right; the message names the culprit and the choices."""


class InvalidInputError(StereogridError, ValueError):
    """A value, an array or a file does not say what it must say."""


class RecordingError(StereogridError):
    """A recording is missing, of no known kind, incomplete or damaged."""


class ConfigError(StereogridError):
    """A configuration has an unknown key or a value of the wrong kind."""


class MapTooLargeError(StereogridError, MemoryError):
    """The map would need more memory than it may have."""


class MissingExtraError(StereogridError, ImportError):
    """An optional dependency is not installed."""


def unknown_name(kind: str, name: str, choices: Iterable[str]) -> InvalidInputError:
    """The error for a name that is in no table: `no matcher named 'sgmb'; did you mean 'sgbm'? choose from: ...`."""
    names = sorted(choices)
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ";"
    return InvalidInputError(f"no {kind} named {name!r}{hint} choose from: {', '.join(names)}")
