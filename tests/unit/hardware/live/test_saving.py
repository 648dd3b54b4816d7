"""A map is kept, whatever becomes of its figures and its report; and whoever drove is told where."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from recorded_rig import CAMERA

from hardware.commands.drive import _tell
from hardware.errors import HardwareError
from hardware.live.saving import Saved, save_drive
from hardware.live.session import DriveResult
from stereogrid.config import MappingConfig
from stereogrid.grid import OccupancyGrid
from stereogrid.mapping_run import Mapped
from stereogrid.observation import Disparity, Observation, Odometry
from stereogrid.run_record import RunRecord

ROOT = Path(__file__).parents[4]
MAPPED = Mapped(
    OccupancyGrid.from_cells(0.1, [[10, 0, 0], [12, 3, 1]], [1.0, 2.0]),
    np.eye(4)[None],
    (
        Observation(0.0, *np.full((2, *CAMERA.shape), 99, np.uint8), Odometry(np.eye(4)), np.eye(4)),
        Disparity(*np.full((2, *CAMERA.shape), 3.0, np.float32)),
    ),
    1.0,
)
# What a defect in a figure looks like from here.
UNDRAWABLE = replace(MAPPED, sample=None)  # type: ignore[arg-type]


def saved(mapped: Mapped, runs: Path, out: Path | None = None) -> Saved:
    return save_drive(mapped, MappingConfig(), SimpleNamespace(camera=CAMERA), runs=runs, out=out, facts={})


def test_a_map_without_a_place_of_its_own_is_in_the_run_folder_alone(tmp_path: Path) -> None:
    result = saved(MAPPED, tmp_path / "runs")
    (folder,) = result.places
    assert result.faults == () and OccupancyGrid.load(folder / "map.sgrid").sha256() == MAPPED.grid.sha256()
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {folder.name, "latest"}
    record = RunRecord.load(folder)
    assert record.program == "hardware drive" and record.results["map.sgrid"] == MAPPED.grid.sha256()


@pytest.mark.parametrize("name", [None, "mine.sgrid", "no/such/folder/mine.sgrid"])
def test_a_figure_that_fails_in_any_way_costs_no_map(tmp_path: Path, name: str | None) -> None:
    result = saved(UNDRAWABLE, tmp_path / "runs", tmp_path / name if name else None)
    (kept,) = result.places
    assert kept == tmp_path / "mine.sgrid" if name == "mine.sgrid" else kept.match("runs/*-drive.sgrid")
    assert OccupancyGrid.load(kept).sha256() == MAPPED.grid.sha256()
    assert "no run folder: TypeError: " in result.faults[-1]
    assert len(result.faults) == 1 + (name is not None and "no/such" in name)


def test_a_disk_that_is_full_amid_the_report_costs_no_map(tmp_path: Path) -> None:
    script = (
        "import resource, sys; from pathlib import Path; from test_saving import MAPPED, saved\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1_000, 1_000))\n"
        "result = saved(MAPPED, Path(sys.argv[1])); print(*result.places, *result.faults, sep='\\n')"
    )
    helpers = [ROOT, ROOT / "tests" / "helpers", Path(__file__).parent]
    run = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, helpers))},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    place, fault = run.stdout.splitlines()
    assert OccupancyGrid.load(place).sha256() == MAPPED.grid.sha256()
    assert "File too large" in fault and [path.name for path in tmp_path.iterdir()] == [Path(place).name]


def test_where_the_map_is_kept_is_told_in_the_one_line_of_the_error(tmp_path: Path) -> None:
    result = saved(UNDRAWABLE, tmp_path / "runs")
    with pytest.raises(HardwareError) as caught:
        _tell(DriveResult("quit", result.faults, result))
    (place,) = result.places
    assert str(caught.value).endswith(f"; all up to there is kept in {place}") and "\n" not in str(caught.value)
