"""SHA-256 of what a run reads and of what it leaves, without anything that tells of the time or the place of a run."""

import csv
import hashlib
import io
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .errors import RecordingError

WHOLE_BYTES = 1 << 29
"""So much is read of a file or folder, at some 350 MB/s. Of more than that every n-th block only."""
BLOCK_BYTES = 1 << 16
RUN_NAME = "run.toml"
SECOND = "s"
"""The unit of scores that are times, which no run has twice."""


def digest_of(path: Path) -> str:
    """Of a file the SHA-256 that sha256sum gives; of a folder that of the lines `<its SHA-256>  <its name>`, sorted.

    Where it is larger than WHOLE_BYTES, of each file every n-th block of BLOCK_BYTES and its size stand for the whole.
    Links are followed; a folder that is reached in several ways counts once. Hidden files and run folders are no part
    of a folder. Raises RecordingError when it cannot be read.
    """
    try:
        files = {path.name: path} if path.is_file() else dict(_files(path))
        step = max(1, -(-sum(each.stat().st_size for each in files.values()) // WHOLE_BYTES))
        digests = {name: _file_digest(each, step) for name, each in files.items()}
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    if path.is_file():
        return digests[path.name]
    lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items()))
    return hashlib.sha256(lines.encode()).hexdigest()


def _files(folder: Path) -> Iterator[tuple[str, Path]]:
    seen = {os.path.realpath(folder)}
    for place, folders, names in os.walk(folder, onerror=_raise, followlinks=True):
        wanted = [each for each in sorted(folders) if not each.startswith(".")]
        folders.clear()
        for each in wanted:
            # A link may lead back to where it is, or to a folder that is read anyway.
            real = os.path.realpath(Path(place, each))
            if real not in seen and not Path(real, RUN_NAME).exists():
                seen.add(real)
                folders.append(each)
        for name in names:
            path = Path(place, name)
            if not name.startswith(".") and path.is_file():
                yield path.relative_to(folder).as_posix(), path


def _raise(error: OSError) -> None:
    raise error


def _file_digest(path: Path, step: int) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        if step > 1:
            digest.update(f"{path.stat().st_size} bytes, every {step}th block\n".encode())
        while block := file.read(BLOCK_BYTES):
            digest.update(block)
            if step > 1:
                file.seek((step - 1) * BLOCK_BYTES, os.SEEK_CUR)
    return digest.hexdigest()


def results_of(run: Path) -> dict[str, str]:
    """The SHA-256 of each result in a run folder: maps by their cells, numbers without times and facts, recordings."""
    from .grid import OccupancyGrid

    found = {path.name: OccupancyGrid.load(path).sha256() for path in run.glob("*.sgrid")}
    for path in run.glob("*.csv"):
        found[path.name] = _sha256(_without_times(path.read_text(encoding="utf-8")))
    for path in run.glob("metrics.json"):
        found[path.name] = _sha256(_numbers(json.loads(path.read_text(encoding="utf-8"))))
    for path in run.glob("*.mcap"):
        found[path.name] = digest_of(path)
    return dict(sorted(found.items()))


def _sha256(thing: object) -> str:
    return hashlib.sha256(json.dumps(thing, sort_keys=True).encode()).hexdigest()


def _without_times(text: str) -> list[list[str]]:
    """The rows of a CSV file but for those of scores in seconds."""
    rows = list(csv.reader(io.StringIO(text)))
    unit = rows[0].index("unit") if rows and "unit" in rows[0] else None
    return [row for row in rows if unit is None or unit >= len(row) or row[unit] != SECOND]


def _numbers(metrics: dict[str, Any]) -> dict[str, Any]:
    """metrics.json without facts (commands, places) and scores in seconds."""
    return {key: _timeless(value) for key, value in metrics.items() if key != "facts" and not isinstance(value, str)}


def _timeless(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    return {
        key: _timeless(each)
        for key, each in value.items()
        if not (isinstance(each, dict) and each.get("unit") == SECOND)
    }
