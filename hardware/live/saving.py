"""What is left of a drive once the robot stands: the run folder, the map, and one line when it did not end as meant."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from stereogrid.config import MappingConfig
from stereogrid.errors import StereogridError
from stereogrid.files import make_folder
from stereogrid.mapping_run import HasCamera, Mapped, Track, untracked, write_mapped
from stereogrid.recorded_run import recorded_run
from stereogrid.report import duration_text
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path
from stereogrid.scoring import Score


@dataclass(frozen=True)
class Saved:
    """places: files and folders that were written; scores: of the map; faults: what could not be saved, and why."""

    places: tuple[Path, ...]
    scores: tuple[Score, ...]
    faults: tuple[str, ...]


def save_drive(
    mapped: Mapped,
    config: MappingConfig,
    source: HasCamera,
    *,
    runs: Path,
    out: Path | None,
    facts: dict[str, str],
    recorded: Path | None = None,
    track: Track = untracked,
) -> Saved:
    """The map first, to a place of its own; then runs/<stamp>-drive/ with figures and report.

    recorded: the recording of the drive, where there is one. out: where the map shall stay. Without, or where it cannot
    be written there, it is runs/<stamp>-drive.sgrid until the run folder, which holds it too, is whole. Whatever fails,
    the rest is done, and what is left is in places.
    """
    faults: list[str] = []
    kept = _saved_first(mapped, out, runs, faults)
    places = [kept] if kept else []
    scores: list[Score] = []
    try:
        record = RunRecord.of("hardware drive", facts.get("command", ""), recorded)
        with recorded_run(runs, "drive", record.reading(*config.matcher.files()), config) as folder:
            title = "Map of a drive"
            # The folder begins when the drive is over.
            facts = _lasted(mapped) | facts
            scores += write_mapped(folder, mapped, source=source, title=title, facts=facts, track=track, config=config)
    except Exception as error:  # whatever it is: the drive is over, and cannot be had again
        faults.append(f"{runs}: no run folder: {_told(error)}")
        return Saved(tuple(places), tuple(scores), tuple(faults))
    places.append(finished_path(folder))
    if kept and kept != out:
        places.remove(kept)
        kept.unlink(missing_ok=True)
    return Saved(tuple(places), tuple(scores), tuple(faults))


def _lasted(mapped: Mapped) -> dict[str, str]:
    """How long was mapped, for the report; nothing where it is not known."""
    if mapped.stamps_s is None:
        return {}
    return {"duration": duration_text(float(mapped.stamps_s[-1] - mapped.stamps_s[0]))}


def _saved_first(mapped: Mapped, out: Path | None, runs: Path, faults: list[str]) -> Path | None:
    """Where the map is now; what failed is added to faults."""

    def spare(folder: Path) -> Path:
        make_folder(folder)
        return mapped.grid.save(folder / f"{datetime.now():%Y%m%d-%H%M%S}-drive.sgrid")

    kept = _tried(lambda: mapped.grid.save(out), faults) if out is not None else None
    return kept or _tried(lambda: spare(runs), faults) or _tried(lambda: spare(Path(tempfile.gettempdir())), faults)


def _tried(save: Callable[[], Path], faults: list[str]) -> Path | None:
    try:
        return save()
    except Exception as error:  # as above
        faults.append(_told(error))
        return None


def _told(error: Exception) -> str:
    """In one line."""
    said = str(error) if isinstance(error, StereogridError | OSError) else f"{type(error).__name__}: {error}"
    return " ".join(said.split())
