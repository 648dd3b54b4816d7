"""YAML files of strangers: plain values alone, and none that grow without bounds when they are read."""

from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

from .errors import InvalidInputError, RecordingError

MAX_DEPTH = 10
_SHOWN = 200
"""Letters of an error that are shown."""


def read_yaml(path: Path, *, most_bytes: int) -> dict[str, Any]:
    """The keys of a YAML file of plain values. Raises RecordingError, naming the file, for one that is larger, has
    aliases, tags or deep nesting, or no keys."""
    try:
        keys = YAML(typ="safe").load(plain_text(path, most_bytes=most_bytes))
    except (YAMLError, ValueError, TypeError, LookupError) as error:
        # ruamel's constructors raise whatever they stumble on: tags, dates that are none, keys that cannot be any.
        raise RecordingError(f"{path}: no YAML of plain values: {' '.join(str(error).split())[:_SHOWN]}") from None
    if not isinstance(keys, dict):
        raise RecordingError(f"{path}: no keys and values, but {type(keys).__name__}")
    return keys


def plain_text(path: Path, *, most_bytes: int) -> str:
    """The text of a YAML file that may be read, whatever tags it has, without its line %YAML:1.0.

    Raises RecordingError, naming the file, for one that is larger, no YAML, or has aliases or deep nesting.
    """
    try:
        n_bytes = path.stat().st_size
        if n_bytes > most_bytes:
            raise RecordingError(f"{path}: {n_bytes:,} bytes; no {path.name} has more than {most_bytes:,}")
        encoded = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        # OpenCV's files, and EuRoC's, begin with %YAML:1.0, which YAML itself does not know.
        lines = encoded.decode("utf-8-sig").splitlines()
        text = "\n".join("" if line.startswith("%YAML") else line for line in lines)
        _check_plain(text)
    except InvalidInputError as error:
        raise RecordingError(f"{path}: {error}") from None
    except (YAMLError, ValueError) as error:
        raise RecordingError(f"{path}: no YAML of plain values: {' '.join(str(error).split())[:_SHOWN]}") from None
    return text


def _check_plain(text: str) -> None:
    """Refuse what grows without bounds when it is read: a few aliases of aliases, or very deep nesting."""
    depth = 0
    for event in YAML(typ="safe").parse(text):
        if isinstance(event, AliasEvent):
            raise InvalidInputError("has aliases (*name), which no such file needs")
        depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise InvalidInputError("is nested deeper than any such file needs")
