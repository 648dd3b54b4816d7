"""Runs by a real driver and a simulated robot, with somebody beside it who answers from a list."""

import math
import time
from contextlib import contextmanager

import pytest

pytest.importorskip("pybullet", reason="the simulated firmware needs pybullet (Python 3.10 or 3.11)")

from kinematic_body import KinematicBody
from served_robot import ServedRobot

from hardware.errors import RobotError
from hardware.motion_runs.driving import StoppedError, drive_leg
from hardware.motion_runs.legs import TURNING, Leg
from hardware.motion_runs.plan import Plan
from hardware.motion_runs.session import Session
from hardware.pioneer.driver import Pioneer
from sim.firmware.tcp import TcpLink
from stereogrid.errors import InvalidInputError
from stereogrid.motion import read_runs

TURN = Leg("turn", math.radians(54), TURNING)


@contextmanager
def driven(body=None, speed_up=2.0):
    """A robot whose time runs faster, and its driver."""
    with ServedRobot(TcpLink(0), body, speed_up=speed_up) as robot, Pioneer(robot.link.name) as driver:
        yield robot, driver


def never(timeout_s):
    """No key is pressed."""
    time.sleep(timeout_s)
    return False


class Listed:
    """Answers from a list, or by what is called there, then none; press: called when a key is waited for."""

    def __init__(self, *answers, press=never):
        self.answers, self.press, self.told = list(answers), press, []

    def tell(self, line):
        self.told.append(line)

    def ask(self, question):
        self.told.append(question)
        if not self.answers:
            raise EOFError
        answer = self.answers.pop(0)
        return answer if isinstance(answer, str) else answer()

    confirm = ask

    def progress(self, line):
        pass

    @contextmanager
    def watching(self):
        yield self.press

    def heard(self, text):
        return any(text in line for line in self.told)


def test_a_bumper_ends_a_leg_with_its_name_and_the_motors_off():
    with driven() as (robot, driver):

        def bump(timeout_s):
            if robot.body.wheel_speeds_mps.mean() > 0.05:
                robot.body.bumpers = (0, 2)
            return never(timeout_s)

        with pytest.raises(StoppedError, match="bumper"):
            drive_leg(driver, Leg("straight", 2.0), bump)
        assert not driver.status().armed
        assert driver.latest().odometry.T_odom_base[0, 3] < 0.5


def test_a_robot_that_may_not_be_armed_does_not_begin():
    with driven(KinematicBody(battery_v=11.0)) as (robot, driver):
        with pytest.raises(RobotError, match="charge it"):
            drive_leg(driver, TURN, never)
        assert robot.body.coasting and not robot.body.wheel_speeds_mps.any()


def test_a_turn_is_kept_another_dropped_and_the_end_of_answers_ends_it(tmp_path):
    path = tmp_path / "runs.csv"
    person = Listed("", "0", "0", "53.5", "", "drop", "q")
    with driven() as (_, driver):
        session = Session(driver, person, Plan(turn_rad=math.radians(54), runs=3), path)
        session.run()
    (run,) = read_runs(path)
    assert run.kind == "turn" and math.degrees(run.turned_rad) == pytest.approx(53.5, abs=0.01)
    assert person.heard("54 degrees to the right") and person.heard("Dropped")
    assert session.plan.left(session.held) == {"turn": 2}


def test_a_latch_is_reset_with_the_next_enter_once_its_cause_is_gone(tmp_path):
    path = tmp_path / "runs.csv"
    with driven() as (robot, driver):
        driver.e_stop("a test")
        presses = []

        def bump_once(timeout_s):
            presses.append(robot.body.bumpers)
            if len(presses) == 1:
                robot.body.bumpers = (0, 2)
            return never(timeout_s)

        def free_it():
            robot.body.bumpers = (0, 0)
            while driver.latest().fault:
                never(0.02)
            return ""

        # The e-stop is reset by the first Enter; the second is in vain while the bumper is pressed.
        person = Listed("", "", free_it, "0", "0", "54", press=bump_once)
        Session(driver, person, Plan(turn_rad=math.radians(54), runs=1), path).run()
    assert person.heard("bumper") and person.heard("cannot be reset")
    assert len(read_runs(path)) == 1


def test_what_odometry_can_hardly_have_missed_is_asked_again(tmp_path):
    person = Listed("", "0", "0", "-54", "n", "0", "0", "54.2")
    with driven() as (_, driver):
        Session(driver, person, Plan(turn_rad=math.radians(54), runs=1), tmp_path / "runs.csv").run()
    (run,) = read_runs(tmp_path / "runs.csv")
    assert run.true[1, 2] == pytest.approx(math.radians(54.2), abs=1e-4)


def test_a_file_without_headings_is_not_gone_on_with(tmp_path):
    path = tmp_path / "runs.csv"
    path.write_text("run,odo_x_m,odo_y_m,true_x_m,true_y_m\n1,0,0,0,0\n1,1,0,1,0\n")
    with pytest.raises(InvalidInputError, match="has no headings"):
        Session(None, Listed(), Plan(2.0), path)
