"""The one tidy table of a sweep: a row a score of a map, or of a map that failed; sweep.csv and sweep.parquet."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from stereogrid.files import written_beside
from stereogrid.scoring import Score

from .sweep_axes import value_at
from .sweep_config import SweepConfig, SweepUnit
from .tidy import write_rows

OK, FAILED = "ok", "failed"
RESULT = pa.schema(
    [
        ("world", pa.string()),
        ("seed", pa.int64()),
        ("status", pa.string()),
        ("error", pa.string()),
        ("score", pa.string()),
        ("value", pa.float64()),
        ("unit", pa.string()),
        ("n", pa.int64()),
    ]
)
Row = dict[str, Any]


@dataclass(frozen=True)
class Made:
    """A map's scores; or none, and why."""

    unit: SweepUnit
    scores: tuple[Score, ...] = ()
    error: str = ""


def rows_of(config: SweepConfig, results: Iterable[Made]) -> list[Row]:
    """The rows, in the order of the results. What there is not is None."""
    names = [name for axis in config.axes for name in axis.names]
    rows = []
    for made in results:
        unit = made.unit
        head = {name: _cell(value_at(unit.config, name)) for name in names}
        head |= {"world": unit.world, "seed": unit.seed, "status": FAILED if made.error else OK}
        head |= dict.fromkeys(RESULT.names[len(head) - len(names) :])
        for each in made.scores:
            value = None if math.isnan(each.value) else each.value
            rows.append({**head, "score": each.name, "value": value, "unit": each.unit, "n": each.n})
        if made.error:
            rows.append({**head, "error": made.error})
    return rows


def write_tables(folder: Path, rows: Sequence[Row]) -> None:
    """sweep.csv and sweep.parquet: the same rows; an empty cell of the one is null in the other."""
    write_rows(folder / "sweep.csv", rows)
    parameters = [name for name in rows[0] if name not in RESULT.names]
    columns = {name: pa.array([row[name] for row in rows]) for name in parameters}
    columns |= {each.name: pa.array([row[each.name] for row in rows], each.type) for each in RESULT}
    with written_beside(folder / "sweep.parquet") as temporary:
        pq.write_table(pa.table(columns), temporary)


def _cell(value: Any) -> Any:
    """A parameter's value; lists and sections as JSON."""
    if isinstance(value, str | bool | int | float):
        return value
    return json.dumps(asdict(value) if is_dataclass(value) else value)
