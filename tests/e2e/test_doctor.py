"""`python -m hardware doctor` on this machine: as it is, and with a robot and cameras on the loopback."""

import json

import pytest

pytest.importorskip("pybullet", reason="the simulated firmware needs pybullet (Python 3.10 or 3.11)")

from live_rig import Pictures
from served_robot import ServedRobot

from hardware.__main__ import app
from sim.firmware.tcp import TcpLink
from stereogrid.cli import run


def doctor(capsys, *arguments):
    """The exit code, and the checks by their names."""
    code = run(app, ["doctor", "--json", *arguments])
    told = json.loads(capsys.readouterr().out)
    assert told["healthy"] is (code == 0)
    return code, {check["name"]: check for check in told["checks"]}


def test_a_robot_and_cameras_that_answer_are_well(capsys, tmp_path):
    with ServedRobot(TcpLink(0)) as robot, Pictures() as cameras:
        address = ("--robot", f"tcp:{robot.link.name}", "--camera", cameras.url)
        code, checks = doctor(capsys, *address, "--folder", str(tmp_path))
    names = ["robot", "battery", "robot at rest", "camera skew", "pictures", "camera.json", "calibration fits"]
    assert {name: checks[name]["state"] for name in names} == dict.fromkeys(names, "ok")
    assert code == 0
    assert checks["battery"]["values"] == {"battery_v": 12.9}
    assert checks["camera pairs"]["values"]["rate_hz"] > 2
    assert checks["camera skew"]["values"]["worst_ms"] < 50


def test_with_nothing_asked_for_it_looks_at_the_machine_and_says_what_is_not_there(capsys, tmp_path):
    code = run(app, ["doctor", "--folder", str(tmp_path)])
    said = capsys.readouterr().out
    # Somebody's machine may have a device plugged in that has a problem.
    assert code == (" problem " in said)
    for name in ("v4l2-ctl", "group dialout", "group video", "room for recordings", "robot", "camera pairs"):
        assert f"\n{name} " in said
    assert "--robot tcp:host:port" in said


def test_what_is_asked_for_and_does_not_answer_is_a_problem(capsys, tmp_path):
    missing = ("--robot", str(tmp_path / "ttyUSB0"), "--camera", "/dev/video98,/dev/video99")
    code, checks = doctor(capsys, *missing, "--calibration", str(tmp_path / "rig.toml"))
    assert code == 1
    for name in ("robot", "camera pairs", "calibration"):
        assert checks[name]["state"] == "problem" and checks[name]["remedy"], checks[name]


def test_a_size_that_is_none_gets_one_line(capsys):
    assert run(app, ["doctor", "--size", "big"]) == 1
    assert capsys.readouterr().err == "error: --size must be WIDTHxHEIGHT, as 320x240, not 'big'\n"
