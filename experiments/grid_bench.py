"""`python -m experiments grid-bench bench.json`: the rows that tests/bench measured, as tables and a figure.

The rows travel in the extra_info of pytest-benchmark's JSON, so any table or figure can be made anew from it.
"""

import json
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

from stereogrid.errors import RecordingError
from stereogrid.figures import save_figure
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable, environment
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path

from .grid_bench_figure import bench_figure
from .tidy import write_rows

OURS, OCTOMAP = "stereogrid", "octomap"
FIGURE_DPI = 110
SPACING_M = 0.3
"""Between the frames of tests/bench."""
GROWTH_WIDTH_PX, GROWTH_RANGE_M = 320, 8.0
GROWTH_OF = f"{GROWTH_WIDTH_PX} x {GROWTH_WIDTH_PX * 3 // 4} px, depths up to {GROWTH_RANGE_M:g} m"
PIPELINE_MATCHER, PIPELINE_RANGE_M = "bm", 5.0
"""As in the corridor experiment."""


@dataclass(frozen=True)
class SpeedRow:
    """Frames a second of CPU of one map, which has seen one frame before the n_frames that are timed.

    n_known, updates_per_frame: known cells, and how many a frame updates; of ours alone, which can be asked.
    """

    contender: str
    cell_m: float
    width_px: int
    range_m: float
    n_frames: int
    fps: float
    n_bytes: int
    n_known: int | None = None
    updates_per_frame: float | None = None

    @property
    def case(self) -> tuple[float, int, float]:
        """What two contenders must share to be compared: cell, width and range."""
        return self.cell_m, self.width_px, self.range_m


@dataclass(frozen=True)
class GrowthRow:
    """A map after length_m of drive, frames a second of CPU over the last ten of them, and the slowest frame of all."""

    contender: str
    cell_m: float
    length_m: float
    fps: float
    slowest_ms: float
    n_bytes: int
    n_known: int | None = None


@dataclass(frozen=True)
class PipelineRow:
    """Pairs a second by the clock of a stage: matching, grid, or both; and how long a pair takes [ms]."""

    stage: str
    cell_m: float
    width_px: int
    pairs_per_s: float
    median_ms: float
    p99_ms: float
    n_pairs: int


Row = SpeedRow | GrowthRow | PipelineRow
KINDS: dict[str, type[Row]] = {"speed": SpeedRow, "growth": GrowthRow, "pipeline": PipelineRow}
OfKind = TypeVar("OfKind", SpeedRow, GrowthRow, PipelineRow)


def plain(row: Row) -> dict[str, Any]:
    """The row as it stands in extra_info."""
    kind = next(name for name, of_kind in KINDS.items() if isinstance(row, of_kind))
    return {"kind": kind, **asdict(row)}


def read_rows(path: Path) -> list[Row]:
    """The rows of a JSON that pytest-benchmark wrote. RecordingError when it holds none, or is none."""
    try:
        benchmarks = json.loads(path.read_text(encoding="utf-8"))["benchmarks"]
        infos = [dict(benchmark["extra_info"]) for benchmark in benchmarks]
        rows = [KINDS[info.pop("kind")](**info) for info in infos if "kind" in info]
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{path}: is not what tests/bench writes ({type(error).__name__}: {error})") from None
    if not rows:
        raise RecordingError(f"{path}: holds no measurements of tests/bench")
    return rows


def run(path: Path, *, runs: Path, picture: Path | None = None) -> tuple[Path, list[ReportTable]]:
    """Lay out a benchmark's JSON in a new run folder; the folder and its tables. picture: the figure there as well."""
    rows = read_rows(path)
    tables = bench_tables(rows)
    with recorded_run(runs, "bench", RunRecord.of("experiments grid-bench")) as folder:
        shutil.copyfile(path, folder / "bench.json")
        write_rows(folder / "bench.csv", [plain(row) for row in rows])
        text = "\n".join([_measured(json.loads(path.read_text(encoding="utf-8"))), *(t.markdown for t in tables)])
        (folder / "tables.md").write_text(text, encoding="utf-8")
        figure = bench_figure(of(rows, SpeedRow), of(rows, GrowthRow), growth_of=GROWTH_OF)
        if figure is not None:
            for out in (folder / "grid-bench.png", *([picture] if picture else [])):
                save_figure(figure, out, dots_per_inch=FIGURE_DPI)
    return finished_path(folder), tables


def of(rows: Sequence[Row], kind: type[OfKind]) -> list[OfKind]:
    """The rows of one kind."""
    return [row for row in rows if isinstance(row, kind)]


def bench_tables(rows: Sequence[Row]) -> list[ReportTable]:
    """A table of each kind of which there are rows."""
    tables = []
    if speed := of(rows, SpeedRow):
        tables.append(_speed_table(speed))
    if growth := of(rows, GrowthRow):
        tables.append(_growth_table(growth))
    if pipeline := of(rows, PipelineRow):
        tables.append(_pipeline_table(pipeline))
    return tables


def _speed_table(rows: Sequence[SpeedRow]) -> ReportTable:
    theirs = {row.case: row for row in rows if row.contender == OCTOMAP}
    ours = sorted((row for row in rows if row.contender == OURS), key=lambda row: row.case)
    header = ["cell [m]", "image [px]", "range [m]", "fps", "OctoMap fps", "times", "10^6 cells/s", "MB", "OctoMap MB"]
    size = f"maps of {rows[0].n_frames + 1} frames, {SPACING_M:g} m apart."
    note = f"Frames a second of CPU, one core; cells updated a second; {size}"
    lines = [_speed_line(row, theirs.get(row.case)) for row in ours]
    return ReportTable("Speed", [*header, "bytes a known cell"], lines, n_names=3, note=note)


def _speed_line(ours: SpeedRow, theirs: SpeedRow | None) -> list[str]:
    return [
        f"{ours.cell_m:g}",
        f"{ours.width_px} x {ours.width_px * 3 // 4}",
        f"{ours.range_m:g}",
        number(ours.fps),
        number(theirs.fps if theirs else None),
        number(ours.fps / theirs.fps if theirs else None),
        number(1e-6 * ours.fps * ours.updates_per_frame if ours.updates_per_frame else None),
        number(ours.n_bytes / 1e6),
        number(theirs.n_bytes / 1e6 if theirs else None),
        number(_each(ours)),
    ]


def _growth_table(rows: Sequence[GrowthRow]) -> ReportTable:
    header = ["drive [m]", "map", "cell [m]", "MB", "kB a metre", "bytes a known cell", "fps over the last 10 m"]
    header.append("slowest frame [ms]")
    lines = [
        [
            f"{row.length_m:g}",
            row.contender,
            f"{row.cell_m:g}",
            number(row.n_bytes / 1e6),
            number(row.n_bytes / row.length_m / 1e3),
            number(_each(row)),
            number(row.fps),
            number(row.slowest_ms),
        ]
        for row in sorted(rows, key=lambda row: (row.length_m, row.contender != OURS))
    ]
    note = f"{GROWTH_OF}, a frame every {SPACING_M:g} m; one core."
    return ReportTable("Growth with the length of the drive", header, lines, n_names=3, note=note)


def _pipeline_table(rows: Sequence[PipelineRow]) -> ReportTable:
    header = ["stage", "pairs a second", "median [ms]", "99th percentile [ms]", "pairs timed"]
    lines = [
        [row.stage, number(row.pairs_per_s), number(row.median_ms), number(row.p99_ms), str(row.n_pairs)]
        for row in rows
    ]
    note = (
        f"{PIPELINE_MATCHER}, {rows[0].width_px} px wide, cells of {rows[0].cell_m:g} m, depths up to "
        f"{PIPELINE_RANGE_M:g} m; by the clock, 2 cores."
    )
    return ReportTable("From pair to map", header, lines, note=note)


def _each(row: SpeedRow | GrowthRow) -> float | None:
    """Bytes of a known cell, where they are counted."""
    return row.n_bytes / row.n_known if row.n_known else None


def number(value: float | None) -> str:
    """Three digits are what a measurement of time is worth; a dash for nothing."""
    if value is None:
        return "-"
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def _measured(bench: Mapping[str, Any]) -> str:
    """When, and on what."""
    commit, cpu = bench.get("commit_info", {}), bench.get("machine_info", {}).get("cpu", {})
    facts = environment()
    with suppress(metadata.PackageNotFoundError):
        facts["versions"] += f", octomap-python {metadata.version('octomap-python')}"
    changed = " with changes" if commit.get("dirty") else ""
    return (
        f"Measured {bench.get('datetime', '')[:16]} on {cpu.get('brand_raw', 'an unknown processor')}, "
        f"{facts['machine']}, Python {facts['python']}, commit {str(commit.get('id', 'unknown'))[:10]}{changed}; "
        f"{facts['versions']}.\n"
    )
