"""What is at a path that a stranger's file or a command line names: a look at it is never an error."""

from collections.abc import Callable
from pathlib import Path


def is_there(path: Path) -> bool:
    """Whether something is seen there: not where a name is too long or a folder closed, for which Path's raise."""
    return _seen(path, Path.exists)


def is_file(path: Path) -> bool:
    """Whether a file is seen there."""
    return _seen(path, Path.is_file)


def is_directory(path: Path) -> bool:
    """Whether a folder is seen there."""
    return _seen(path, Path.is_dir)


def _seen(path: Path, look: Callable[[Path], bool]) -> bool:
    try:
        return look(path)
    except (OSError, ValueError):  # ValueError: a NUL in the name
        return False
