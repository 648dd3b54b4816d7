"""A recording is the same in another process with other threads."""

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


def test_another_process_with_other_threads_records_the_same_bytes(tmp_path: Path) -> None:
    command = [sys.executable, __file__, str(tmp_path / "theirs.mcap")]
    with subprocess.Popen(
        command, cwd=ROOT, env={**os.environ, **ALONE, "PYTHONHASHSEED": "7"}, stdout=subprocess.PIPE, text=True
    ) as process:
        ours = digest(tmp_path / "ours.mcap", workers=3)
        theirs, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    assert theirs.split()[-1] == ours


if __name__ == "__main__":
    print(digest(Path(sys.argv[1]), workers=1))  # noqa: T201
