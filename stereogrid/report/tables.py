"""Tables of a report, in HTML and Markdown."""

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from ..described import NUMBER_WITHOUT, docs_of
from ..errors import InvalidInputError
from ..scoring import Score
from ..scoring.meanings import MEANINGS
from ..scoring.score import DIMENSIONLESS

SEEDS = ("seed", "world_seed", "noise_seed")
"""Names that configs have for the seed of a whole run."""


@dataclass(frozen=True)
class ReportTable:
    """Rows of text under a header; the first n_names columns name the row, the others hold numbers.

    caption: what is shown, in few words; note: how to read it.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    n_names: int = 1
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise InvalidInputError(f"a row of {len(row)} cells under a header of {len(self.header)}: {row[0]}")

    @property
    def html(self) -> str:
        """The table as HTML."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self.header)
        kinds = ["<td>" if n < self.n_names else '<td class="number">' for n in range(len(self.header))]
        rows = (
            "".join(f"{kind}{html.escape(cell)}</td>" for kind, cell in zip(kinds, row, strict=True))
            for row in self.rows
        )
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        caption = f"<caption>{html.escape(self.caption)}</caption>" if self.caption else ""
        note = f"<p>{html.escape(self.note)}</p>" if self.note else ""
        return wide(f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>") + note

    @property
    def markdown(self) -> str:
        """The table as Markdown, under its caption and note."""
        lines = [self.header, ["---"] * len(self.header), *self.rows]
        table = "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)
        return f"{self.caption}. {self.note}".strip() + f"\n\n{table}"


def wide(table: str) -> str:
    """A table that scrolls by itself where the page is too narrow for it."""
    return f'<div class="wide">{table}</div>'


def score_table(arms: Mapping[str, Sequence[Score]], meanings: Mapping[str, str] | None = None) -> str:
    """The scores as an HTML table: a row a score, a column an arm, unit, interval and meaning beside them.

    meanings: of scores that scoring.meanings.MEANINGS does not hold.
    """
    known = {**MEANINGS, **(meanings or {})}
    names = list(dict.fromkeys(score.name for scores in arms.values() for score in scores))
    by_arm = {arm: {score.name: score for score in scores} for arm, scores in arms.items()}
    head = "".join(f"<th>{html.escape(arm)}</th>" for arm in arms)
    rows = []
    for name in names:
        cells = "".join(f'<td class="number">{format_score(row.get(name))}</td>' for row in by_arm.values())
        meaning = html.escape(known.get(name, ""))
        rows.append(f'<tr><td>{html.escape(name)}</td>{cells}<td class="meaning">{meaning}</td></tr>')
    one = ' class="one"' if len(arms) == 1 else ""
    return wide(
        f"<table{one}><thead><tr><th>score</th>{head}<th>meaning</th></tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


def format_score(score: Score | None) -> str:
    """The value with its unit, its interval below; a dash where there is no number."""
    if score is None:
        return "-"
    text = html.escape(score.text + ("" if score.unit == DIMENSIONLESS else f" {score.unit}"))
    return text + (f"<small>{html.escape(score.interval_text)}</small>" if score.interval_text else "")


def config_table(table: Mapping[str, Any], config: object = None) -> ReportTable:
    """Every parameter of a config.toml; with its unit where the config, a documented dataclass, is given."""
    if config is None:
        return ReportTable("", ("parameter", "value"), _flat(table), n_names=2)
    units = units_of(config)
    rows = [(name, text, units.get(name, "")) for name, text in _flat(table)]
    return ReportTable("", ("parameter", "value", "unit"), rows, n_names=3)


def units_of(config: Any, where: str = "") -> dict[str, str]:
    """The units of a config's numbers by their names, as config_table has them; "" of pure numbers and texts."""
    docs = docs_of(type(config))
    units: dict[str, str] = {}
    for field in fields(config):
        value, name = getattr(config, field.name), where + field.name
        if is_dataclass(value):
            units |= units_of(value, f"{name}.")
        elif isinstance(value, tuple) and value and all(map(is_dataclass, value)):
            for n, each in enumerate(value, 1):
                units |= units_of(each, f"{name}[{n}].")
        else:
            unit = docs[field.name].unit if field.name in docs else ""
            units[name] = "" if unit == NUMBER_WITHOUT else unit
    return units


def seeds(config: Mapping[str, Any]) -> str:
    """The seeds that a config names, for a person."""
    found = [f"{name.rsplit('.', 1)[-1]} {text}" for name, text in _flat(config) if name.rsplit(".", 1)[-1] in SEEDS]
    return ", ".join(found)


def _flat(config: Mapping[str, Any], where: str = "") -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for key, value in config.items():
        if isinstance(value, Mapping):
            rows += _flat(value, f"{where}{key}.")
        elif isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
            for n, each in enumerate(value, 1):
                rows += _flat(each, f"{where}{key}[{n}].")
        else:
            rows.append((where + key, _shown(value)))
    return rows


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(_shown, value)) or "none"
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return str(value) or "-"
