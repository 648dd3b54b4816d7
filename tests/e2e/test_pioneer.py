"""What the driver promises, against the simulated firmware over a real TCP socket and a real terminal.

Times are taken where the robot is, from what reached its firmware and from its wheels, never from the tests' sleeps.
"""

import math
import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from driven_robot import calling, drive_for, first, moved_since, served, stood_at_s, until
from served_robot import ListeningFirmware, ServedRobot

from arcos import Code, Command
from hardware.errors import RobotError
from hardware.pioneer import Limits, connect
from hardware.pioneer.driver import Pioneer
from stereogrid.errors import InvalidInputError

ROOT = Path(__file__).parents[2]
HELPERS = ROOT / "tests/helpers"
KINDS = ("tcp", "pty")
FAREWELL = [(Code.VEL, 0), (Code.RVEL, 0), (Code.ENABLE, 0), (Code.CLOSE, None)]
TICK_S = 1 / 30
LATE = "was this machine too late to measure?"


def at_once(check: Callable[[str], None], cases: Sequence[str] = KINDS) -> None:
    """Check all cases, which mostly wait, in the time of one; each has a robot of its own."""
    with ThreadPoolExecutor(len(cases)) as pool:
        running = {case: pool.submit(check, case) for case in cases}
    failed = {case: error for case, done in running.items() if (error := done.exception())}
    if failed:
        said = "; ".join(f"{case}: {error!r}" for case, error in failed.items())
        raise AssertionError(said) from next(iter(failed.values()))


def test_1_a_stale_command_stops_the_robot_within_six_tenths_of_a_second() -> None:
    def check(kind: str) -> None:
        with served(kind) as (robot, link), Pioneer(link.name) as driver:
            driver.arm()
            asked_s = drive_for(driver, 0.8)
            for code in (Code.VEL, Code.RVEL):
                stopped_s = first(robot, code, 0, asked_s).stamp_s - asked_s
                # The robot hears only once a tick.
                assert 0.45 < stopped_s < 0.6 + TICK_S, f"{code.name} 0 came after {stopped_s:.2f} s; {LATE}"
            # The ramp from .25 m/s.
            assert stood_at_s(robot) - asked_s < 1.0, LATE
            assert driver.status().armed and driver.status().counts["stale_commands"] == 1

    at_once(check)


def test_2_pulses_come_twice_a_second_whatever_the_caller_does() -> None:
    def check(kind: str) -> None:
        with served(kind) as (robot, link), Pioneer(link.name) as driver:
            driver.arm()
            drive_for(driver, 0.6)
            driver.e_stop()
            time.sleep(0.6)
            pulses_s = [h.stamp_s for h in robot.heard if h.command == Command(Code.PULSE) and h.was_open]
            assert len(pulses_s) >= 4 and max(b - a for a, b in pairwise(pulses_s)) < 0.5, LATE

    at_once(check)


def test_2_the_firmware_stops_the_robot_of_a_driver_that_died_and_the_next_one_does_not_set_it_going() -> None:
    with served("pty") as (robot, link):
        with connect(link.name) as driver:
            driver.arm()
            driver.drive(0.25, 0.0)
            until(lambda: robot.ticks[-1][1] > 0.1)
            os.kill(driver.pid, signal.SIGKILL)
            killed_s = time.monotonic()
            assert stood_at_s(robot) - killed_s < 2.5
            until(lambda: not driver.status().connected)
            for call in (driver.arm, driver.stop, lambda: driver.drive(0.1, 0.0)):
                with pytest.raises(RobotError, match="the driver's process died"):
                    call()
        # The robot is open still, and told to drive.
        assert robot.firmware.is_open and robot.firmware.controller.motion.driving.wanted > 0.2
        died_s = time.monotonic()
        with Pioneer(link.name) as again:
            assert moved_since(robot, died_s) == 0.0
            assert [h.command.code for h in robot.heard if h.stamp_s > died_s][:3] == [Code.STOP, Code.VEL, Code.RVEL]
            assert not again.status().armed


def test_3_after_a_cut_link_it_is_there_again_stopped_disarmed_and_replays_nothing() -> None:
    def check(kind: str) -> None:
        with served(kind) as (robot, link), Pioneer(link.name, log=robot.lines.append) as driver:
            driver.arm()
            drive_for(driver, 0.8)
            link.cut()
            cut_s = time.monotonic()
            until(lambda: not driver.status().connected)
            assert stood_at_s(robot) - cut_s < 2.5, LATE
            until(lambda: not driver.status().armed)
            with pytest.raises(RobotError, match="not armed"):
                driver.drive(0.25, 0.0)
            link.cut(False)
            healed_s = time.monotonic()
            until(lambda: driver.status().connected)
            until(lambda: driver.latest().stamp_s > healed_s + 0.5)  # type: ignore[union-attr]
            assert moved_since(robot, healed_s) == 0.0 and not driver.status().armed
            said = [h.command for h in robot.heard if h.stamp_s > healed_s]
            assert all(c.argument == 0 for c in said if c.code in (Code.VEL, Code.RVEL, Code.ENABLE))
            # Before anything that a robot which is still open takes for a PULSE.
            assert said[0] == Command(Code.STOP)
            opened = said.index(Command(Code.OPEN, 1))
            assert [c.code for c in said[opened + 1 : opened + 4]] == [Code.STOP, Code.VEL, Code.RVEL]
            counts = driver.status().counts
            assert counts["reconnections"] == 1 and counts["odometry_lost"] == 1
            driver.arm()
            drive_for(driver, 0.5)
            assert moved_since(robot, healed_s) > 0.1

    at_once(check)


def test_3_a_robot_that_was_switched_off_and_on_is_found_again() -> None:
    with served("tcp") as (robot, link), Pioneer(link.name) as driver:
        driver.arm()
        drive_for(driver, 0.3)
        # As after switching on: it waits for a SYNC0 and reports to nobody.
        robot.firmware.hang_up()
        until(lambda: driver.status().counts["reconnections"] == 1)
        until(lambda: driver.status().connected)
        assert not driver.status().armed and not robot.firmware.controller.motion.motors_on


def test_3_another_robot_that_answers_after_a_cut_is_left_alone() -> None:
    with served("tcp") as (robot, link), Pioneer(link.name, log=robot.lines.append) as driver:
        driver.arm()
        robot.firmware.identity = replace(robot.firmware.identity, name="another")
        robot.firmware.hang_up()
        until(lambda: "another robot answers" in driver.status().latched)
        assert not driver.status().connected
        until(lambda: not robot.firmware.is_open)


def test_3_a_computer_that_slept_connects_anew_instead_of_going_on(monkeypatch: pytest.MonkeyPatch) -> None:
    slept_s = [0.0]
    monkeypatch.setattr("hardware.pioneer.driver.slept_s", lambda: slept_s[0])
    with served("tcp") as (robot, link), Pioneer(link.name, log=robot.lines.append) as driver:
        driver.arm()
        drive_for(driver, 0.5)
        count = len(robot.heard)
        slept_s[0] = 60.0
        until(lambda: driver.status().counts["reconnections"] == 1)
        assert not driver.status().armed
        said = [each.command for each in robot.heard[count:]]
        begun = next(k for k, command in enumerate(said) if command == Command(Code.STOP))
        assert all(c.argument for c in said[:begun] if c.code == Code.VEL)


class WithoutMotors(ListeningFirmware):
    """Its motors do not go on."""

    def tick(self, *args: object) -> bytes:
        self.controller.motion.motors_on = False
        return super().tick(*args)  # type: ignore[arg-type]


def test_4_motors_are_off_until_they_are_armed_and_the_robot_confirms_it() -> None:
    with served("tcp") as (robot, link), Pioneer(link.name) as driver:
        assert not driver.latest().motors_on  # type: ignore[union-attr]
        with pytest.raises(RobotError, match="not armed"):
            driver.drive(0.1, 0.0)
        driver.arm()
        assert robot.firmware.controller.motion.motors_on and driver.status().armed
        driver.disarm()
        assert not driver.status().armed
        until(lambda: not robot.firmware.controller.motion.motors_on)
        assert max(speed for _, speed in robot.ticks) == 0.0
    with served("tcp", firmware=WithoutMotors()) as (_, link), Pioneer(link.name) as driver:
        with pytest.raises(RobotError, match="could not be armed: it does not say that its motors are on"):
            driver.arm(0.5)
        assert not driver.status().armed


def test_5_speeds_and_ramps_are_clamped_and_what_is_no_number_is_refused() -> None:
    with served("pty") as (robot, link), Pioneer(link.name) as driver:
        driver.arm()
        drive_for(driver, 0.3, 9.0, 9.0)
        drive_for(driver, 0.3, -9.0, -9.0)
        for bad in ((math.nan, 0.0), (0.0, math.inf)):
            with pytest.raises(InvalidInputError, match="must be finite"):
                driver.drive(*bad)
        assert {a for _, a in robot.commands(Code.VEL)} == {0, 300, -300}
        assert {a for _, a in robot.commands(Code.RVEL)} == {0, 30, -30}
        ramps = robot.firmware.controller.motion
        assert (ramps.driving.acceleration, ramps.driving.deceleration) == pytest.approx((0.3, 1.0))
        assert ramps.turning.acceleration == pytest.approx(math.radians(100))


def test_6_an_e_stop_is_repeated_and_latched_until_it_is_reset() -> None:
    with served("tcp") as (robot, link), Pioneer(link.name) as driver:
        driver.arm()
        drive_for(driver, 0.5)
        asked_s = time.monotonic()
        driver.e_stop("a test")
        assert driver.status().latched == "e-stop (a test)" and not driver.status().armed
        assert first(robot, Code.E_STOP, None, asked_s).stamp_s - asked_s < 0.1 + TICK_S, LATE
        # An emergency stop knows no ramp.
        assert stood_at_s(robot) - asked_s < 0.2 + TICK_S, LATE
        until(lambda: robot.commands(Code.E_STOP).__len__() >= 5)
        for call in (lambda: driver.drive(0.1, 0.0), driver.arm):
            with pytest.raises(RobotError, match=r"e-stop \(a test\)"):
                call()
        driver.reset()
        assert driver.status().latched == ""
        with pytest.raises(RobotError, match="not armed"):
            driver.drive(0.1, 0.0)
        driver.arm()
        drive_for(driver, 0.3)
        assert moved_since(robot, asked_s + 0.5) > 0.0


def press_front(robot: ServedRobot) -> None:
    robot.body.bumpers = (0b100, 0)


def press_rear(robot: ServedRobot) -> None:
    robot.body.bumpers = (0, 0b1)


def hold(robot: ServedRobot) -> None:
    robot.body.held = True  # type: ignore[attr-defined]


def press_e_stop(robot: ServedRobot) -> None:
    robot.firmware.controller.motion.emergency_stop()


def release(robot: ServedRobot) -> None:
    robot.body.bumpers, robot.body.held = (0, 0), False  # type: ignore[attr-defined]


TROUBLES = {
    "front bumper 3": press_front,
    "rear bumper 1": press_rear,
    "both wheels stall": hold,
    "e-stop": press_e_stop,
}


def test_7_a_touch_stops_latches_and_is_told() -> None:
    def check(reason: str) -> None:
        lines: list[str] = []
        with served("tcp") as (robot, link), Pioneer(link.name, log=lines.append) as driver:
            driver.arm()
            drive_for(driver, 0.5, 0.25, 0.0)
            start_s = time.monotonic()
            TROUBLES[reason](robot)
            with pytest.raises(RobotError, match=reason):
                drive_for(driver, 2.0, 0.25, 0.0)
            assert driver.status().latched == reason and not driver.status().armed
            # A report comes each tenth of a second, and the robot hears once a tick.
            assert first(robot, Code.VEL, 0, start_s).stamp_s - start_s < 0.4, LATE
            until(lambda: f"stopped: {reason}" in lines)
            release(robot)
            until(lambda: driver.latest().fault in ("", "e-stop"))  # type: ignore[union-attr]
            assert moved_since(robot, stood_at_s(robot)) == 0.0
            driver.reset()
            driver.arm()

    at_once(check, list(TROUBLES))


def test_8_a_robot_that_reports_nothing_is_stopped_and_its_odometry_not_known() -> None:
    def check(kind: str) -> None:
        with served(kind) as (robot, link), Pioneer(link.name) as driver:
            driver.arm()
            drive_for(driver, 0.5)
            link.mute = True
            mute_s = time.monotonic()
            with pytest.raises(RobotError, match="no report came"):
                drive_for(driver, 3.0)
            assert not driver.status().connected
            stopped_s = first(robot, Code.STOP, None, mute_s).stamp_s - mute_s
            # A tenth for the report that was due, and the robot's tick.
            assert stopped_s < 0.75, f"stopped after {stopped_s:.2f} s; {LATE}"
            last_s = driver.latest().stamp_s  # type: ignore[union-attr]
            assert driver.odometry_at(last_s) is not None and driver.odometry_at(last_s + 0.3) is None
            link.mute = False
            healed_s = time.monotonic()
            until(lambda: driver.status().connected)
            assert moved_since(robot, stood_at_s(robot)) == 0.0
            driver.arm()
            drive_for(driver, 0.4)
            assert moved_since(robot, healed_s) > 0.0

    at_once(check)


def test_1_a_frozen_caller_stops_the_robot_and_a_killed_one_in_order() -> None:
    def check(kind: str) -> None:
        # One is stopped, the other holds its interpreter.
        freeze = signal.SIGSTOP if kind == "pty" else signal.SIGUSR1
        with served(kind) as (robot, link), calling(link.name) as caller:
            until(lambda: robot.ticks[-1][1] > 0.15)
            frozen_s = caller.signal(freeze)
            # Its last command may be a twentieth older than that.
            stopped_s = first(robot, Code.VEL, 0, frozen_s).stamp_s - frozen_s
            assert stopped_s < 0.6 + TICK_S, f"VEL 0 came after {stopped_s:.2f} s; {LATE}"
            assert stood_at_s(robot) - frozen_s < 1.0, LATE
            caller.signal(signal.SIGCONT)
            # Fresh commands move it again: it was never disarmed.
            until(lambda: robot.ticks[-1][1] > 0.15)
            killed_s = caller.signal(signal.SIGKILL)
            assert stood_at_s(robot) - killed_s < 2.5
            first(robot, Code.CLOSE, None, killed_s)
            assert robot.commands()[-4:] == FAREWELL
            assert not robot.firmware.is_open and not robot.firmware.controller.motion.motors_on

    at_once(check)


def test_9_whoever_is_ended_the_robot_is_left_in_order() -> None:
    def check(ending: str) -> None:
        with served("tcp") as (robot, link), calling(link.name) as caller:
            if ending == "interrupt the caller":
                # As a terminal does it: the whole group.
                os.killpg(caller.process.pid, signal.SIGINT)
            else:
                os.kill(caller.process.pid if "caller" in ending else caller.driver_pid, signal.SIGTERM)
            until(lambda: robot.commands()[-4:] == FAREWELL)
            assert stood_at_s(robot) > 0.0 and not robot.firmware.is_open
            # At rest before the motors went off: without them the robot would roll.
            off_s = robot.heard[-2].stamp_s
            assert [speed for s, speed in robot.ticks if s < off_s][-1] < 0.03
            _, errors = caller.process.communicate(timeout=20)
            assert "the driver's process died" not in errors or ending == "terminate the driver"

    at_once(check, ("interrupt the caller", "terminate the caller", "terminate the driver"))


def test_9_an_error_and_a_normal_end_leave_the_robot_in_order() -> None:
    def check(kind: str) -> None:
        with served(kind) as (robot, link):
            with pytest.raises(ZeroDivisionError), Pioneer(link.name) as driver:
                driver.arm()
                drive_for(driver, 0.4)
                _ = 1 / 0
            until(lambda: robot.commands()[-4:] == FAREWELL)
            assert not robot.firmware.is_open and stood_at_s(robot) > 0.0
            with Pioneer(link.name):
                pass
            until(lambda: robot.commands()[-4:] == FAREWELL)
            driver.close()

    at_once(check)


def test_the_drivers_process_is_the_driver_to_its_caller() -> None:
    lines: list[str] = []
    listens = threading.Event()

    def log(line: str) -> None:
        """One that is told lines and takes its time holds nothing up."""
        listens.wait(30.0)
        lines.append(line)

    with served("tcp") as (robot, link), connect(link.name, log=log, limits=Limits(speed_mps=0.2)) as driver:
        reports = driver.subscribe()
        with pytest.raises(RobotError, match="not armed"):
            driver.drive(0.1, 0.0)
        driver.arm()
        with pytest.raises(InvalidInputError, match="speed_mps must be finite, not nan"):
            driver.drive(math.nan, 0.0)
        drive_for(driver, 0.8, 5.0, 0.0)
        assert driver.latest().speed_mps > 0.1  # type: ignore[union-attr]
        assert {a for _, a in robot.commands(Code.VEL)} == {0, 200}
        driver.e_stop("a test")
        assert driver.status().latched == "e-stop (a test)" and not driver.status().armed
        with pytest.raises(RobotError, match=r"may not be armed: e-stop \(a test\)"):
            driver.arm()
        assert driver.status().latched == "e-stop (a test)"
        driver.reset()
        assert driver.status().latched == ""
        got = [reports.get(1.0) for _ in range(3)]
        assert [r.stamp_s for r in got if r] == sorted({r.stamp_s for r in got if r}) and len(got) == 3
        between_s = (got[0].stamp_s + got[1].stamp_s) / 2  # type: ignore[union-attr]
        assert driver.odometry_at(between_s) is not None
        # Stamps cross over as they are: this process's clock is the same.
        until(lambda: time.monotonic() - driver.latest().stamp_s < 0.5)  # type: ignore[union-attr]
        listens.set()
        until(lambda: "stopped: e-stop (a test)" in lines)
    until(lambda: robot.commands()[-4:] == FAREWELL)
    assert (driver.status().connected, driver.status().latched) == (False, "")
    assert reports.get(0.0) is not None
    with pytest.raises(RobotError, match="nobody listens"):
        connect(link.name)


def test_10_a_low_battery_does_not_arm_and_stops_who_drives() -> None:
    with served("tcp") as (robot, link), Pioneer(link.name) as driver:
        driver.arm()
        drive_for(driver, 0.3)
        robot.body.battery_v = 11.3  # type: ignore[misc]
        low_s = time.monotonic()
        with pytest.raises(RobotError, match=r"battery 11\.3 V"):
            drive_for(driver, 6.0)
        assert 1.9 < first(robot, Code.VEL, 0, low_s).stamp_s - low_s < 2.6, LATE
        with pytest.raises(RobotError, match=r"cannot be reset: battery 11\.3 V"):
            driver.reset()
    with served("tcp") as (robot, link):
        robot.body.battery_v = 11.4  # type: ignore[misc]
        with Pioneer(link.name) as driver:
            with pytest.raises(RobotError, match=r"may not be armed: battery 11\.4 V, below 11\.5 V: charge it"):
                driver.arm()
            assert (Code.ENABLE, 1) not in robot.commands()


def test_flipped_bytes_cost_reports_but_neither_the_connection_nor_the_odometry_nor_a_stop() -> None:
    def check(kind: str) -> None:
        with served(kind, error_rate=1e-3) as (robot, link), Pioneer(link.name) as driver:
            driver.arm()
            for _ in range(20):
                drive_for(driver, 1.0, 0.25, 0.2)
                if driver.status().counts["bad_packets"] >= 3:
                    break
            asked_s = time.monotonic()
            driver.stop()
            assert first(robot, Code.VEL, 0, asked_s).stamp_s - asked_s < 0.4, LATE
            stood_s = stood_at_s(robot)
            until(lambda: driver.latest().stamp_s > stood_s + 0.3)  # type: ignore[union-attr]
            assert link.flips >= 3
            counts = driver.status().counts
            assert counts["bad_packets"] >= 3 and counts["reconnections"] == counts["odometry_lost"] == 0
            assert counts["broken_reports"] == 0 and driver.status().latched == ""
            went = driver.latest().odometry  # type: ignore[union-attr]
            true = robot.body.odometry
            assert went.T_odom_base == pytest.approx(true.T_odom_base, abs=0.01)
            assert went.travelled_m == pytest.approx(true.travelled_m, rel=0.02)
            assert {abs(a) for _, a in robot.commands(Code.VEL)} <= {0, 250}  # type: ignore[arg-type]

    at_once(check)
