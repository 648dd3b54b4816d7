"""Sweeps on real dask workers: half a metre of one world, three settings of which one fails, two seeds."""

import csv
import errno
import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict
from pathlib import Path
from threading import Thread

import pytest

pytest.importorskip("pybullet", reason="sweeps drive through simulated worlds")
pytest.importorskip("distributed", reason="sweeps need the extra sweep")
pytest.importorskip("pyarrow", reason="sweeps need the extra sweep")

import psutil
from reports import stands_alone

from experiments import sweep as sweep_module
from experiments.__main__ import app
from experiments.sweep_unit import attempt
from stereogrid.cli import INTERRUPTED
from stereogrid.cli import run as run_command
from stereogrid.errors import RecordingError

SWEEP = """
worlds = ["corridor"]
seeds = [1, 2]
[base]
distance_m = 0.5
width_px = 96
height_px = 72
mapping.matcher.num_disparities = 48
[[together]]
mapping.grid.cell_m = [0.2, 0.4, 0.3]
mapping.grid.memory_limit_gb = [4.0, 4.0, 1.65e-5]
"""
N_UNITS = 6


def in_process(*arguments):
    return run_command(app, ["sweep", *map(str, arguments)])


def places(folder: Path):
    return folder / "sweep.toml", "--work", folder / "work", "--runs", folder / "runs"


def read(folder: Path):
    with (folder / "runs" / "latest" / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def kill_one_that_drives(killed: list[int]) -> None:
    """Kill the worker that holds the half-made drive, as the kernel would."""
    until = time.monotonic() + 120
    while time.monotonic() < until and not killed:
        for child in psutil.Process().children(recursive=True):
            if not killed and drives_now(child):
                os.kill(child.pid, signal.SIGKILL)
                killed.append(child.pid)
        time.sleep(0.05)


def drives_now(process: psutil.Process) -> bool:
    with suppress(psutil.Error):
        return any("/.half-" in each.path for each in process.open_files())
    return False


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A sweep on two workers, one of which was killed amid its work; the folder, and who was killed."""
    folder, killed = tmp_path_factory.mktemp("sweep"), []
    (folder / "sweep.toml").write_text(SWEEP)
    killer = Thread(target=kill_one_that_drives, args=(killed,), daemon=True)
    killer.start()
    assert in_process(*places(folder), "--workers", 2) == 0
    return folder, killed


@pytest.fixture
def by_hand(monkeypatch):
    """Maps made in this process, the last first; which, and before which it is interrupted."""
    seen, stop_at = [], []

    def made(_client, units, drives):
        for key, config in reversed(units.items()):
            if len(seen) in stop_at:
                raise KeyboardInterrupt
            seen.append(key)
            yield key, attempt(asdict(config), drives)

    monkeypatch.setattr(sweep_module, "opened", lambda *_: nullcontext())
    monkeypatch.setattr(sweep_module, "made", made)
    return seen, stop_at


@contextmanager
def running(command, folder):
    """A process of its own, which is ended."""
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(20)


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def test_a_worker_that_is_killed_costs_no_map_and_what_fails_is_listed(swept):
    folder, killed = swept
    assert len(killed) == 1 and not psutil.pid_exists(killed[0])
    rows = read(folder)
    status = {(row["mapping.grid.cell_m"], row["seed"]): row["status"] for row in rows}
    assert status == {
        (cell, seed): "failed" if cell == "0.3" else "ok" for cell in ("0.2", "0.4", "0.3") for seed in "12"
    }
    failed = [row for row in rows if row["status"] == "failed"]
    assert len(failed) == 2 and all("MapTooLargeError" in row["error"] and not row["score"] for row in failed)
    auc = [float(row["value"]) for row in rows if row["score"] == "auc"]
    assert len(auc) == 4 and all(0.5 < each <= 1 for each in auc) and len(set(auc)) == 4
    report = (folder / "runs" / "latest" / "report.html").read_text()
    assert "2 of them failed" in report and "MapTooLargeError" in report and 'src="data:image/png' in report
    assert stands_alone(report)
    drives = {path.name for path in (folder / "work" / "drives").iterdir() if not path.name.startswith(".lock")}
    assert len(drives) == 1 and not any(name.startswith(".") for name in drives)


def test_started_again_it_makes_nothing_twice_and_in_any_order_the_rows_are_the_same(swept, by_hand, tmp_path, capsys):
    (seen, stop_at), (folder, _) = by_hand, swept
    assert in_process(*places(folder)) == 0
    assert not seen  # not even what failed
    (tmp_path / "sweep.toml").write_text(SWEEP)
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "drives").symlink_to(folder / "work" / "drives")
    stop_at.append(4)
    assert in_process(*places(tmp_path)) == INTERRUPTED
    assert "4 of 6 maps are kept in" in capsys.readouterr().err and not (tmp_path / "runs" / "latest").exists()
    stop_at.clear()
    assert in_process(*places(tmp_path)) == 0
    assert len(seen) == len(set(seen)) == N_UNITS
    assert "failed: grid.cell_m, grid.memory_limit_gb = 0.3, 1.65e-05, corridor, seed 1: Map" in capsys.readouterr().err
    first, second = (each / "runs" / "latest" / "sweep.csv" for each in (folder, tmp_path))
    assert first.read_bytes() == second.read_bytes()
    assert in_process(*places(tmp_path), "--retry-failed") == 0
    assert len(seen) == N_UNITS + 2


def test_where_the_machine_is_at_fault_the_sweep_ends_and_nothing_is_kept_as_failed(
    by_hand, tmp_path, monkeypatch, capsys
):
    (tmp_path / "sweep.toml").write_text(SWEEP)
    full = OSError(errno.ENOSPC, "No space left on device")

    def refused(*_):
        raise RecordingError("drive.mcap: cannot be written") from full

    monkeypatch.setattr("experiments.sweep_unit.kept_drive", refused)
    assert in_process(*places(tmp_path)) == 1
    told = capsys.readouterr().err
    assert re.fullmatch(
        r"error: .*corridor, seed \d: RecordingError: drive\.mcap.*; 0 of 6 maps are kept in .*\n", told
    )
    assert not list((tmp_path / "work" / "failed").iterdir()) and not list((tmp_path / "runs").glob("*"))


@pytest.mark.slow
def test_a_cluster_of_a_scheduler_and_a_worker_elsewhere_gives_the_same(swept, tmp_path, capsys):
    """The worker has a folder of its own for the drives, and tells its scores over TCP."""
    folder, _ = swept
    address = f"tcp://127.0.0.1:{free_port()}"
    dask = [sys.executable, "-m", "dask"]
    scheduler = [*dask, "scheduler", "--host", address, "--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
    worker = [*dask, "worker", address, "--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard"]
    (tmp_path / "sweep.toml").write_text(SWEEP)
    with running(scheduler, tmp_path), running(worker, tmp_path):
        assert in_process(*places(tmp_path), "--scheduler", address) == 0
    first, second = (each / "runs" / "latest" / "sweep.csv" for each in (folder, tmp_path))
    assert first.read_bytes() == second.read_bytes()
