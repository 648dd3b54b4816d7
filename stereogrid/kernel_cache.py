"""A place for compiled kernels where Numba would find none."""

import os
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
PREFIX = "stereogrid-kernels-"
"""Of the folder of a process that has no other place."""


def find_place() -> None:
    """Where the package's folder cannot be written, nor the user's cache, keep kernels for this process alone.

    Numba refuses to import them there: on a shared installation, say, without a home. The place is nobody else's, since
    what lies in it is executed.
    """
    if VARIABLE in os.environ or _can_be_written(_of_user()):
        return
    import atexit
    import shutil
    import tempfile

    place = tempfile.mkdtemp(prefix=PREFIX)
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    os.environ[VARIABLE] = place


def _of_user() -> Path:
    """Where Numba keeps a user's kernels."""
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))  # noqa: PTH111, there may be no home


def _can_be_written(folder: Path) -> bool:
    """Whether the folder, or the next one above it that there is, can be written."""
    near = next((each for each in (folder, *folder.parents) if each.exists()), None)
    return near is not None and os.access(near, os.W_OK)
