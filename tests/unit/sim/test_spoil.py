"""A spoilt drive holds what the experiments see when they read the drive with its faults."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet")
pytest.importorskip("embreex")

from sim.faults import FaultyCameras, camera_faults
from sim.record import record_drive
from sim.rig import StereoRig, mount, webcam
from sim.robot.wheel_faults import FaultyWheels, wheel_faults
from sim.spoil import spoil
from stereogrid.errors import StereogridError
from stereogrid.recording import McapRecording


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("spoil") / "drive.mcap"
    return record_drive(path, rig=StereoRig(webcam(160, 120), mount()), max_distance_m=0.8)


def test_a_spoilt_drive_is_the_drive_read_with_its_faults(drive: Path, tmp_path: Path) -> None:
    faults, clean = camera_faults("minoru"), McapRecording(drive)
    spoilt = McapRecording(spoil(drive, tmp_path / "b.mcap", cameras="minoru", wheels="worn", seed=3))
    expected = FaultyWheels(FaultyCameras(clean, faults, 3), wheel_faults("worn"), 3)
    assert len(spoilt) == len(expected)
    for a, b in zip(spoilt, expected, strict=True):
        assert np.array_equal(a.left, b.left) and np.array_equal(a.right, b.right)
        assert a.odometry.T_odom_base == pytest.approx(b.odometry.T_odom_base, abs=1e-9)
        assert a.truth is not None and b.truth is not None
        assert a.truth.T_world_cam == pytest.approx(b.truth.T_world_cam, abs=1e-9)
    assert spoilt.truth_mesh_ply() == clean.truth_mesh_ply()
    assert spoilt.metadata["camera_faults"] == "minoru" and spoilt.metadata["world"] == "corridor"


def test_what_cannot_be_spoilt_is_refused_and_leaves_no_file(drive: Path, tmp_path: Path) -> None:
    once = spoil(drive, tmp_path / "once.mcap", cameras="mild")
    before = sorted(tmp_path.iterdir())
    for wrong, options, message in (
        (once, {}, "has faults already"),
        (drive, {"cameras": "foggy"}, "choose from: bad, ideal, mild, minoru"),
        (drive, {"wheels": "square"}, "choose from: good, none, worn"),
        (drive, {"seed": -1}, "seed"),
    ):
        with pytest.raises(StereogridError, match=message):
            spoil(wrong, tmp_path / "out.mcap", **options)  # type: ignore[arg-type]
    with pytest.raises(StereogridError, match="exists already"):
        spoil(drive, once)
    assert sorted(tmp_path.iterdir()) == before
