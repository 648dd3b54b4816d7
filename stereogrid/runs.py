"""Run folders: runs/<stamp>-<name>/ appears whole or not at all, and runs/latest points at the newest."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from .errors import InvalidInputError

STAMP = "%Y%m%d-%H%M%S"
"""How a run folder's name begins."""


@contextmanager
def run_folder(root: Path, name: str) -> Iterator[Path]:
    """Yield a hidden folder to fill; on success it becomes root/<stamp>-<name>, on failure it goes away.

    The final path is `finished_path` of the yielded one.
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
        partial = _claim(root, f"{datetime.now():{STAMP}}-{name}")
    except OSError as error:
        raise InvalidInputError(f"{root}: results cannot be written there ({error.strerror})") from None
    final = finished_path(partial)
    try:
        yield partial
        partial.rename(final)
    except BaseException:
        # Only then: once renamed, a folder of that name is another run's.
        shutil.rmtree(partial, ignore_errors=True)
        raise
    _point_latest(root / "latest", final)


def check_runs(root: Path) -> None:
    """Raise InvalidInputError now when no run folder could be made in root after long work; leaves at most root."""
    try:
        root.mkdir(parents=True, exist_ok=True)
        _claim(root, "check").rmdir()
    except OSError as error:
        raise InvalidInputError(f"{root}: results cannot be written there ({error.strerror})") from None


def finished_path(partial: Path) -> Path:
    """Where a folder yielded by run_folder will stand once it is whole."""
    return partial.with_name(partial.name.removeprefix(".").removesuffix(".partial"))


def begun(folder: Path) -> datetime | None:
    """When the run of this folder began, by its name; None for a folder that run_folder did not make."""
    try:
        return datetime.strptime(finished_path(folder).name[:15], STAMP)
    except ValueError:
        return None


def _claim(root: Path, name: str) -> Path:
    """A new hidden folder for root/name, or for root/name-2, ... when another run took that in the same second."""
    n = 0
    while True:
        n += 1
        final = root / (name if n == 1 else f"{name}-{n}")
        partial = final.with_name(f".{final.name}.partial")
        try:
            # Making the folder is the claim: of two runs at once only one succeeds.
            partial.mkdir()
        except FileExistsError:
            continue
        if not final.exists():
            return partial
        partial.rmdir()


def _point_latest(link: Path, target: Path) -> None:
    beside = link.with_name(f".latest-{target.name}")
    beside.symlink_to(target.name)
    beside.replace(link)
