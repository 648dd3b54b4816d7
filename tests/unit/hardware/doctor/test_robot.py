"""The robot is listened to over real links, and never armed."""

import socket
import time
from contextlib import contextmanager

import pytest

pytest.importorskip("pybullet", reason="the simulated firmware needs pybullet (Python 3.10 or 3.11)")

from kinematic_body import KinematicBody
from served_robot import ServedRobot

from arcos import Code
from hardware.doctor.robot import check_robot
from sim.firmware.tcp import TcpLink
from sim.firmware.terminal import TerminalLink
from stereogrid.checks import OK, PROBLEM, WARNING

LISTEN_S = 0.5


@contextmanager
def checked(link=None, body=None, **given):
    """A served robot, and the doctor's checks of it by their names."""
    with ServedRobot(link or TcpLink(0), body, **given) as robot:
        yield robot, {check.name: check for check in check_robot(robot.link.name, LISTEN_S)}


@pytest.mark.parametrize(("link", "subclass"), [(lambda: TcpLink(0), "p3at"), (TerminalLink, "p3at-sh")])
def test_a_robot_at_rest_is_well_and_stays_without_motors(link, subclass):
    with checked(link(), subclass=subclass) as (robot, checks):
        assert {name: check.state for name, check in checks.items() if name != "robot reports"} == {
            "robot": OK,
            "battery": OK,
            "robot at rest": OK,
        }
        assert f"a Pioneer {subclass}" in checks["robot"].found and "watchdog 2000 ms" in checks["robot"].found
        assert checks["battery"].found == "12.9 V"
        assert checks["robot reports"].values["rate_hz"] > 0
        end_s = time.monotonic() + 10
        while robot.firmware.is_open and time.monotonic() < end_s:
            time.sleep(0.02)
        heard = [each.command for each in robot.firmware.heard]
    assert not any(command.code == Code.ENABLE and command.argument == 1 for command in heard)
    moves = [command.argument for command in heard if command.code in (Code.VEL, Code.RVEL)]
    assert moves and not any(moves)
    assert heard[-1].code == Code.CLOSE


def test_a_low_battery_is_a_problem_before_it_is_one_on_the_way():
    with checked(body=KinematicBody(battery_v=11.2)) as (_, checks):
        assert (checks["battery"].state, checks["battery"].remedy) == (PROBLEM, "charge it")
    with checked(body=KinematicBody(battery_v=11.8)) as (_, checks):
        assert checks["battery"].state == WARNING


def test_a_pressed_bumper_is_named():
    with checked(body=KinematicBody(bumpers=(0, 2))) as (_, checks):
        assert checks["robot at rest"].state == WARNING
        assert "bumper" in checks["robot at rest"].found


def test_an_address_where_nothing_answers_is_a_problem_with_a_remedy(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    for address in (f"tcp:127.0.0.1:{port}", str(tmp_path / "ttyUSB0"), "tcp:nowhere"):
        (check,) = check_robot(address, LISTEN_S)
        assert check.state == PROBLEM and check.found and check.remedy, check
