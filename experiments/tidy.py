"""Results as CSV files: a line an observation, a column a variable, nothing where a number is undefined."""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from stereogrid.files import written_beside
from stereogrid.scoring import Score


def write_table(path: Path, header: Sequence[str], rows: Iterable[Iterable[object]], *, digits: int = 17) -> None:
    """A CSV file of rows under their header; floats with that many digits, NaN as nothing."""
    with written_beside(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([_text(value, digits) for value in row] for row in rows)


def write_rows(path: Path, rows: Sequence[Mapping[str, object]], *, digits: int = 17) -> None:
    """The same of rows that name their values; one that a row lacks is nothing."""
    header = list(dict.fromkeys(name for row in rows for name in row))
    write_table(path, header, ([row.get(name, "") for name in header] for row in rows), digits=digits)


def write_scores(
    path: Path, keys: Sequence[str], scores: Mapping[tuple[object, ...], Iterable[Score]], *, digits: int = 17
) -> None:
    """A line a score: the keys' values, then score, value, unit, n."""
    lines = ([*key, each.name, each.value, each.unit, each.n] for key, row in scores.items() for each in row)
    write_table(path, [*keys, "score", "value", "unit", "n"], lines, digits=digits)


def _text(value: object, digits: int) -> object:
    if not isinstance(value, float):
        return value
    if math.isnan(value):
        return ""
    # The shortest text that reads back the same, where it is short enough.
    return repr(float(value)) if digits >= 17 else f"{value:.{digits}g}"
