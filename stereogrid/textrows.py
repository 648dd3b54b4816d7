"""Rows of numbers in text files of strangers; what is wrong is named with its file and line."""

import re
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import RecordingError
from .geometry import FloatArray

Stamps = NDArray[np.int64]
Row = tuple[str, list[str]]
"""`file:line` and its words."""

_SHOWN = 40
_NS_PER_S = Decimal(10**9)
MAX_NS = 2**62
"""In 2116; the difference of two stamps is still an int64."""


def text_lines(path: Path) -> list[tuple[int, str]]:
    """The lines that say something, each with its number from 1; those that start with # are comments.

    Raises RecordingError when path is no file of text.
    """
    if not path.is_file():
        raise RecordingError(f"{path}: no such file")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text: {error}") from error
    lines = enumerate(text.splitlines(), 1)
    return [(number, line) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]


def rows_of_words(path: Path, *, commas: bool = False) -> list[Row]:
    """The words of each row of a table; commas: they stand between the words, else white space does."""
    splitter = re.compile(r"\s*,\s*" if commas else r"\s+")
    return [(f"{path}:{number}", splitter.split(line.strip())) for number, line in text_lines(path)]


def floats(words: Sequence[str], where: str) -> list[float]:
    """Words as numbers. Raises RecordingError, naming where, for one that is none."""
    try:
        return [float(word) for word in words]
    except ValueError as error:
        raise RecordingError(f"{where}: {str(error)[: 3 * _SHOWN]}") from None


def table(rows: Sequence[Row]) -> FloatArray:
    """Rows of as many words each as an array (M, N), all finite. Raises RecordingError, naming the line."""
    values = np.array([floats(words, where) for where, words in rows], dtype=np.float64)
    wrong = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(wrong):
        raise RecordingError(f"{rows[wrong[0]][0]}: contains NaN or infinity")
    return values


def stamp_ns(word: str, where: str, *, unit_ns: Decimal | int = _NS_PER_S) -> int:
    """A decimal number of seconds, or of unit_ns, to the very nanosecond: a float64 of today's seconds has but 7 digits
    behind its point. Raises RecordingError for what is none."""
    try:
        stamp = Decimal(word) * unit_ns
    except ArithmeticError:
        raise RecordingError(f"{where}: {word[:_SHOWN]!r} is no stamp") from None
    if not (stamp.is_finite() and abs(stamp) < MAX_NS):
        raise RecordingError(f"{where}: {word[:_SHOWN]!r} is no stamp")
    return round(stamp)


def check_increasing(stamps_ns: Stamps, rows: Sequence[Row]) -> None:
    """Raise RecordingError, naming the first line whose stamp is not later than the one before."""
    late = np.flatnonzero(np.diff(stamps_ns) <= 0)
    if len(late):
        where, words = rows[late[0] + 1]
        raise RecordingError(f"{where}: the stamp {words[0]} is not later than {rows[late[0]][1][0]} before it")
