"""What the driver of a robot reads at the bottom of his screen, and where lines go that nobody can take any more."""

import io
import os
from typing import Any

import pytest
from recorded_rig import RIG
from rich.console import Console
from robot_reports import report

from hardware.cameras.pairs import PairCounts
from hardware.clock import now_s
from hardware.live.mapping import LOST, LiveMapper
from hardware.live.notes import Notes
from hardware.live.screen import Screen
from hardware.live.status import Status
from hardware.mailbox import Mailbox
from hardware.pioneer.robot import RobotStatus
from stereogrid.config import GridConfig, MappingConfig
from stereogrid.geometry import from_yaw
from stereogrid.observation import Odometry
from stereogrid.sensor_model import SensorModel

CONFIG = MappingConfig(model=SensorModel(max_range_m=2.5), grid=GridConfig(cell_m=0.1))


class Parts:
    """Cameras and robot that say what a test wants."""

    def __init__(self) -> None:
        self.counts = PairCounts(pairs=10, skewed=2)
        self.trouble = ""
        self.state = RobotStatus(connected=True, armed=False, latched="", counts={})
        self.report = report(battery_v=12.34, odometry=Odometry(from_yaw(0.5, [1.5, -0.25, 0]), 2.5))

    def problem(self) -> str:
        return self.trouble

    def latest(self) -> Any:
        return self.report

    def status(self) -> RobotStatus:
        return self.state


def status_of(parts: Parts) -> tuple[Status, LiveMapper]:
    mapper = LiveMapper(RIG, CONFIG, Mailbox(2), parts)  # type: ignore[arg-type]
    return Status(parts, parts, mapper), mapper  # type: ignore[arg-type]


def line(status: Status) -> str:
    return status.line(speed_mps=0.15, recorded="recorded 3.0 MB")


def test_the_line_says_all_that_one_drives_by() -> None:
    status, mapper = status_of(Parts())
    mapper.counts.mapped, mapper.counts.stale, mapper.latency_s = 5, 3, 0.08
    assert "mapper warms up" in line(status)
    mapper.warm.set()
    said = line(status)
    for part in (
        "0.0 pairs/s, skew 0 ms, 2 bad",
        "mapped 0.0/s, 80 ms late, 3 skipped",
        "12.3 V",
        "motors off, 0.15 m/s",
        "x 1.50 y -0.25 m 29 deg, 2.50 m driven",
        "map 0.0 MB",
        "recorded 3.0 MB",
    ):
        assert part in said


def test_trouble_stands_in_capital_letters_in_the_place_of_what_is_missing() -> None:
    parts = Parts()
    status, mapper = status_of(parts)
    parts.trouble, mapper.ended = "the left camera is gone", LOST
    parts.state = RobotStatus(connected=True, armed=False, latched="front bumper 3", counts={})
    said = line(status)
    assert "NO PICTURES: the left camera is gone" in said and "pairs/s" not in said
    assert f"MAPPING ENDED: {LOST}" in said and "STOPPED: front bumper 3" in said
    parts.state = RobotStatus(connected=False, armed=False, latched="", counts={})
    assert line(status).startswith("NO ROBOT: no reports | ")
    parts.state = RobotStatus(connected=True, armed=True, latched="", counts={})
    assert "ARMED" in line(status)


def test_where_nobody_looks_a_line_a_second_is_enough() -> None:
    out = io.StringIO()
    with Screen(Console(file=out)) as screen:
        screen.say(["ready"])
        for n in range(20):
            screen.status(f"status {n}", "help")
    assert out.getvalue() == "ready\nstatus 0\n"


def test_a_terminal_that_is_gone_is_no_reason_to_fail() -> None:
    hand, terminal = os.openpty()
    file = io.TextIOWrapper(os.fdopen(terminal, "wb", 0), write_through=True)
    with Screen(Console(file=file, force_terminal=True)) as screen:
        screen.status("all is well", "help")
        os.close(hand)
        screen.say(["a line"])
        screen.status("all is well", "help")


def test_notes_wait_for_who_reads_them_and_say_the_same_once_in_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    notes = Notes()
    for _ in range(5):
        notes.add("the motors are off")
    notes.add("motors on")
    assert notes.take() == ["the motors are off", "motors on"] and notes.take() == []
    later_s = now_s() + 10
    monkeypatch.setattr("hardware.live.notes.now_s", lambda: later_s)
    notes.add("the motors are off")
    assert notes.take() == ["the motors are off"]
