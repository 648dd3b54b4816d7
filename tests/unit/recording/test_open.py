"""The kind of a recording is found from its path."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import pytest
from kitti_drives import KittiDrive
from rgbd_folders import write_frames

from stereogrid.cli import app, run
from stereogrid.errors import RecordingError
from stereogrid.recording import KittiRecording, McapRecording, McapWriter, kind_of, open_recording


def test_the_kind_is_found(mcap_file: Path, kitti_folder: Path) -> None:
    assert isinstance(open_recording(str(mcap_file)), McapRecording)
    assert isinstance(open_recording(kitti_folder), KittiRecording)


def test_an_mcap_file_is_known_under_any_name(mcap_file: Path) -> None:
    assert len(open_recording(mcap_file.rename(mcap_file.with_suffix(".bin")))) == 5


def test_a_path_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"/nowhere: no such file or folder; choose from mcap: .*kitti: "):
        open_recording(tmp_path / "nowhere")


@pytest.mark.parametrize("name", ["folder", "notes.txt"])
def test_an_unknown_kind_is_named_with_the_choices(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(RecordingError, match=rf"{name}: no known kind of recording; choose from mcap: .*kitti: "):
        open_recording(tmp_path / name)


def test_both_ends_of_a_part_are_in_it_whatever_their_binary_digits(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    """1700000000.3 - 1700000000 is less than .3 in float64."""
    path = tmp_path / "a.mcap"
    with McapWriter(path, synthetic.camera, synthetic.T_base_cam) as writer:
        for k, each in enumerate(synthetic.observations(8)):
            writer.write(replace(each, stamp_s=1.7e9 + k / 10))
    for first in range(8):
        for last in range(first, 8):
            part = open_recording(path, start_s=first / 10, end_s=last / 10)
            assert len(part) == last - first + 1, (first, last)


def test_a_name_that_can_be_none_is_no_file(capsys: pytest.CaptureFixture[str]) -> None:
    for name in (5000 * "x", "a\0b"):
        with pytest.raises(RecordingError, match="no such file or folder"):
            open_recording(name)
    assert run(app, ["info", 5000 * "x"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: ") and said.count("\n") == 1 and len(said) < 400


@contextmanager
def as_nobody() -> Iterator[None]:
    """Where tests are run as root, who may read everything."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """One that everyone can get at, as pytest's own cannot."""
    with TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


def test_a_closed_folder_beside_a_recording_hides_nothing(open_folder: Path, synthetic: SimpleNamespace) -> None:
    write_frames(open_folder / "frames")
    (open_folder / "closed").mkdir(mode=0o000)
    with as_nobody():
        assert kind_of(open_folder) == "rgbd"
        assert len(open_recording(open_folder)) > 0
    KittiDrive(n=3).write(open_folder / "date")
    drive = next((open_folder / "date").glob("**/*_sync"))
    (drive.parent / "closed").mkdir(mode=0o000)
    with as_nobody():
        assert kind_of(drive.parent) == "kitti_raw"


def test_what_may_not_be_read_is_said(open_folder: Path, synthetic: SimpleNamespace) -> None:
    (open_folder / "closed").mkdir(mode=0o000)
    folder = synthetic.write_kitti(open_folder)
    (folder / "image_1").chmod(0o000)
    with as_nobody():
        with pytest.raises(RecordingError, match="closed: you may not read it; choose from"):
            open_recording(open_folder / "closed")
        with pytest.raises(RecordingError, match=r"cannot be read: .*image_1: Permission denied"):
            open_recording(folder)
    (folder / "image_1").chmod(0o755)


def test_a_folder_with_images_but_no_calibration_is_a_kitti_folder_without_one(kitti_folder: Path) -> None:
    (kitti_folder / "calib.txt").unlink()
    (kitti_folder / "image_0").rename(kitti_folder / "image_l")
    (kitti_folder / "image_1").rename(kitti_folder / "image_r")
    with pytest.raises(RecordingError, match=r"calib\.txt: no such file"):
        open_recording(kitti_folder)


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89MCAP0\r\n"])
def test_a_file_that_is_only_named_mcap_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(RecordingError, match=r"a\.mcap: not an MCAP file"):
        open_recording(tmp_path / "a.mcap")
