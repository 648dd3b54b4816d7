"""Tables for a screen of any width: narrowed step by step, as little as is needed, with every number whole."""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    # Not for the program: with it comes Numba, and an interrupt meanwhile would find nobody to handle it.
    from stereogrid.report import ReportTable

PADDING = 2
"""Blanks that a column has besides its text."""


def narrowed(table: "ReportTable", width: int) -> "tuple[str, list[ReportTable]]":
    """What all rows have in common, where that had to go from the table, and the parts of it that fit, top to bottom.

    First go the names that all rows share, then headings are folded, then columns are parted into tables of their own,
    each with the names of its rows. At last names and numbers are folded at their blanks.
    """
    if _fits(table, width):
        return "", [table]
    common, table = _without_common_names(table)
    if not _fits(table, width):
        table = _folded(table)
    return common, [_squeezed(part, width) for part in _parted(table, width)]


def _widths(table: "ReportTable") -> list[int]:
    lines = (table.header, *table.rows)
    return [max(len(line) for row in lines for line in row[n].split("\n")) for n in range(len(table.header))]


def _fits(table: "ReportTable", width: int) -> bool:
    return sum(_widths(table)) + PADDING * len(table.header) <= width


def _without_common_names(table: "ReportTable") -> "tuple[str, ReportTable]":
    """The names that are the same in all rows, in words, and the table without them; one name stays."""
    names = range(table.n_names)
    common = [n for n in names if len({row[n] for row in table.rows}) == 1][: table.n_names - 1]
    kept = [n for n in range(len(table.header)) if n not in common]
    words = ", ".join(f"{table.header[n]}: {table.rows[0][n]}" for n in common)
    return words, replace(_of_columns(table, kept), n_names=table.n_names - len(common))


def _of_columns(table: "ReportTable", columns: list[int]) -> "ReportTable":
    pick = [[row[n] for n in columns] for row in (table.header, *table.rows)]
    return replace(table, header=pick[0], rows=pick[1:])


def _folded(table: "ReportTable") -> "ReportTable":
    """Headings on several lines, each as wide as the cells below it or the longest of its words."""
    cells = [max((len(row[n]) for row in table.rows), default=0) for n in range(len(table.header))]
    return replace(table, header=[_fold(text, cell) for text, cell in zip(table.header, cells, strict=True)])


def _fold(text: str, width: int) -> str:
    """At blanks and behind underscores."""
    words = re.findall(r"[^ _]*_+|[^ _]+ *", text) or [text]
    width = max(width, *(len(word.rstrip()) for word in words))
    lines = [""]
    for word in words:
        if lines[-1] and len((lines[-1] + word).rstrip()) > width:
            lines.append("")
        lines[-1] += word
    return "\n".join(line.rstrip() for line in lines)


def _parted(table: "ReportTable", width: int) -> "Iterator[ReportTable]":
    """As many columns of numbers in each part as fit, and at least one."""
    widths, names = _widths(table), list(range(table.n_names))
    left = width - sum(widths[n] + PADDING for n in names)
    part: list[int] = []
    for n in range(table.n_names, len(widths)):
        if part and sum(widths[k] + PADDING for k in (*part, n)) > left:
            yield _of_columns(table, names + part)
            part = []
        part.append(n)
    yield _of_columns(table, names + part)


def _squeezed(table: "ReportTable", width: int) -> "ReportTable":
    """Cells folded at blanks, the widest column first, where the screen has no room for even one column of numbers."""
    rows, folded = [list(row) for row in table.rows], set[int]()
    while not _fits(table, width):
        widths = _widths(table)
        left = [n for n in range(len(widths)) if n not in folded]
        if not left:
            break
        widest = max(left, key=lambda n: widths[n])
        wanted = max(8, widths[widest] - (sum(widths) + PADDING * len(widths) - width))
        folded.add(widest)
        for row in rows:
            row[widest] = _fold(row[widest], wanted)
        table = replace(table, rows=rows)
    return table
