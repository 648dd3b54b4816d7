"""`stereogrid repeat`: a run once more, and whether the same comes out."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InvalidInputError, MapTooLargeError, RecordingError, StereogridError
from ..interrupts import held_interrupts
from ..runs import check_runs
from ..screen import console, track
from ..tomlfile import CONFIG_TOML
from .options import RUNS, RunsOption

if TYPE_CHECKING:
    from ..run_record import RunRecord

EXPERIMENT = re.compile(r"experiments ([a-z]+(?:-[a-z]+)*)")
MATCHER = re.compile(r"[a-z0-9]+")
SWEEP = "experiments sweep"
RESUMABLE = ("claim", "claim-tune", "sweep")
"""These keep what they have made, to go on from there."""
OPTIONS = ("recording", "data", "pairs")
"""Inputs that an experiment takes by an option of that name; it finds the others by its config."""
ONCE = {
    "hardware drive": "a drive happens once; `stereogrid map RECORDING --config RUN/config.toml` maps its recording",
    "experiments grid-bench": "it lays out times that were measured, and no time is had twice",
}
SHOWN = 12
"""Digits of a hash that tell enough."""
CLONE = Path(__file__).resolve().parents[2]
"""Where experiments are, if anywhere: beside this very package. The folder that a user stands in may be anybody's."""
LOOKS_S = 0.1


def repeat(
    run: Annotated[Path, typer.Argument(help="A run folder: runs/latest, say.")],
    recording: Annotated[Path | None, typer.Option(help="Where its recording is now, if it was moved.")] = None,
    anyway: Annotated[bool, typer.Option("--anyway", help="Even if what it read was changed since.")] = False,
    runs: RunsOption = RUNS,
) -> None:
    """Run a run again from its run.toml and config.toml, and compare: 0 where every hash is the same, else 1.

    The number of threads and what Numba has cached make no difference to a map.
    """
    from ..run_record import RunRecord

    was = RunRecord.load(run)
    run = run.resolve()
    again = _with_inputs(was, run, recording, anyway)
    if again.program in ONCE:
        raise InvalidInputError(f"{run}: made by {again.program}: {ONCE[again.program]}")
    if not was.results:
        raise InvalidInputError(f"{run}: its run.toml holds no results that a repetition could be compared with")
    folder = _mapped(again, run, runs) if again.program == "map" else _experimented(again, run, runs)
    _compare(was, RunRecord.load(folder), run, folder)


def _with_inputs(was: "RunRecord", run: Path, recording: Path | None, anyway: bool) -> "RunRecord":
    """The record of what is to be run now; refused where what it reads is not there, or not what it was."""
    from ..digests import digest_of
    from ..run_record import OUTSIDE

    made_here = not Path(was.recording).is_absolute()
    if recording is not None and made_here:
        raise InvalidInputError(f"{run}: the run was of no recording that could have been moved")
    again = was.at(recording) if recording else was
    read = [] if made_here else [(again.recording, was.recording_sha256, "where it is now: --recording PATH")]
    # What belongs to a recording that was moved was moved with it: it is found there, and compared afterwards.
    inputs = [each for each in was.inputs if recording is None or each.kind != OUTSIDE]
    for path, before, hint in (*read, *((each.path, each.sha256, "put it back") for each in inputs)):
        if not Path(path).exists():
            raise RecordingError(f"{path}: is not there any more; {hint}")
        now = digest_of(Path(path))
        if now != before and not anyway:
            raise RecordingError(
                f"{path}: is not what the run read: its SHA-256 is {now[:SHOWN]}..., was {before[:SHOWN]}...; "
                f"{hint}; or run with it --anyway"
            )
    return again


def _mapped(again: "RunRecord", run: Path, runs: Path) -> Path:
    """The run folder of a map that was made again."""
    from ..config import MappingConfig, load_config
    from ..mapping_run import map_recording

    command = " ".join(["stereogrid", *sys.argv[1:]])
    config = load_config(MappingConfig, run / CONFIG_TOML)
    before = _run_folders(runs)
    name = Path(again.recording).stem
    # Of a map that outgrew its limit there is a run folder as well.
    with suppress(MapTooLargeError):
        source = again.open_recording(run)
        map_recording(
            again.claiming(source),
            config,
            name=name,
            runs=runs,
            record=again.anew(command),
            track=track,
            score=again.score,
            truth_of=source,
        )
    return _new_run(before, runs, command)


def _experimented(again: "RunRecord", run: Path, runs: Path) -> Path:
    """The run folder of an experiment that was run again, by a process of its own: it is no part of the library."""
    named = EXPERIMENT.fullmatch(again.program)
    if not named:
        raise InvalidInputError(f"{run}: there is no way to repeat a run of {again.program!r}")
    if not (CLONE / "pyproject.toml").is_file() or not (CLONE / "experiments" / "__main__.py").is_file():
        raise InvalidInputError(f"{run}: made by an experiment, which only a clone of stereogrid has: repeat it there")
    runs = runs.absolute()
    check_runs(runs)
    # It would stand in for data that the run did not have.
    environment = {name: value for name, value in os.environ.items() if name != "STEREOGRID_DATA"}
    # What is kept of earlier runs would repeat nothing, and another repetition may be under way.
    with TemporaryDirectory(prefix=".repeated-", dir=runs) as work:
        arguments = [named[1], *_options(again, run), "--runs", str(runs)]
        arguments += ["--work", work] if named[1] in RESUMABLE else []
        before = _run_folders(runs)
        code = _ended([sys.executable, "-m", "experiments", *arguments], environment)
    if code:
        raise StereogridError(f"{again.program} ended with {code}, so there is nothing to compare")
    return _new_run(before, runs, " ".join(["python -m experiments", *arguments]))


def _ended(command: Sequence[str], environment: Mapping[str, str]) -> int:
    """The exit code of a process that runs in the clone. An interrupt is handed on to it, and raised once it has ended.

    It needs its time to leave nothing half-written; a second interrupt ends it at once. In a session of its own it is
    interrupted by us alone: the terminal's Ctrl-C would reach it too, amid its tidying up.
    """
    with held_interrupts() as interrupted:
        process = subprocess.Popen(
            command, env=environment, cwd=CLONE, stdin=subprocess.DEVNULL, start_new_session=True
        )
        while process.poll() is None and not interrupted():
            with suppress(subprocess.TimeoutExpired):
                process.wait(LOOKS_S)
    if not interrupted():
        return process.returncode
    process.terminate()
    try:
        process.wait()
    except KeyboardInterrupt:
        process.kill()
        raise
    raise KeyboardInterrupt


def _options(again: "RunRecord", run: Path) -> Iterator[str]:
    """Of an experiment: what it reads. Nothing from the file but these becomes an option."""
    if again.config_sha256:
        # A sweep's is an argument.
        yield from (() if again.program == SWEEP else ("--config",))
        yield str(run / CONFIG_TOML)
    if Path(again.recording).is_absolute():
        yield from ("--recording", again.recording)
    for each in again.inputs:
        if each.kind in OPTIONS:
            yield from (f"--{each.kind}", str(Path(each.path).absolute()))
    for name in again.matchers:
        if not MATCHER.fullmatch(name):
            raise InvalidInputError(f"{run}: run.toml: {name!r} is no name of a matcher")
        yield from ("--matcher", name)


def _run_folders(runs: Path) -> set[Path]:
    """Those that are whole: one in the making is hidden."""
    folders = (each.parent for each in runs.glob("*/run.toml"))
    return {each for each in folders if not (each.is_symlink() or each.name.startswith("."))}


def _new_run(before: set[Path], runs: Path, command: str) -> Path:
    """The run folder that this command has made since; others may be at work there, too."""
    from ..run_record import RunRecord

    for folder in sorted(_run_folders(runs) - before):
        if RunRecord.load(folder).command == command:
            return folder
    raise StereogridError(f"{runs}: the repetition left no run folder there")


def _compare(was: "RunRecord", now: "RunRecord", run: Path, folder: Path) -> None:
    """A table on stdout; StereogridError names the first difference, and what else is not as it was."""
    from rich.table import Table

    table, different = Table("what", "was", "is", "same", box=None), []
    for name in sorted({**was.results, **now.results}):
        hashes = was.results.get(name, ""), now.results.get(name, "")
        same = hashes[0] == hashes[1]
        table.add_row(name, *(each[:SHOWN] or "-" for each in hashes), "yes" if same else "NO")
        if not same:
            different.append(name)
    console.print(table)
    console.print(str(folder), highlight=False, soft_wrap=True)
    changes = "; ".join(_changes(was, now, run))
    if different:
        count = f" and {len(different) - 1} more" if len(different) > 1 else ""
        because = f"changed in between: {changes}" if changes else "versions, config, machine and inputs are the same"
        raise StereogridError(f"{different[0]}{count}: not the same as in {run}; {because}")
    if changes:
        console.print(f"the same, although in between changed: {changes}", highlight=False, soft_wrap=True)


def _changes(was: "RunRecord", now: "RunRecord", run: Path) -> Iterator[str]:
    """What was not as it had been, a few words each."""
    from ..digests import digest_of

    if was.config_sha256 and digest_of(run / CONFIG_TOML) != was.config_sha256:
        yield "config.toml of the run"
    for name in {**was.versions, **now.versions}:
        before, after = was.versions.get(name, "none"), now.versions.get(name, "none")
        if before != after:
            yield f"{name} {before} -> {after}"
    if was.machine != now.machine:
        yield f"machine {was.machine} -> {now.machine}"
    if was.recording_sha256 != now.recording_sha256:
        yield "the recording"
    others = {(each.kind, each.sha256) for each in now.inputs}
    for each in was.inputs:
        if (each.kind, each.sha256) not in others:
            yield f"{each.kind} {each.path}"
