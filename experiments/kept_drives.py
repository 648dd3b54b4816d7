"""Simulated drives that are kept on disk: each is driven once, whoever needs it, however many need it at once."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from stereogrid.files import make_folder
from stereogrid.versions import package_version

from .drives import DriveConfig, record
from .kept import code_key, key_of
from .parallel import Stage

CODE = ("sim", "stereogrid/recording", "stereogrid/camera.py", "stereogrid/geometry.py", "stereogrid/observation.py")
PACKAGES = ("numpy", "pybullet")


def drive_key(drive: DriveConfig) -> str:
    """The key of what a recording of this drive follows from."""
    return key_of(code_key(CODE), {name: package_version(name) for name in PACKAGES}, drive)


def kept_drive(drive: DriveConfig, folder: Path, stage: Stage) -> Path:
    """The recording of a drive in folder, made unless it is there; of several processes one drives, the others wait."""
    make_folder(folder)
    path = folder / f"{drive.world}-{drive_key(drive)[:12]}.mcap"
    if not path.exists():
        with _locked(_lock_of(path)):
            if not path.exists():  # nor made while this process waited
                half = folder / f".half-{path.name}"
                half.unlink(missing_ok=True)  # what a killed process left
                record(drive, half, stage).replace(path)
    return path


def remove_halves(folder: Path) -> None:
    """What processes that were killed left of drives that nobody is making now."""
    for half in folder.glob(".half-*"):
        with suppress(BlockingIOError), _locked(_lock_of(folder / half.name.removeprefix(".half-")), wait=False):
            half.unlink(missing_ok=True)


def _lock_of(path: Path) -> Path:
    return path.with_name(f".lock-{path.stem}")


@contextmanager
def _locked(path: Path, *, wait: bool = True) -> Iterator[None]:
    """Within it no other process holds the lock; the system takes it from a process that dies.

    The file stays: who removed it could take it from under one that waits. Raises BlockingIOError where the lock is
    held and wait is False.
    """
    with path.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
