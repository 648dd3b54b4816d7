"""A live session on videos of a person with a board: good pairs become files, the page's buttons work."""

import errno
import json
import os
import pty
import sys
from collections.abc import Sequence
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
from held_boards import BASELINE_M, BOARD, FOCAL_PX, SIZE_PX, followed_poses, pictures, pose

from hardware.calibrating.enter_key import EnterKey
from hardware.calibrating.from_cameras import calibrate_live
from hardware.calibrating.live_session import LiveSession
from hardware.calibrating.outcome import Outcome
from hardware.cameras import open_cameras
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray
from stereogrid.screen import track

FPS = 10
HELD = 6
"""Pictures of each pose: .5 s between the first and the last."""


def filmed(folder: Path, poses: Sequence[FloatArray | None]) -> str:
    """The cameras to open: two video files of a board held in each pose in turn."""
    paths = [folder / f"{side}.avi" for side in ("left", "right")]
    writers = [cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), FPS, SIZE_PX) for path in paths]
    for T in poses:
        for writer, image in zip(writers, pictures(T), strict=True):
            for _ in range(HELD):
                writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    for writer in writers:
        writer.release()
    return ",".join(map(str, paths))


def never() -> bool:
    return False


def asked(url: str, path: str, method: str = "GET") -> bytes:
    address = urlsplit(url).netloc
    connection = HTTPConnection(address, timeout=20)
    connection.request(method, path, headers={"Origin": f"http://{address}"} if method == "POST" else {})
    body = connection.getresponse().read()
    connection.close()
    return body


def test_who_does_as_the_page_says_gets_a_calibration(tmp_path: Path) -> None:
    pairs, told, outcomes = tmp_path / "pairs", [], []
    pairs.mkdir()

    def conclude(outcome: Outcome) -> str:
        outcomes.append(outcome)
        return "well done"

    spec = filmed(tmp_path, [None, *followed_poses(2)])
    with open_cameras(spec, at_pace=False) as cameras:
        calibrate_live(
            cameras, BOARD, pairs, conclude, source=spec, swap=False, drop_far=False, port=0, track=track,
            say=told.append,
        )  # fmt: skip
    (outcome,) = outcomes
    assert "http://127.0.0.1:" in told[0] and told[-1] == f"{outcome.calibration.n_pairs} pairs are kept in {pairs}"
    assert sorted(path.name for path in pairs.iterdir()) == sorted(
        f"{side}{n:02d}.png" for side in ("left", "right") for n in range(1, outcome.calibration.n_pairs + 1)
    )
    assert outcome.calibration.K[0][0, 0] == pytest.approx(FOCAL_PX, rel=0.005)
    assert outcome.calibration.baseline_m == pytest.approx(BASELINE_M, rel=0.01)
    assert (outcome.cameras.source, outcome.cameras.left) == (spec, str(tmp_path / "left.avi"))


def test_the_pages_buttons_forget_a_pair_and_finish(tmp_path: Path) -> None:
    told: list[str] = []
    left_after_it: list[int] = []
    poses = [pose((x, 0.5), 0.35) for x in np.linspace(0.4, 0.7, 6)]
    with (
        open_cameras(filmed(tmp_path, poses), at_pace=False) as cameras,
        LiveSession(cameras, BOARD, tmp_path, say=told.append) as live,
    ):

        def person() -> bool:
            # Is asked between two pairs; presses each button once.
            if len(live.session.taken) == 2 and not any("forgotten" in line for line in told):
                asked(live.url, "/forget", "POST")
            if any("forgotten" in line for line in told) and len(live.session.taken) == 1:
                left_after_it.append(len(list(tmp_path.glob("*02.png"))))
            if len(live.session.taken) == 3:
                asked(live.url, "/finish", "POST")
            return False

        assert b"/status.json" in asked(live.url, "/")
        ending = live.run(never, person)
        status = json.loads(asked(live.url, "/status.json"))
    assert (ending.n, ending.why) == (3, "asked")
    assert sum("forgotten: 1 are left" in line for line in told) == 1
    assert sorted(path.name for path in tmp_path.glob("left*.png")) == ["left01.png", "left02.png", "left03.png"]
    assert left_after_it and not any(left_after_it)
    # The second is not the one that was forgotten.
    first_ever, kept = pictures(poses[1])[0], cv2.imread(str(tmp_path / "left02.png"), cv2.IMREAD_GRAYSCALE)
    assert np.abs(first_ever.astype(int) - kept).mean() > 3
    assert status["count"] == 3 and status["over"] and status["folder"] == str(tmp_path)
    assert {"name": "pairs", "have": 3, "need": 15} in status["goals"]


def test_cameras_that_end_too_early_leave_their_pairs_and_the_reason(tmp_path: Path) -> None:
    pairs = tmp_path / "pairs"
    pairs.mkdir()
    told: list[str] = []
    spec = filmed(tmp_path, [pose((0.5, 0.5), 0.4), None, pose((0.6, 0.4), 0.5)])
    with open_cameras(spec, at_pace=False) as cameras, pytest.raises(InvalidInputError, match="only 2 of 2 pairs"):
        calibrate_live(
            cameras, BOARD, pairs, lambda _: "", source=spec, swap=False, drop_far=False, port=0, track=track,
            say=told.append,
        )  # fmt: skip
    assert len(list(pairs.iterdir())) == 4 and "are at their end" in told[-1]


def test_a_disk_that_is_full_leaves_the_pairs_before_and_tells_where_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pairs, told, written = tmp_path / "pairs", [], []
    pairs.mkdir()
    write = Path.write_bytes

    def write_while_there_is_room(path: Path, data: bytes) -> int:
        written.append(path)
        # The right picture of the third pair.
        if len(written) == 6:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", write_while_there_is_room)
    spec = filmed(tmp_path, followed_poses(2)[:6])
    with open_cameras(spec, at_pace=False) as cameras, pytest.raises(InvalidInputError, match="No space left"):
        calibrate_live(
            cameras, BOARD, pairs, lambda _: "", source=spec, swap=False, drop_far=False, port=0, track=track,
            say=told.append,
        )  # fmt: skip
    assert told[-1] == f"2 pairs are kept in {pairs}"
    assert sorted(path.name for path in pairs.iterdir()) == ["left01.png", "left02.png", "right01.png", "right02.png"]


def test_cameras_that_never_see_a_board_leave_no_folder(tmp_path: Path) -> None:
    pairs = tmp_path / "pairs"
    pairs.mkdir()
    spec = filmed(tmp_path, [None])
    with open_cameras(spec, at_pace=False) as cameras, pytest.raises(InvalidInputError, match="no pair was taken"):
        calibrate_live(
            cameras, BOARD, pairs, lambda _: "", source=spec, swap=False, drop_far=False, port=0, track=track,
            say=lambda _: None,
        )  # fmt: skip
    assert not pairs.exists()


def test_enter_is_seen_once_and_a_closed_input_is_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        # This test's terminal is no one's foreground.
        monkeypatch.setattr(EnterKey, "_in_background", staticmethod(lambda _: False))
        key = EnterKey()
        assert not key.pressed()
        os.write(ours, b"\n")
        for _ in range(200):
            if key.pressed():
                break
        else:
            pytest.fail("Enter was not seen")
        assert not key.pressed()
    os.close(ours)
    read, write = os.pipe()
    os.close(write)
    with os.fdopen(read) as closed:
        monkeypatch.setattr(sys, "stdin", closed)
        key = EnterKey()
        assert not key.pressed() and not key.pressed()
    monkeypatch.setattr(sys, "stdin", None)
    assert not EnterKey().pressed()
