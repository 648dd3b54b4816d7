"""A config dataclass as TOML with what each key is above it: words, unit, limits, choices, default."""

import inspect
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from .described import NUMBER_WITHOUT, Doc, docs_of
from .errors import StereogridError

WIDTH = 110
NO_BREAK = "\xa0"


def documented_toml(config: Any, *, heading: str = "") -> str:
    """The text of a TOML file that reads back as this config. What is None is left out, but for its words.

    heading: what the file is; by default the first line of what the class says of itself.
    """
    first = heading or (inspect.getdoc(type(config)) or "").partition("\n")[0]
    lines = [*_comment(first), "", *_section(config, _default(type(config)), (), set())]
    # Only between lines: tomli_w writes line breaks within texts as \\n.
    return "\n".join(lines).replace("\n\n\n", "\n\n") + "\n"


def _default(kind: type) -> Any:
    """What a file without a line would be; None where that is not possible."""
    try:
        return kind()
    except (TypeError, StereogridError):
        return None


def _section(config: Any, default: Any, path: tuple[str, ...], told: set[type]) -> Iterator[str]:
    """The lines of a section: first its own keys, then the sections within it.

    told: kinds of sections whose keys were explained before, and are not again.
    """
    docs, within = docs_of(type(config)), []
    known = type(config) in told
    told.add(type(config))
    for field in fields(config):
        value, doc = getattr(config, field.name), docs.get(field.name, Doc(""))
        if _has_sections(value):
            within.append(field.name)
            continue
        yield from _explained(Doc("") if known else doc, value, getattr(default, field.name, value))
        if value is None:
            yield f"# ({field.name} is not set)"
        else:
            line = f"{field.name} = {_text(value)}"
            yield from [line] if len(line) <= WIDTH else _toml({field.name: value})
    for name in within:
        words = "" if known or name not in docs else docs[name].text
        yield ""
        yield from _comment(words)
        yield from _sections(getattr(config, name), getattr(default, name, None), (*path, name), told)


def _has_sections(value: object) -> bool:
    if isinstance(value, tuple):
        return any(is_dataclass(item) or isinstance(item, Mapping) for item in value)
    return is_dataclass(value) or isinstance(value, Mapping)


def _sections(value: Any, default: Any, path: tuple[str, ...], told: set[type]) -> Iterator[str]:
    """The section of a dataclass or a table, or one section an item of a list."""
    if isinstance(value, Mapping):
        table: Any = _plain(value)
        for name in reversed(path):
            table = {name: table}
        yield from _toml(table)
    elif isinstance(value, tuple):
        for n, item in enumerate(value):
            yield from [""] if n else []
            yield f"[[{'.'.join(path)}]]"
            yield from _toml(_plain(item)) if isinstance(item, Mapping) else _section(item, None, path, told)
    else:
        yield f"[{'.'.join(path)}]"
        yield from _section(value, default, path, told)


def _explained(doc: Doc, value: object, default: object) -> Iterator[str]:
    """Above a key: what it is, and in brackets its unit, what it may be, and the default where this is another."""
    unit = "" if doc.unit == NUMBER_WITHOUT else doc.unit
    usual = f"default {_text(default)}" if default is not None and default != value else ""
    notes = "; ".join(note for note in (unit, doc.limits, ", ".join(doc.choices), usual) if note)
    # What stands in brackets stays on one line where it can.
    held = f"[{notes}]" if len(notes) > WIDTH // 2 else f"[{notes}]".replace(" ", NO_BREAK)
    yield from _comment(f"{doc.text} {held}".strip() if notes else doc.text)


def _text(value: object) -> str:
    """A value as TOML has it, on one line."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_text, value))}]"
    return "\n".join(_toml({"x": value})).removeprefix("x = ")


def _comment(text: str) -> list[str]:
    lines = textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)
    return [f"# {line}".replace(NO_BREAK, " ") for line in lines]


def _toml(table: Mapping[str, Any]) -> list[str]:
    import tomli_w

    # Not splitlines: within texts U+2028 and the like are no ends of lines.
    return tomli_w.dumps(table).strip("\n").split("\n")


def _plain(table: Mapping[str, Any]) -> dict[str, Any]:
    """Without what is None."""
    return {
        key: _plain(value) if isinstance(value, Mapping) else value for key, value in table.items() if value is not None
    }
