"""Run folders: runs/<stamp>-<name>/ appears whole or not at all, and runs/latest points at the newest."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from .errors import InvalidInputError


@contextmanager
def run_folder(root: Path, name: str) -> Iterator[Path]:
    """Yield a hidden folder to fill; on success it becomes root/<stamp>-<name>, on failure it goes away.

    The final path is `finished_path` of the yielded one.
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{root}: results cannot be written there ({error.strerror})") from None
    final = _free_path(root, f"{datetime.now():%Y%m%d-%H%M%S}-{name}")
    partial = _partial_of(final)
    partial.mkdir()
    try:
        yield partial
        partial.rename(final)
        _point_latest(root / "latest", final)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def finished_path(partial: Path) -> Path:
    """Where a folder yielded by run_folder will stand once it is whole."""
    return partial.with_name(partial.name.removeprefix(".").removesuffix(".partial"))


def _free_path(root: Path, name: str) -> Path:
    """root/name, or root/name-2, ... when another run took it in the same second."""
    path, n = root / name, 1
    while path.exists() or _partial_of(path).exists():
        n += 1
        path = root / f"{name}-{n}"
    return path


def _partial_of(path: Path) -> Path:
    return path.with_name(f".{path.name}.partial")


def _point_latest(link: Path, target: Path) -> None:
    beside = link.with_name(f".latest-{os.getpid()}")
    beside.unlink(missing_ok=True)
    beside.symlink_to(target.name)
    beside.replace(link)
