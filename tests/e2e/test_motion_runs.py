"""`python -m hardware motion` as somebody beside the robot meets it: a terminal, a simulated robot over TCP."""

import time

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulated firmware needs pybullet (Python 3.10 or 3.11)")

from served_robot import ServedRobot
from typist import Typist

from hardware.__main__ import app
from sim.firmware.tcp import TcpLink
from stereogrid.cli import run
from stereogrid.motion import read_runs

ENTER = "Enter drives .*: "


def wait_until(true, what, within_s=30.0):
    end_s = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end_s, what
        time.sleep(0.02)


@pytest.fixture
def robot():
    with ServedRobot(TcpLink(0)) as served:
        yield served


def measure(person, ahead, left, heading):
    person.answer(r"ahead .*: ", ahead)
    person.answer(r"to the left .*: ", left)
    person.answer(r"heading .*: ", heading)


def test_runs_are_driven_measured_kept_and_gone_on_with(robot, tmp_path):
    path = tmp_path / "runs.csv"
    command = ("hardware", "motion", "--robot", f"tcp:{robot.link.name}", "--distance", "0.6", "--runs", "2")
    command += ("--surface", "carpet", "--out", str(path))
    with Typist(*command) as person:
        person.expect("2 straight runs left on carpet")
        person.answer(ENTER, "")
        person.expect("At mark 1 of 1 odometry says 6[0-9][0-9] mm ahead")
        # What is no length is asked again; what can hardly be, too.
        person.answer(r"ahead .*: ", "half a metre")
        person.expect("'half a metre' is not a length")
        measure(person, "59", "0", "0")
        person.answer("Is what you typed right.*: ", "n")
        # An Enter too many does not start the next run.
        measure(person, "59.6 cm", "-3", "0.2\n")
        person.expect("Kept in .*csv")
        person.expect("1 straight run left on carpet; .* holds 1")
        (run,) = read_runs(path)
        np.testing.assert_allclose(run.true, [[0, 0, 0], [0.596, -0.003, np.radians(0.2)]], atol=1e-5)
        assert run.odo[1, 0] == pytest.approx(robot.body.T_world_base[0, 3], abs=0.003)
        assert (run.name, run.surface) == ("1", "carpet")
        wait_until(lambda: robot.body.coasting, "its motors stayed on")

        # A key stops it, and its motors are off.
        person.answer(ENTER, "")
        wait_until(lambda: robot.body.wheel_speeds_mps.mean() > 0.1, "it never drove")
        person.type("x")
        wait_until(lambda: robot.body.coasting and not robot.body.wheel_speeds_mps.any(), "it never stopped")
        person.expect("stopped by a key, 0.* m ahead")

        # So does Ctrl-C, and nothing is lost.
        person.answer(ENTER, "")
        wait_until(lambda: robot.body.wheel_speeds_mps.mean() > 0.1, "it never drove")
        person.type("\x03")
        assert person.end() == 130
        assert "keeps every mark so far" in person.said
    wait_until(lambda: not robot.firmware.is_open and not robot.body.wheel_speeds_mps.any(), "it was not closed")
    assert len(read_runs(path)) == 1

    with Typist(*command) as person:
        person.expect("1 straight run left on carpet; .* holds 1")
        person.expect("the mark at the far end of the line, facing back")
        person.answer(ENTER, "")
        measure(person, "0.61 m", "1 cm", "-0.5")
        assert person.end() == 0
        assert "Kept in" in person.said and "complete" in person.said
        assert "next: stereogrid motion-error" in person.said or "at least 3" in person.said, person.said
    forth, back = read_runs(path)
    assert (forth.name, back.name) == ("1", "2")
    # The second goes back along the line, from where the first was to end.
    np.testing.assert_allclose(back.true, [[0.6, 0, np.pi], [-0.01, -0.01, np.pi - np.radians(0.5)]], atol=1e-5)
    assert robot.body.coasting


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "say how far the robot shall drive (--distance 2), or turn (--turn 360)"),
        (["--distance", "0.1"], "a straight run has 0.6 to 20 m"),
        (["--distance", "2", "--out", "none/runs.csv"], "no such folder"),
        (["--distance", "2"], "the runs need a terminal"),
    ],
)
def test_what_is_wrong_gets_one_line_before_any_robot_is_asked(arguments, said, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert run(app, ["motion", "--robot", "tcp:127.0.0.1:1", "--out", "runs.csv", *arguments]) == 1
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())
