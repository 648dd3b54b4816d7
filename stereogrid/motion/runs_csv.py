"""Runs as a CSV file: one row a mark, the unit of each column in its name (docs/motion.md)."""

import csv
import difflib
import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import InvalidInputError
from ..files import written_beside
from ..geometry import FloatArray
from .runs import Run, Runs

SIDES = ("odo", "true")
LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
ANGLES = {"rad": 1.0, "deg": math.pi / 180}
UNITS = {"x": LENGTHS, "y": LENGTHS, "heading": ANGLES}
COLUMNS = {
    f"{side}_{quantity}_{unit}": (side, quantity, factor)
    for side in SIDES
    for quantity, units in UNITS.items()
    for unit, factor in units.items()
}
"""What a column with numbers may be called: whose, what, and times what it is in metres and radians."""
NEW_HEADER = ("run", "surface", *(f"{side}_{what}" for side in SIDES for what in ("x_m", "y_m", "heading_deg")))
"""Of a file that rows are appended to: the units that a person reads it in."""
FINEST = 1e-5
"""Rows are appended to a hundredth of a millimetre, and about as fine in angles [m, rad]."""
FARTHEST_M = 100.0
MOST_TURNED_RAD = 4 * np.pi
"""Runs over marks reach no farther from their start: what does is in another unit."""


def read_runs(path: str | Path) -> Runs:
    """The runs of a CSV file. Raises InvalidInputError that names the row or the column which is wrong."""
    path = Path(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
        return _runs(rows)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InvalidInputError(f"{path}: is no text in UTF-8; save the table as CSV with that encoding") from None
    except (InvalidInputError, csv.Error) as error:
        raise InvalidInputError(f"{path}: {error}") from None


def write_runs(path: str | Path, runs: Runs) -> None:
    """Write runs [m, rad] so that read_runs reads equal ones, to a micrometre and a microradian."""
    headings = all(run.has_headings for run in runs)
    quantities = {"x": "x_m", "y": "y_m"} | ({"heading": "heading_rad"} if headings else {})
    with written_beside(Path(path)) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["run", "surface", *(f"{side}_{name}" for side in SIDES for name in quantities.values())])
        for run in runs:
            for row in np.hstack([run.odo[:, : len(quantities)], run.true[:, : len(quantities)]]):
                writer.writerow([run.name, run.surface, *(f"{value:.6f}" for value in row)])


def append_readings(path: str | Path, run: Run, first: int = 0) -> None:
    """Add the readings of a run from number `first` on to a file, in the file's own columns, or begin a new one.

    Whatever happens the file is whole: as it was, or with all of them. Raises InvalidInputError where it holds no runs,
    or has no column for what the run has.
    """
    path = Path(path)
    if path.exists():
        read_runs(path)
        before = path.read_bytes()
    else:
        before = (",".join(NEW_HEADER) + "\n").encode()
    text = before.decode("utf-8-sig")
    header = [name.strip() for name in next(csv.reader(io.StringIO(text)))]
    if run.surface and "surface" not in header:
        raise InvalidInputError(f"{path}: has no column 'surface', and {run} names one")
    rows = io.StringIO()
    writer = csv.writer(rows, lineterminator="\r\n" if "\r\n" in text else "\n")
    for odo, true in zip(run.odo[first:], run.true[first:], strict=True):
        named = {"run": run.name, "surface": run.surface}
        writer.writerow([named[name] if name in named else _cell(name, {"odo": odo, "true": true}) for name in header])
    end = b"" if before.endswith(b"\n") else b"\n"
    with written_beside(path) as temporary:
        temporary.write_bytes(before + end + rows.getvalue().encode())


def _cell(name: str, reading: dict[str, FloatArray]) -> str:
    """What stands in the column `name` for one reading of odometry and truth [m, rad]."""
    side, what, factor = COLUMNS[name]
    return f"{reading[side][list(UNITS).index(what)] / factor:.{max(0, math.ceil(math.log10(factor / FINEST)))}f}"


def _runs(rows: Sequence[tuple[int, list[str]]]) -> Runs:
    if not rows:
        raise InvalidInputError("is empty; its first row must name the columns")
    header = [name.strip() for name in rows[0][1]]
    columns = _columns(header)
    if len(rows) == 1:
        raise InvalidInputError("names its columns, but has no rows below them")
    found: dict[tuple[str, str], list[tuple[int, dict[str, float]]]] = {}
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise InvalidInputError(f"row {line} has {len(row)} values, but there are {len(header)} columns")
        cells = dict(zip(header, (cell.strip() for cell in row), strict=True))
        if not cells["run"]:
            raise InvalidInputError(f"row {line}: no name or number of the run in the column 'run'")
        readings = found.setdefault((cells.get("surface", ""), cells["run"]), [])
        values = {}
        for name, (side, what, _) in columns.items():
            values[f"{side}_{what}"] = value = _number(cells[name], name, line)
            start = 0.0 if what == "heading" else readings[0][1][f"{side}_{what}"] if readings else value
            _check_reach(value - start, name, line)
        readings.append((line, values))
    return Runs(tuple(_run(name, surface, readings) for (surface, name), readings in found.items()))


def _run(name: str, surface: str, readings: Sequence[tuple[int, dict[str, float]]]) -> Run:
    odo, true = (
        np.array([[values.get(f"{side}_{what}", np.nan) for what in UNITS] for _, values in readings]) for side in SIDES
    )
    return Run(name, odo, true, surface=surface, rows=tuple(line for line, _ in readings))


def _columns(header: Sequence[str]) -> dict[str, tuple[str, str, float]]:
    """COLUMNS of those that hold numbers; what is missing, unknown or there twice is refused by name."""
    _check_separator(header)
    known = ["run", "surface", *COLUMNS]
    if not {*header} & {*known}:
        raise InvalidInputError(f"its first row must name the columns; choose from: {', '.join(known)}")
    for number, name in enumerate(header, start=1):
        if not name:
            raise InvalidInputError(f"column {number} has no name in the first row")
        if name not in known:
            near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]!r}?" if near else f"choose from: {', '.join(known)}"
            raise InvalidInputError(f"unknown column {name!r}; {hint}")
    columns = {name: COLUMNS[name] for name in header if name in COLUMNS}
    filled = [(side, what) for side, what, _ in columns.values()]
    for side, what in filled:
        if filled.count((side, what)) > 1:
            raise InvalidInputError(f"more than one column holds {side}_{what}")
    needed = [("odo", "x"), ("odo", "y"), ("true", "x"), ("true", "y")]
    if any(what == "heading" for _, what in filled):
        needed += [(side, "heading") for side in SIDES]
    if "run" not in header:
        raise InvalidInputError("missing column 'run', which names or numbers the run of each row")
    for side, what in needed:
        if (side, what) not in filled:
            units = " or ".join(f"{side}_{what}_{unit}" for unit in UNITS[what])
            raise InvalidInputError(f"missing column {units}")
    if len(set(header)) < len(header):
        raise InvalidInputError("a column is there twice")
    return columns


def _check_separator(header: Sequence[str]) -> None:
    for separator in ";\t|":
        if len(header) == 1 and separator in header[0]:
            raise InvalidInputError(
                f"columns must be separated by commas, not by {separator!r} (and decimals by a point)"
            )


def _number(cell: str, name: str, line: int) -> float:
    """The number in a cell [m or rad]."""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInputError(f"row {line}, column {name}: {cell!r} is not a number")
    return value * COLUMNS[name][2]


def _check_reach(away: float, name: str, line: int) -> None:
    """Refuse what is so large [m from the run's start, or rad] that it must be in another unit than its column says."""
    _, what, factor = COLUMNS[name]
    if abs(away) <= (MOST_TURNED_RAD if what == "heading" else FARTHEST_M):
        return
    unit, value = name.rsplit("_", 1)[1], away / factor
    if what == "heading":
        likely = "degrees, it seems: name the column ..._deg" if unit == "rad" else "headings go up to two turns"
        raise InvalidInputError(f"row {line}, column {name}: {value:g} {unit} is no heading; {likely}")
    # A run of some metres: the units in which it is one.
    fits = [other for other in LENGTHS if abs(value) * LENGTHS[other] <= 15 and LENGTHS[other] < LENGTHS[unit]]
    named = " or ".join(f"..._{other}" for other in fits)
    likely = f"{' or '.join(fits)}, it seems: name the column {named}" if fits else f"runs stay within {FARTHEST_M:g} m"
    raise InvalidInputError(f"row {line}, column {name}: {value:g} {unit} from the run's start is too far; {likely}")
