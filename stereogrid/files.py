"""Files written beside and renamed, so that a reader never sees half of one."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InvalidInputError


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """Yield a temporary path in path's folder; renamed to path on success, removed on failure."""
    if not path.parent.is_dir():
        raise InvalidInputError(f"{path.parent}: no such folder, so {path.name} cannot be written there")
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
