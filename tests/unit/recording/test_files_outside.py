"""What a recording is read from that does not lie in its folder is known, and a run of it remembers that too."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from kitti_drives import KittiDrive
from rgbd_folders import write_tum

from stereogrid.commands.repeat import _with_inputs
from stereogrid.config import MappingConfig, MatcherConfig
from stereogrid.errors import RecordingError
from stereogrid.mapping_run import map_recording
from stereogrid.recording import open_recording
from stereogrid.run_record import RunRecord


def benchmark(root: Path, synthetic: SimpleNamespace) -> tuple[Path, Path]:
    """A sequence as KITTI lays it out, and its poses."""
    folder = synthetic.write_kitti(root / "sequences" / "06")
    (root / "poses").mkdir()
    return folder, (folder / "poses.txt").rename(root / "poses" / "06.txt")


def test_the_poses_of_a_kitti_sequence(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    folder, poses = benchmark(tmp_path, synthetic)
    assert open_recording(folder).files_outside == open_recording(folder, stride=2).files_outside == (poses,)
    poses.rename(folder / "poses.txt")
    assert open_recording(folder).files_outside == ()


def test_the_calibration_of_a_kitti_raw_drive(tmp_path: Path) -> None:
    drive = KittiDrive().write(tmp_path)
    names = {each.name for each in open_recording(drive).files_outside}
    assert names == {"calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt"}
    # The folder of a camera means the drive that it is of.
    assert drive.resolve() in [each.resolve() for each in open_recording(drive / "image_00").files_outside]


def test_the_intrinsics_of_an_rgbd_folder(tmp_path: Path) -> None:
    folder = write_tum(tmp_path / "desk")
    assert open_recording(folder).files_outside == ()
    lens = next(each for each in folder.iterdir() if each.name in ("calibration.txt", "camera-intrinsics.txt"))
    lens = lens.rename(tmp_path / lens.name)
    assert open_recording(folder).files_outside == (lens,)
    assert open_recording(folder / "rgb").files_outside == (folder, lens)


def test_a_run_is_not_repeated_where_such_a_file_was_changed(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    folder, poses = benchmark(tmp_path, synthetic)
    config = MappingConfig(MatcherConfig("bm", 16))
    record = RunRecord.of("map", "", folder)
    run = map_recording(open_recording(folder), config, name="a", runs=tmp_path / "runs", record=record).folder
    was = RunRecord.load(run)
    assert [(each.kind, each.path) for each in was.inputs] == [("outside", str(poses))]
    assert _with_inputs(was, run, None, False) == was
    poses.write_text(poses.read_text() + "\n")
    with pytest.raises(RecordingError, match=r"06\.txt: is not what the run read: .*put it back"):
        _with_inputs(was, run, None, False)
