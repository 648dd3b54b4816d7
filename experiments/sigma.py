"""`python -m experiments sigma`: fit the tables of sigma, and test each on scenes that it was fitted without.

68 % of the errors of matched, visible pixels should be within one sigma and 95 % within two. A fold leaves a group of
scenes out of the fit and counts on it; two more carry the tables from the real pairs to the synthetic ones and back.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import stereogrid.matching.sigma
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.figures import save_figure
from stereogrid.files import written_beside
from stereogrid.matching import MATCHERS, matcher
from stereogrid.matching.sigma import GENERIC, SigmaTable, sigma_tables
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable, write_metrics
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path

from .parallel import Stage, in_parallel
from .sigma_fit import Coverage, Sample, coverage, fit
from .sigma_scenes import Scene, scenes
from .tidy import write_rows

TABLES = Path(stereogrid.matching.sigma.__file__).with_name("sigma_tables.json")
COMMAND = "python -m experiments sigma --data ../shared/data --write"
WITHOUT_TABLE = ("onnx",)
"""Matchers whose errors depend on what a user brings: GENERIC serves them."""
SHARES = {"one": 68.0, "two": 95.0}
MARGIN = 3.0


@dataclass(frozen=True)
class Row:
    """What one matcher's table covers of some scenes of one kind [%], and how it was fitted.

    one, two: within one and two sigmas, these widened by the truth's own rounding; _raw: not widened; _all: with the
    matched pixels that only the left image shows.
    """

    matcher: str
    fitted_on: str
    scenes: str
    one: float
    two: float
    one_raw: float
    two_raw: float
    one_all: float
    two_all: float
    median_sigma_px: float

    @property
    def within(self) -> bool:
        """Whether both shares are right to MARGIN."""
        return all(abs(getattr(self, name) - share) <= MARGIN for name, share in SHARES.items())


def screen_table(rows: Sequence[Row]) -> ReportTable:
    """A row a matcher and kind of scenes; a star where a share is off by more than the margin."""
    header = ["matcher", "fitted on", "tested on", "1s", "2s", "", "1s raw", "2s raw", "1s all", "2s all"]
    shown = []
    for row in rows:
        shares = (row.one_raw, row.two_raw, row.one_all, row.two_all)
        found = (f"{row.one:.1f}", f"{row.two:.1f}", "" if row.within else "*", *(f"{share:.1f}" for share in shares))
        shown.append([row.matcher, row.fitted_on, row.scenes, *found])
    return ReportTable("Sigma", header, shown, n_names=3)


def run(
    data: Path, stage: Stage, *, runs: Path, names: Sequence[str] = (), write: bool = False, command: str = ""
) -> tuple[Path, list[Row]]:
    """Fit and test the tables of the named matchers (all that have one when none is named); folder and rows.

    write: replace their tables in TABLES; GENERIC's too when no matcher is named.
    """
    with_table = tuple(name for name in MATCHERS if name not in WITHOUT_TABLE)
    chosen = tuple(names) or with_table
    for name in chosen:
        if name not in with_table:
            raise unknown_name("matcher with a table", name, with_table)
    run_of = RunRecord.of("experiments sigma", command).reading(("data", data))
    with recorded_run(runs, "sigma", replace(run_of, matchers=tuple(names))) as folder:
        with stage("preparing scenes", 1):
            seen = list(scenes(data))
        samples = {}
        for name in chosen:
            with stage(f"matching by {name}", len(seen)) as step:
                jobs = {str(n): partial(_sample, name, scene) for n, scene in enumerate(seen)}
                samples[name] = list(in_parallel(jobs, step).values())
        with stage("fitting", len(chosen)) as step:
            fitted = in_parallel({name: partial(fit_and_test, name, samples[name]) for name in chosen}, step)
        tables = {name: table for name, (table, _) in fitted.items()}
        rows = list(chain.from_iterable(rows for _, rows in fitted.values()))
        if not names:
            tables[GENERIC] = fit([s for of_one in samples.values() for s in of_one if s.fits])
            rows += [row for name in chosen for row in _judged(name, GENERIC, samples[name], tables[GENERIC])]
        _write_results(folder, rows, tables, command)
        if write:
            write_tables(tables)
    return finished_path(folder), rows


def _sample(name: str, scene: Scene) -> Sample:
    count = -(-scene.num_disparities // 16) * 16
    return Sample.of(scene, matcher(name, num_disparities=count).match(scene.left, scene.right))


def fit_and_test(name: str, samples: Sequence[Sample]) -> tuple[SigmaTable, list[Row]]:
    """The table fitted to all the scenes, and the rows of tables that were fitted to some of them only."""
    table = fit([sample for sample in samples if sample.fits])
    rows = []
    for group in dict.fromkeys(sample.scene.group for sample in samples):
        rows += _fold(name, "the others", samples, table, lambda scene, group=group: scene.group == group)
    rows += _fold(name, "real", samples, table, lambda scene: not scene.is_real)
    rows += _fold(name, "synthetic", samples, table, lambda scene: scene.is_real)
    return table, rows + _judged(name, "all", samples, table)


def _fold(
    name: str, fitted_on: str, samples: Sequence[Sample], start: SigmaTable, held: Callable[[Scene], bool]
) -> list[Row]:
    table = fit([sample for sample in samples if sample.fits and not held(sample.scene)], start)
    return _judged(name, fitted_on, [sample for sample in samples if held(sample.scene)], table)


def _judged(name: str, fitted_on: str, samples: Sequence[Sample], table: SigmaTable) -> list[Row]:
    """One row for the scenes of each kind, the shares being means over these scenes."""
    by_row: dict[str, list[tuple[Coverage, Coverage, Coverage]]] = {}
    for sample in samples:
        sigma_px = sample.sigma_px(table)
        counted = (
            coverage(sample, sigma_px),
            coverage(sample, sigma_px, rounding=False),
            coverage(sample, sigma_px, hidden=True),
        )
        by_row.setdefault(sample.scene.row, []).append(counted)
    rows = []
    for row, found in by_row.items():
        shares = [float(np.mean([getattr(each[k], n) for each in found])) for k in range(3) for n in SHARES]
        median_px = float(np.mean([each[0].median_px for each in found]))
        rows.append(Row(name, fitted_on, row, *shares, median_px))
    return rows


def write_tables(tables: Mapping[str, SigmaTable]) -> None:
    """Put tables into TABLES in place of those of the same names."""
    kept = dict(sigma_tables()) if TABLES.exists() else {}
    plain = {name: table.log_sigma for name, table in sorted({**kept, **tables}.items())}
    with written_beside(TABLES) as temporary:
        temporary.write_text(json.dumps({"command": COMMAND, "tables": plain}, indent=1) + "\n", encoding="utf-8")


def _write_results(folder: Path, rows: Iterable[Row], tables: Mapping[str, SigmaTable], command: str) -> None:
    rows = list(rows)
    plain = [{k: round(v, 3) if isinstance(v, float) else v for k, v in asdict(row).items()} for row in rows]
    write_metrics(folder, {"command": command, "tables": {n: t.log_sigma for n, t in tables.items()}, "rows": plain})
    write_rows(folder / "coverage.csv", plain)
    save_figure(coverage_figure([row for row in rows if row.fitted_on == "the others"]), folder / "coverage.png")


def coverage_figure(rows: Sequence[Row]) -> Figure:
    """Shares covered of each kind of scenes when held out, a mark a matcher, with the bands that were aimed at."""
    if not rows:
        raise InvalidInputError("no coverage to draw")
    kinds = list(dict.fromkeys(row.scenes for row in rows))
    figure = Figure(figsize=(9, 4.5), layout="constrained")
    axes = figure.subplots()
    for share in SHARES.values():
        axes.axhspan(share - MARGIN, share + MARGIN, color="0.9")
    for k, name in enumerate(dict.fromkeys(row.matcher for row in rows)):
        own = [row for row in rows if row.matcher == name]
        place = [kinds.index(row.scenes) + 0.15 * k for row in own]
        axes.plot(place, [row.one for row in own], "o", color=f"C{k}", label=f"{name}: within one sigma")
        axes.plot(place, [row.two for row in own], "^", color=f"C{k}", label=f"{name}: within two")
    axes.set_xticks(range(len(kinds)), kinds, rotation=60, ha="right")
    axes.set_ylabel("errors covered [%]")
    axes.set_title("Each kind of scenes by a table fitted without its group")
    axes.legend(ncols=2, fontsize=8)
    return figure
