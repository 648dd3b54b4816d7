"""Sweeps: any parameters x worlds x seeds, on the processes of this machine or of a cluster.

The unit is one map of one simulated drive: a setting of the parameters, a world, a seed. A unit that is finished is
kept, and so is the reason of one that failed: stopped and started again, a sweep goes on where it was.
"""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from stereogrid.errors import InvalidInputError, StereogridError
from stereogrid.recorded_run import recorded_run
from stereogrid.report import ReportTable
from stereogrid.run_record import RunRecord
from stereogrid.runs import check_runs, finished_path
from stereogrid.scoring import scores_from_dict

from .kept import ROOT, KeptScores, KeptTexts, key_of
from .sweep_cluster import Place, made, opened
from .sweep_config import SweepConfig, SweepUnit
from .sweep_report import name_of, write_sweep
from .sweep_table import Made
from .sweep_unit import Plain, files_of, makings

SHOWN_FAILURES = 5


class Kept:
    """The finished units of sweeps, and the reasons of those that failed, in a folder."""

    def __init__(self, work: Path) -> None:
        self.scores, self.failures = KeptScores(work / "units"), KeptTexts(work / "failed")

    def has(self, key: str) -> bool:
        """Whether that unit need not be made."""
        return self.scores.get(key) is not None or self.failures.get(key) is not None

    def keep(self, key: str, unit: SweepUnit, result: Plain) -> bool:
        """Keep what `attempt` gave; whether there are scores."""
        if "error" in result:
            self.failures.keep(key, result["error"])
            return False
        self.scores.keep(key, scores_from_dict(result["scores"]), {"unit": name_of(unit), "config": unit.config})
        self.failures.drop(key)
        return True

    def result(self, key: str, unit: SweepUnit) -> Made:
        """What is kept of a unit."""
        scores = self.scores.get(key)
        return Made(unit, error=self.failures.get(key) or "lost") if scores is None else Made(unit, tuple(scores))


def run(
    config: SweepConfig, *, place: Place, runs: Path, work: Path, retry: bool = False, command: str = ""
) -> tuple[Path, list[ReportTable]]:
    """Make every map that is not kept; the run folder and the tables for the screen. retry: what failed before, too.

    Raises InvalidInputError, after all is written, where every map failed.
    """
    check_runs(runs)  # not after hours
    begun = RunRecord.of("experiments sweep", command)
    results = compute(config, place, work, retry=retry)
    files = {each for made in results for each in made.unit.config.mapping.matcher.files()}
    run_of = begun.reading(*sorted(files))
    with recorded_run(runs, "sweep", run_of, config) as folder:
        tables = write_sweep(folder, config, results, facts={"command": command})
    failed = [each for each in results if each.error]
    for each in failed[:SHOWN_FAILURES]:
        print(f"failed: {name_of(each.unit)}: {each.error}", file=sys.stderr)
    if len(failed) > SHOWN_FAILURES:
        print(f"and {len(failed) - SHOWN_FAILURES} more: see sweep.csv", file=sys.stderr)
    if len(failed) == len(results):
        raise InvalidInputError(f"all {len(failed)} maps failed; {finished_path(folder) / 'report.html'} lists them")
    return finished_path(folder), tables


def compute(config: SweepConfig, place: Place, work: Path, *, retry: bool = False) -> list[Made]:
    """What every unit gives, made or kept, in the order of the config."""
    kept, making, files = Kept(work), makings(), cache(files_of)
    units = [(key_of(making, unit.config, files(unit.config.mapping.matcher)), unit) for unit in config.units()]
    if retry:
        for key, _ in units:
            kept.failures.drop(key)
    missing = {key: unit for key, unit in units if not kept.has(key)}
    if missing:
        make(missing, kept, place=place, work=work, total=len(units))
    # Read back even where they were made just now: what is kept is what counts.
    return [kept.result(key, unit) for key, unit in units]


def make(missing: Mapping[str, SweepUnit], kept: Kept, *, place: Place, work: Path, total: int) -> None:
    """Make and keep what is missing of so many units in total."""
    # Workers elsewhere need no folder in common with us: a relative one is in each one's own checkout.
    drives = work / "drives" if place.scheduler else (work / "drives").resolve()
    done = total - len(missing)
    configs = {key: unit.config for key, unit in missing.items()}
    try:
        with opened(place, ROOT / drives) as client, sweep_bar(done, total) as bar:
            for key, result in made(client, configs, str(drives)):
                if "stopped" in result:
                    raise StereogridError(
                        f"{name_of(missing[key])}: {result['stopped']}; {done} of {total} maps are kept in {work}: "
                        "make room, and the same command goes on from there"
                    )
                done += 1
                bar(done, failed=not kept.keep(key, missing[key], result))
    except KeyboardInterrupt:
        print(f"{done} of {total} maps are kept in {work}: the same command goes on from there", file=sys.stderr)
        raise


@contextmanager
def sweep_bar(done: int, total: int) -> Iterator["Bar"]:
    """A bar on stderr, where that is a terminal, with the time that is left and how many failed."""
    console = Console(stderr=True)
    columns = (TextColumn("mapping"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left:"))
    with Progress(
        *columns,
        TimeRemainingColumn(),
        TextColumn("{task.fields[failed]}"),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as progress:
        yield Bar(progress, done, total)


class Bar:
    """Shows how many are done and how many failed."""

    def __init__(self, progress: Progress, done: int, total: int) -> None:
        self.progress, self.n_failed = progress, 0
        self.task = progress.add_task("", total=total, completed=done, failed="")

    def __call__(self, done: int, *, failed: bool) -> None:
        """One more is done."""
        self.n_failed += failed
        self.progress.update(self.task, completed=done, failed=f"{self.n_failed} failed" if self.n_failed else "")
