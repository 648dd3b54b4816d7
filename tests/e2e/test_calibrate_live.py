"""`python -m hardware calibrate --camera`: somebody with a board before two network cameras, a page in a browser."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.request import urlopen

import cv2
import numpy as np
import pytest
from held_boards import BASELINE_M, BOARD, FOCAL_PX, pictures, pose_in_view

from stereogrid.calibration import load_calibration
from stereogrid.geometry import FloatArray
from stereogrid.mjpeg import MjpegServer, jpeg

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PATIENCE_S = 60.0
POSES = [
    pose_in_view((0.5, 0.5), 0.55, (25, 0)),
    pose_in_view((0.4, 0.35), 0.4, (-30, 10)),
    pose_in_view((0.65, 0.6), 0.45, (0, 30)),
    pose_in_view((0.6, 0.35), 0.45, (10, -30)),
    pose_in_view((0.45, 0.65), 0.45, (25, 20)),
    pose_in_view((0.5, 0.45), 0.6, (-25, -20)),
]
BOARD_WORDS = ("--columns", "9", "--rows", "6", "--square", "0.03")


class Person:
    """Holds a board before two cameras, which send 15 pairs a second."""

    def __init__(self) -> None:
        self.hold(None)
        self.server = MjpegServer(0, {})
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def hold(self, T_left_board: FloatArray | None) -> None:
        left, right = pictures(T_left_board)
        self._shown = jpeg(left), jpeg(right)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.server.close()

    def _run(self) -> None:
        while not self._stop.wait(1 / 15):
            self.server.publish(*self._shown, time.monotonic())


@pytest.fixture
def person() -> Iterator[Person]:
    each = Person()
    yield each
    each.close()


class Program:
    """The command in a process; its lines as they come."""

    def __init__(self, person: Person, out: Path) -> None:
        words = ["-m", "hardware", "calibrate", "--camera", person.server.url, "--out", str(out), *BOARD_WORDS]
        self.process = subprocess.Popen(
            [sys.executable, "-u", *words],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env=os.environ | {"COLUMNS": "200"}, cwd=Path(__file__).parents[2],
        )  # fmt: skip
        self.lines: list[str] = []
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    @property
    def said(self) -> str:
        return "\n".join(self.lines)

    def url(self) -> str:
        until(lambda: "open http" in self.said, self)
        found = re.search(r"http://\S+", self.said)
        assert found
        return found[0]

    def end(self) -> int:
        code = self.process.wait(PATIENCE_S)
        self._thread.join()
        return code

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.lines.extend(line.rstrip() for line in self.process.stdout)


@pytest.fixture
def start(person: Person) -> Iterator[Callable[[Path], Program]]:
    started: list[Program] = []

    def begin(out: Path) -> Program:
        started.append(Program(person, out))
        return started[-1]

    yield begin
    for each in started:
        each.process.kill()
        each.process.wait()


def until(true: Callable[[], bool], program: Program) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline_s, program.said
        assert program.process.poll() is None or true(), program.said
        time.sleep(0.02)


def status(url: str) -> dict[str, object]:
    with urlopen(f"{url}status.json", timeout=20) as answer:
        return dict(json.load(answer))


def screenshot(url: str, folder: Path) -> np.ndarray:
    path = folder / "page.png"
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        f"--user-data-dir={folder / 'browser'}", "--window-size=1200,900", "--virtual-time-budget=3000",
        f"--screenshot={path}", url,
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE_S)
    return cv2.imread(str(path))


def share_of(picture: np.ndarray, rgb: tuple[int, int, int]) -> float:
    """Of the pixels, those of about this colour."""
    return float((np.abs(picture.astype(int) - rgb[::-1]).max(axis=-1) < 25).mean())


def test_a_person_with_a_board_and_a_page_gets_a_calibration(
    person: Person, start: Callable[[Path], Program], tmp_path: Path
) -> None:
    program = start(tmp_path / "rig.toml")
    url = program.url()
    page = None
    for n, T in enumerate(POSES, start=1):
        person.hold(T)
        until(lambda n=n: f"pair {n} taken" in program.said, program)  # type: ignore[misc]
        if n == 2:
            told = status(url)
            assert told["count"] == 2 and "Move the board to" in str(told["hint"])
            page = screenshot(url, tmp_path) if CHROMIUM else None
    assert program.process.stdin is not None
    program.process.stdin.write("\n")
    program.process.stdin.flush()
    assert program.end() == 0, program.said
    found = load_calibration(tmp_path / "rig.toml")
    assert found.calibration.n_pairs == len(POSES)
    # So few pairs tell roughly.
    assert found.calibration.K[0][0, 0] == pytest.approx(FOCAL_PX, rel=0.02)
    assert found.calibration.baseline_m == pytest.approx(BASELINE_M, rel=0.02)
    assert found.board == BOARD and found.cameras.source == person.server.url
    assert found.cameras.left == f"{person.server.url}left.mjpg"
    assert (tmp_path / "rig-report" / "report.html").stat().st_size > 100_000
    if page is None:
        pytest.skip("the page was not looked at: no Chromium")
    assert share_of(page, (46, 158, 46)) > 0.005  # goals that are met
    for half in np.array_split(page[:700], 2, axis=1):
        assert share_of(half, (120, 120, 120)) > 0.2  # the wall behind the board
        assert share_of(half, (240, 140, 30)) > 0.001  # where the board goes next


def test_an_interrupt_keeps_the_pairs_and_leaves_no_calibration(
    person: Person, start: Callable[[Path], Program], tmp_path: Path
) -> None:
    program = start(tmp_path / "rig.toml")
    person.hold(POSES[0])
    until(lambda: "pair 1 taken" in program.said, program)
    program.process.send_signal(signal.SIGINT)
    assert program.end() == 130, program.said
    assert "1 pair is kept in" in program.said and "python -m hardware calibrate " in program.said
    assert not (tmp_path / "rig.toml").exists() and "Traceback" not in program.said
    (folder,) = (tmp_path / "rig-report").iterdir()
    assert sorted(path.name for path in folder.iterdir()) == ["left01.png", "right01.png"]
