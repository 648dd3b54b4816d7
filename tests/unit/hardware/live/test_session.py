"""Whole drives in this process, ended in every way there is: the robot first, then the map, the recording, and why."""

import json
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pybullet", reason="the simulated firmware needs pybullet (Python 3.10 or 3.11)")

from live_rig import Hand, Pictures
from recorded_rig import RIG
from served_robot import ServedRobot

from arcos import Code
from hardware.cameras import open_cameras
from hardware.live.helm import Speeds
from hardware.live.keyboard import Keyboard
from hardware.live.notes import Notes
from hardware.live.session import DriveParts, DriveResult, DriveSession
from hardware.pioneer import connect
from hardware.pioneer.driver import Pioneer
from hardware.recording import DriveRecorder, RawRecorder
from sim.firmware.tcp import TcpLink
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig
from stereogrid.grid import OccupancyGrid
from stereogrid.recording import open_recording
from stereogrid.sensor_model import SensorModel

CONFIG = MappingConfig(
    matcher=MatcherConfig(num_disparities=32), model=SensorModel(max_range_m=2.5), grid=GridConfig(cell_m=0.1)
)
FAREWELL = [(Code.ENABLE, 0), (Code.CLOSE, None)]


class Driven:
    """A drive under way in the main thread, while `then` runs in another."""

    def __init__(self, folder: Path, things: ExitStack, connected: Callable[[str], Any] = Pioneer) -> None:
        self.folder = folder
        self.robot = things.enter_context(ServedRobot(TcpLink(0)))
        self.pictures = things.enter_context(Pictures())
        self.hand = things.enter_context(Hand())
        self.driver = things.enter_context(connected(self.robot.link.name))
        self.cameras = things.enter_context(open_cameras(self.pictures.url))
        self.keys = things.enter_context(Keyboard(self.hand.terminal))
        raw = RawRecorder(folder / "drive.mcap", RIG)
        self.recorder = things.enter_context(DriveRecorder(raw, self.cameras, self.driver))
        self.error: BaseException | None = None

    def run(
        self, then: Callable[["Driven"], object], config: MappingConfig = CONFIG, patience_s: float = 10.0
    ) -> DriveResult:
        parts = DriveParts(self.cameras, RIG, self.driver, Notes(), self.keys, self.recorder)
        self.session = DriveSession(parts, config, Speeds(0.25, math.radians(20)), patience_s=patience_s)

        def act() -> None:
            try:
                self.until(lambda: self.session.mapper.counts.mapped > 2 or self.session.mapper.ended, 60)
                then(self)
            except BaseException as error:
                self.error = error
                self.hand.type("q")

        thread = threading.Thread(target=act, daemon=True)
        thread.start()
        result = self.session.run(runs=self.folder / "runs", out=self.folder / "map.sgrid", facts={"command": "a test"})
        thread.join(10)
        if self.error is not None:
            raise self.error
        return result

    def until(self, true: Callable[[], object], within_s: float = 20.0) -> None:
        end_s = time.monotonic() + within_s
        while not true():
            assert time.monotonic() < end_s, "it did not happen"
            time.sleep(0.01)

    def drive(self) -> None:
        """Arm, and forwards until it moves."""
        self.hand.type("m")
        self.until(lambda: self.driver.status().armed)
        with self.hand.holding("w"):
            self.until(lambda: self.robot.ticks[-1][1] > 0.2)

    def saved(self, result: DriveResult) -> OccupancyGrid:
        """The map, which must be the same at each of its places; the recording must be whole."""
        assert result.saved is not None and not result.saved.faults
        assert result.saved.places[0] == self.folder / "map.sgrid"
        folder = result.saved.places[1]
        held = {path.name for path in folder.iterdir()}
        assert {"map.sgrid", "config.toml", "metrics.json", "report.html", "disparity.png"} <= held
        grid = OccupancyGrid.load(self.folder / "map.sgrid")
        assert grid.sha256() == OccupancyGrid.load(folder / "map.sgrid").sha256()
        assert json.loads((folder / "metrics.json").read_text())["ended"] == result.ended
        recording = open_recording(self.folder / "drive.mcap")
        assert len(recording) > 0 and recording.is_complete  # type: ignore[attr-defined]
        return grid


@pytest.fixture
def driven(tmp_path: Path) -> Iterator[Driven]:
    with ExitStack() as things:
        yield Driven(tmp_path, things)


def signalled(kind: signal.Signals) -> Callable[[Driven], object]:
    return lambda driven: (driven.drive(), os.kill(os.getpid(), kind))


ENDINGS: dict[str, tuple[Callable[[Driven], object], str]] = {
    "q": (lambda driven: (driven.drive(), driven.hand.type("q")), "quit"),
    "Ctrl-C": (signalled(signal.SIGINT), "interrupted"),
    "SIGTERM": (signalled(signal.SIGTERM), "interrupted"),
    "a closed terminal": (signalled(signal.SIGHUP), "interrupted"),
}


@pytest.mark.parametrize("way", ENDINGS)
def test_however_a_drive_ends_the_robot_is_closed_and_map_and_recording_are_whole(driven: Driven, way: str) -> None:
    then, ended = ENDINGS[way]
    result = driven.run(then)
    assert result.ended == ended and result.faults == ()
    grid = driven.saved(result)
    assert grid.n_known > 1000
    commands = [each for each in driven.robot.commands() if each[0] != Code.PULSE]
    assert commands[-2:] == FAREWELL
    assert max(speed for _, speed in driven.robot.ticks[-3:]) < 1e-9


def test_cameras_that_stay_dead_end_it_as_an_error_with_all_kept(driven: Driven) -> None:
    result = driven.run(lambda driven: driven.pictures.cut.set(), patience_s=1.5)
    assert result.ended.startswith("the cameras are silent for 1.5 s") and result.faults == (result.ended,)
    assert driven.saved(result).n_known > 1000


def test_a_robot_that_stays_dead_ends_it_as_an_error_with_all_kept(driven: Driven) -> None:
    result = driven.run(lambda driven: driven.robot._stop.set(), patience_s=1.5)
    assert result.ended.startswith("the robot is silent for 1.5 s") and result.ended in result.faults
    assert driven.saved(result).n_known > 1000


def test_a_driver_that_dies_ends_it_and_the_robot_was_stopped_by_its_own_watchdog(tmp_path: Path) -> None:
    def kill(driven: Driven) -> None:
        driven.hand.type("m")
        driven.until(lambda: driven.driver.status().armed)
        with driven.hand.holding("w"):
            driven.until(lambda: driven.robot.ticks[-1][1] > 0.2)
            os.kill(driven.driver.pid, signal.SIGKILL)
            driven.until(driven.session.helm.quit.is_set)

    with ExitStack() as things:
        driven = Driven(tmp_path, things, connect)
        result = driven.run(kill)
        assert "the driver's process died" in result.ended and result.ended in result.faults
        assert driven.saved(result).n_known > 1000
        driven.until(lambda: driven.robot.ticks[-1][1] < 1e-9)


def test_a_full_map_stops_neither_the_driving_nor_the_recording_and_is_kept(driven: Driven) -> None:
    # Room for one view and a little more, of cells that take twice the usual room.
    tight = replace(CONFIG, grid=GridConfig(cell_m=0.1, clamp=(), memory_limit_gb=8.4e-5))

    def fill(driven: Driven) -> None:
        before = driven.recorder.counts.pairs
        driven.hand.type("m")
        driven.until(lambda: driven.driver.status().armed)
        with driven.hand.holding("w"):
            driven.until(lambda: driven.session.mapper.ended, 60)
            at_the_end = len(driven.robot.ticks)
            driven.until(lambda: len(driven.robot.ticks) > at_the_end + 10)
        assert all(speed > 0.2 for _, speed in driven.robot.ticks[at_the_end : at_the_end + 10])
        assert driven.recorder.counts.pairs > before
        driven.hand.type("q")

    result = driven.run(fill, tight)
    assert result.ended == "quit" and "its limit is 8.4e-05 GB" in result.faults[0]
    assert driven.saved(result).n_known > 500


def test_what_cannot_be_saved_is_said_and_the_rest_is(driven: Driven) -> None:
    (driven.folder / "runs").write_text("a file where the folder of runs should be")
    result = driven.run(lambda driven: driven.hand.type("q"))
    assert result.saved is not None and result.saved.places == (driven.folder / "map.sgrid",)
    assert "runs: results cannot be written there" in result.faults[0]
