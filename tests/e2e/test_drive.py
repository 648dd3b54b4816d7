"""`python -m hardware drive` on a terminal, as a user drives it: to a map that scores, and with the cameras cut."""

import fcntl
import os
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulator needs pybullet (Python 3.10 or 3.11)")

from kinematic_body import TICK_S
from served_robot import ServedRobot

from arcos import Code
from hardware.__main__ import app
from sim.firmware.tcp import TcpLink
from sim.record import record_drive
from sim.rig import MINORU, StereoRig, mount, webcam
from stereogrid.cli import run
from stereogrid.config import MappingConfig, load_config
from stereogrid.grid import OccupancyGrid
from stereogrid.mapping_run import build_map
from stereogrid.recording import open_recording, poses
from stereogrid.scoring.truth import MapTruth

ROOT = Path(__file__).parents[2]
FAR_M = 2.0
WIDTH_PX, HEIGHT_PX = 320, 240
CHARACTERS = (30, 200)
LATE_S = 0.1
"""A machine that lets a thread wait so long beyond its turn is too busy to measure how fast others are."""


class Drive:
    """The command on a pseudo-terminal that a test types on and reads."""

    def __init__(self, *arguments: str) -> None:
        self._hand, terminal = os.openpty()
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", *CHARACTERS, 0, 0))
        self.screen = ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "hardware", "drive", *arguments],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm"},
            stdin=terminal,
            stdout=terminal,
            stderr=terminal,
            start_new_session=True,
        )
        os.close(terminal)

    def type(self, keys: str) -> None:
        os.write(self._hand, keys.encode())

    def look(self, for_s: float) -> bool:
        """Read what is shown for so long; False once the program has ended."""
        end_s = time.monotonic() + for_s
        while (rest_s := end_s - time.monotonic()) > 0:
            if select.select([self._hand], [], [], rest_s)[0]:
                try:
                    data = os.read(self._hand, 1 << 16)
                except OSError:
                    return False
                self.screen += data.decode(errors="replace")
        return True

    def until(self, text: str, within_s: float = 180.0, *, hold: str = "") -> None:
        """Until that is shown, while a key is held."""
        end_s = time.monotonic() + within_s
        while text not in self.screen:
            assert self.look(0.04) and time.monotonic() < end_s, self.screen[-2000:]
            self.type(hold)

    def arm(self) -> None:
        """Switch the motors on once that is allowed; a key that the machine was too busy for is pressed again."""
        self.until("ready")
        self.type("m")
        end_s = time.monotonic() + 60
        while "motors ON" not in self.screen:
            assert self.look(0.1) and time.monotonic() < end_s, self.screen[-2000:]
            if "press it again" in self.screen:
                self.screen = ""
                self.type("m")

    def hold(self, key: str, way_m: float, within_s: float = 180.0) -> None:
        """Hold a key until the robot's odometry tells of so much way."""
        end_s = time.monotonic() + within_s
        while self.driven_m() < way_m:
            self.type(key)
            assert self.look(0.04) and time.monotonic() < end_s, self.screen[-2000:]

    def driven_m(self) -> float:
        shown = re.findall(r"([\d.]+) m driven", self.screen[-4000:])
        return float(shown[-1]) if shown else 0.0

    def end(self) -> str:
        """Let it end; what it showed since it was told to."""
        shown = len(self.screen)
        while self.look(0.2):
            pass
        self.process.wait(60)
        return self.screen[shown:]


@contextmanager
def driving(*arguments: str) -> Iterator[Drive]:
    drive = Drive(*arguments)
    try:
        yield drive
    finally:
        drive.process.kill()
        drive.process.wait()


@contextmanager
def program(*arguments: str, lines: int) -> Iterator[tuple["subprocess.Popen[str]", list[str]]]:
    """Another process of ours, once it has printed so many lines."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests/helpers")])}
    process = subprocess.Popen(
        [sys.executable, *arguments], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        said = [process.stdout.readline().strip() for _ in range(lines)]
        assert all(said)
        yield process, said
    finally:
        process.kill()
        process.wait()


def test_a_drive_by_keys_makes_a_map_as_good_as_the_simulators_own_of_the_same_way(tmp_path: Path) -> None:
    firmware = ("-m", "sim", "firmware", "corridor", "--port", "0", "--camera", "--camera-port", "0")
    with program(*firmware, lines=2) as (_, said):
        cameras = said[0].removeprefix("cameras: ").split("left.mjpg")[0]
        robot = f"tcp:{said[1].rsplit(' ', 1)[1]}"
        places = ("--runs", str(tmp_path / "runs"), "--out", str(tmp_path / "live.sgrid"))
        record = ("--record", str(tmp_path / "live.mcap"))
        with driving("--robot", robot, "--camera", cameras, *places, *record) as drive:
            drive.arm()
            drive.hold("w", FAR_M)
            drive.type("q")
            told = drive.end()
            assert drive.process.returncode == 0, drive.screen[-2000:]
            assert "known_cells" in told and str(tmp_path / "live.sgrid") in told

    live = OccupancyGrid.load(tmp_path / "live.sgrid")
    (folder,) = (path for path in (tmp_path / "runs").iterdir() if path.name.endswith("-drive"))
    config = load_config(MappingConfig, folder / "config.toml")
    rig = StereoRig(webcam(WIDTH_PX, HEIGHT_PX), mount(baseline_m=MINORU.baseline_m))
    own_drive = open_recording(
        record_drive(tmp_path / "own.mcap", world="corridor", rig=rig, max_distance_m=FAR_M + 0.1)
    )
    assert config == MappingConfig.for_camera(own_drive.camera)
    truth = MapTruth.of_recording(own_drive, live.cell_m, max_range_m=config.model.max_range_m, around_path=True)
    scores = [
        {score.name: score.value for score in truth.score(grid, surface=False)}
        for grid in (live, build_map(own_drive, config).grid)
    ]
    for name in ("auc", "auc_all", "occupied_f1", "occupied_f1_all", "coverage_occupied"):
        assert scores[0][name] >= 0.9 * scores[1][name], (name, scores)
    for name in ("log_loss", "brier"):
        assert scores[0][name] <= 1.1 * scores[1][name], (name, scores)
    # What was recorded meanwhile is the same drive.
    recorded = open_recording(tmp_path / "live.mcap")
    assert recorded.camera == own_drive.camera and len(recorded) > 10
    # Its last pair comes before the last report, a tenth of a second after the one before; the status line rounds.
    assert FAR_M - 0.15 < np.ptp(poses(recorded)[:, 0, 3]) < FAR_M + 0.5


@dataclass(frozen=True)
class Stop:
    """From the cut of a camera [s]: told_s: until the first order to stand reached the robot's firmware; stood_s: until
    the robot stood, the way from the order on by its own clock, which a busy machine slows down; late_s: the longest
    that the machine let the robot's thread wait beyond its turn meanwhile."""

    told_s: float
    stood_s: float
    late_s: float

    def __str__(self) -> str:
        load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
        return (
            f"told to stand after {self.told_s:.2f} s, stood after {self.stood_s:.2f} s; "
            f"meanwhile this machine was up to {self.late_s:.2f} s late, {load}"
        )


def cut(server: "subprocess.Popen[str]", drive: Drive, robot: ServedRobot) -> Stop:
    """Cut the cameras of a robot that drives, with the key held on, until it stands."""
    drive.screen = ""
    # No goodbye, no closed connection: the pictures just end.
    server.send_signal(signal.SIGSTOP)
    cut_s = time.monotonic()
    drive.until("nothing moves without pictures", hold="w")
    end_s = time.monotonic() + 10
    while any(speed > 0 for _, speed in robot.ticks[-10:]):
        assert time.monotonic() < end_s, "it does not stop"
        drive.type("w")
        drive.look(0.04)
    orders = [(each.stamp_s - cut_s, each.command) for each in robot.heard if each.stamp_s > cut_s]
    told_s = next(s for s, order in orders if (order.code, order.argument) in ((Code.VEL, 0), (Code.STOP, None)))
    ticks = [(s - cut_s, speed) for s, speed in list(robot.ticks) if s > cut_s]
    last = max(n for n, (_, speed) in enumerate(ticks) if speed > 0)
    moving = sum(s > told_s for s, _ in ticks[: last + 1])
    gaps_s = np.diff([0.0, *(s for s, _ in ticks[: last + 2])])
    return Stop(told_s, told_s + moving * TICK_S, float(gaps_s.max()) - TICK_S)


def test_a_cut_camera_stops_the_robot_within_a_second_wherever_it_is_cut(tmp_path: Path) -> None:
    pictures = str(ROOT / "tests/helpers/live_rig.py")
    with ServedRobot(TcpLink(0)) as robot, program(pictures, lines=1) as (server, said):
        config = tmp_path / "coarse.toml"
        config.write_text("[grid]\ncell_m = 0.1\n[matcher]\nnum_disparities = 32\n[model]\nmax_range_m = 2.5\n")
        options = ("--runs", str(tmp_path / "runs"), "--config", str(config))
        with driving("--robot", f"tcp:{robot.link.name}", "--camera", said[0], *options) as drive:
            drive.arm()
            drive.hold("w", 0.3)
            stops = [cut(server, drive, robot)]
            server.send_signal(signal.SIGCONT)
            drive.hold("w", drive.driven_m() + 0.1)
            if stops[0].stood_s > 1.0 and stops[0].late_s > LATE_S:
                # That may have been the machine, which is asked once more; a robot that is late by itself is not.
                stops.append(cut(server, drive, robot))
                server.send_signal(signal.SIGCONT)
            assert stops[-1].stood_s <= 1.0, "; then ".join(map(str, stops))
            drive.process.send_signal(signal.SIGINT)
            drive.end()
            assert drive.process.returncode == 0, drive.screen[-2000:]
        said_to_robot = [each for each in robot.commands() if each[0] != Code.PULSE]
        assert said_to_robot[-2:] == [(Code.ENABLE, 0), (Code.CLOSE, None)]
        assert list((tmp_path / "runs").glob("*-drive/map.sgrid"))
    with suppress(ProcessLookupError):
        server.kill()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--robot", "tcp:127.0.0.1:1", "--camera", "minoru"), "standard input is not"),
        (("--robot", "tcp:127.0.0.1:1", "--camera", "minoru", "--no-teleop"), "127.0.0.1:1"),
        (("--robot", "x", "--camera", "minoru", "--no-teleop", "--speed", "nan"), "--speed must be more than 0"),
        (
            ("--robot", "x", "--camera", "minoru", "--no-teleop", "--turn", "200"),
            "--turn must be more than 0",
        ),
        (
            ("--robot", "x", "--camera", "minoru", "--no-teleop", "--runs", "/dev/null/runs"),
            "results cannot be written there",
        ),
        (("--robot", "x", "--camera", "minoru", "--no-teleop", "--record", "drive.txt"), "must end with .mcap"),
        (("--robot", "x", "--camera", "minoru", "--no-teleop", "--patience", "0"), "--patience must be 2 s or more"),
        (("--robot", "x", "--camera", "minoru", "--no-teleop", "--size", "big"), "--size must be WIDTHxHEIGHT"),
        (("--robot", "x", "--camera", "minoru", "--no-teleop", "--out", "/no/such/map.sgrid"), "no such folder"),
        (("--robot", "x", "--camera", "minoru", "--no-teleop", "--calibration", "/no.toml"), "cannot be read"),
    ],
)
def test_bad_input_is_one_line_that_says_what(
    arguments: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    read, write = os.pipe()
    with os.fdopen(read) as no_terminal:
        monkeypatch.setattr("sys.stdin", no_terminal)
        assert run(app, ["drive", *arguments]) == 1
    os.close(write)
    errors = capsys.readouterr().err
    assert errors.startswith("error: ") and message in errors and errors.count("\n") == 1
