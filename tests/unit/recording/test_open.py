"""The kind of a recording is found from its path."""

from pathlib import Path

import pytest

from stereogrid.errors import RecordingError
from stereogrid.recording import KittiRecording, McapRecording, open_recording


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
