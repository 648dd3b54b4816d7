"""A recording is the same in another process with other threads, and whether its kernels were just compiled or not."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pybullet")
pytest.importorskip("embreex")

from sim.record import record_drive
from sim.rig import StereoRig
from stereogrid.camera import StereoCamera

ROOT = Path(__file__).parents[3]
ALONE = {f"{library}_NUM_THREADS": "1" for library in ("NUMBA", "OMP", "OPENBLAS", "MKL")}


def digest(path: Path, workers: int) -> str:
    """A hash of the file of a short drive with people, glass and the sun."""
    small = StereoRig(StereoCamera(104.0, 39.5, 29.5, 0.06, 80, 60))
    record_drive(path, world="entrance", people=2, rig=small, max_distance_m=0.6, workers=workers)
    return hashlib.sha256(path.read_bytes()).hexdigest()


def elsewhere(path: Path, cache: Path) -> str:
    """digest in another process with one thread, whose compiled kernels lie in a folder `cache`."""
    result = subprocess.run(
        [sys.executable, __file__, str(path)],
        cwd=ROOT,
        env={**os.environ, **ALONE, "PYTHONHASHSEED": "7", "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        timeout=600,
        check=True,
    )
    return result.stdout.split()[-1]


def test_other_processes_record_the_same_bytes_the_first_time_and_later(tmp_path: Path) -> None:
    # The first one compiles every kernel, the second finds them compiled.
    first, later = (elsewhere(tmp_path / f"{name}.mcap", tmp_path / "cache") for name in ("first", "later"))
    assert first == later == digest(tmp_path / "ours.mcap", workers=3)


if __name__ == "__main__":
    print(digest(Path(sys.argv[1]), workers=1))  # noqa: T201
