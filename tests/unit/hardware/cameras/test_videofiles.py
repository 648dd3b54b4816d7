"""Two video files as two cameras."""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from picture_servers import number, numbered

from hardware.cameras import open_cameras
from hardware.errors import CameraError

COUNT = 30
FPS = 20.0


def film(path: Path, side: int, count: int = COUNT, size_px: tuple[int, int] = (64, 48)) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), FPS, size_px)
    assert writer.isOpened()
    for k in range(count):
        writer.write(cv2.cvtColor(numbered(k, side, size_px), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


@pytest.fixture
def spec(tmp_path: Path) -> str:
    return f"{film(tmp_path / 'left.avi', 0)},{film(tmp_path / 'right.avi', 1)}"


def test_every_pair_of_the_files_comes_in_order_however_slow_its_reader_and_then_the_end(spec: str) -> None:
    with open_cameras(spec, at_pace=False) as cameras:
        mailbox = cameras.subscribe(most=2)
        pairs = []
        while (pair := mailbox.get(10.0)) is not None:
            pairs.append(pair)
            time.sleep(0.002)
        assert mailbox.closed and "at their end" in cameras.problem()
        assert cameras.counts.pairs == COUNT and mailbox.dropped == 0
    assert [number(pair.left) for pair in pairs] == [number(pair.right) for pair in pairs] == list(range(COUNT))
    assert all(pair.left.mean() < pair.right.mean() - 20 and pair.skew_s == 0 for pair in pairs)
    np.testing.assert_allclose(np.diff([pair.stamp_s for pair in pairs]), 1 / FPS, atol=1e-6)


def test_at_their_pace_they_take_as_long_as_they_say(spec: str) -> None:
    with open_cameras(spec) as cameras:
        assert cameras.size_px == (64, 48) and cameras.about["left"]["fps"] == FPS
        mailbox = cameras.subscribe(most=COUNT)
        start_s = time.monotonic()
        while (pair := mailbox.get(10.0)) is not None:
            assert pair.stamp_s <= time.monotonic() + 1e-3, "no pair comes before it is due"
            assert cameras.last_stamp_s() is not None
        assert time.monotonic() - start_s >= (COUNT - 2) / FPS


def test_the_shorter_file_ends_both(tmp_path: Path) -> None:
    spec = f"{film(tmp_path / 'l.avi', 0, 5)},{film(tmp_path / 'r.avi', 1, 9)}"
    with open_cameras(spec, at_pace=False, swap=True) as cameras:
        mailbox = cameras.subscribe()
        sides = []
        while (pair := mailbox.get(10.0)) is not None:
            sides.append(pair.left.mean() > pair.right.mean())
    assert sides == [True] * 5


def test_closing_early_ends_the_mailbox(spec: str) -> None:
    cameras = open_cameras(spec)
    mailbox = cameras.subscribe(most=1)
    assert mailbox.get(10.0) is not None
    cameras.close()
    cameras.close()
    mailbox.newest(0.0)
    assert mailbox.get(10.0) is None and cameras.subscribe().closed


def test_files_that_cannot_be_read_or_do_not_belong_together_are_refused(tmp_path: Path) -> None:
    left = film(tmp_path / "left.avi", 0)
    (tmp_path / "notes.mp4").write_text("no video")
    for other, said in (
        (tmp_path / "missing.avi", "there is no video file"),
        (tmp_path / "notes.mp4", "no video file that OpenCV can read"),
        (film(tmp_path / "wide.avi", 1, size_px=(80, 48)), "64x48 pixels.*80x48.*the same size"),
    ):
        with pytest.raises(CameraError, match=said):
            open_cameras(f"{left},{other}")
