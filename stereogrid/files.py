"""Files written beside and renamed, so that a reader never sees half of one."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InvalidInputError


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """Yield a temporary path in path's folder; renamed to path on success, removed on failure.

    Raises InvalidInputError, naming path, when it cannot be written.
    """
    try:
        temporary = _claim_beside(path)
        try:
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be written ({error.strerror})") from error


@contextmanager
def folder_beside(path: Path) -> Iterator[Path]:
    """Yield a new hidden folder in path's folder; renamed to path on success, removed with all in it on failure.

    Raises InvalidInputError, naming path, when it is there already or cannot be written.
    """
    if path.exists():
        raise InvalidInputError(f"{path}: exists already; choose another path")
    if not path.parent.is_dir():
        raise InvalidInputError(f"{path.parent}: no such folder, so {path.name} cannot be written there")
    try:
        partial = Path(tempfile.mkdtemp(prefix=f".{path.name}-", suffix=".partial", dir=path.parent))
        try:
            yield partial
            partial.chmod(0o755)
            partial.rename(path)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be written ({error.strerror})") from error


def check_writable(path: Path) -> None:
    """Raise InvalidInputError now when a file could not be written to path after long work; leaves nothing."""
    if path.is_dir():
        raise InvalidInputError(f"{path}: is a folder, so no file can be written there")
    try:
        _claim_beside(path).unlink()
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be written ({error.strerror})") from error


def make_folder(path: Path) -> None:
    """Make a folder, and those it is in, unless it is there. Raises InvalidInputError when that cannot be."""
    if path.exists() and not path.is_dir():
        raise InvalidInputError(f"{path}: is no folder")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be made ({error.strerror})") from error


def _claim_beside(path: Path) -> Path:
    if not path.parent.is_dir():
        raise InvalidInputError(f"{path.parent}: no such folder, so {path.name} cannot be written there")
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    return Path(name)
