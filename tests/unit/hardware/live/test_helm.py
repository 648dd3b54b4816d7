"""What moves the robot and what stops it: real keys, real pictures, the real driver, the simulated firmware.

Times are taken where the robot is, from what reached its firmware and from its wheels.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

pytest.importorskip("pybullet", reason="the simulated firmware needs pybullet (Python 3.10 or 3.11)")

from helm_bench import Bench

from arcos import Code

LATE = "was this machine too late to measure?"


@pytest.fixture
def bench() -> Iterator[Bench]:
    with ExitStack() as things:
        yield Bench(things)


def test_nothing_moves_without_an_explicit_arm(bench: Bench) -> None:
    with bench.hand.holding("w"):
        bench.until(lambda: any("motors are off" in line for line in bench.heard()))
    assert not bench.moved() and not bench.driver.status().armed
    assert not any(code in (Code.VEL, Code.ENABLE) and argument for code, argument in bench.robot.commands())


def test_a_held_key_drives_and_the_robot_stands_within_a_second_of_its_being_let_go(bench: Bench) -> None:
    bench.arm()
    with bench.hand.holding("w"):
        bench.until(lambda: bench.speed_mps() > 0.24)
    asked_s = next(h.stamp_s for h in bench.robot.heard[::-1] if h.command.code == Code.VEL and h.command.argument)
    assert asked_s - bench.hand.let_go_s <= 0.6, LATE
    assert bench.rest() - bench.hand.let_go_s <= 1.0, LATE
    assert bench.driver.status().armed


def test_speed_keys_scale_what_is_asked(bench: Bench) -> None:
    bench.arm()
    bench.hand.type("-----")
    with bench.hand.holding("w"):
        bench.until(lambda: bench.speed_mps() > 0.12)
        time.sleep(0.3)
    assert max(speed for _, speed in bench.robot.ticks) == pytest.approx(0.125, abs=0.003)
    assert bench.helm.scale == 0.5


def test_without_pictures_the_robot_stands_within_a_second_and_goes_on_when_they_come_back(bench: Bench) -> None:
    bench.arm()
    with bench.hand.holding("w"):
        bench.until(lambda: bench.speed_mps() > 0.24)
        bench.pictures.cut.set()
        bench.until(lambda: bench.speed_mps() < 1e-9)
        stood_s = bench.rest()
        assert stood_s - bench.pictures.last_s <= 1.0, LATE
        assert any("without pictures" in line for line in bench.heard())
        bench.pictures.cut.clear()
        bench.until(lambda: bench.speed_mps() > 0.1)


def test_an_emergency_stop_is_latched_until_it_is_reset_and_armed_again(bench: Bench) -> None:
    bench.arm()
    with bench.hand.holding("w"):
        bench.until(lambda: bench.speed_mps() > 0.2)
    bench.hand.type("e")
    bench.rest()
    assert bench.driver.status().latched and (Code.E_STOP, None) in bench.robot.commands()
    bench.hand.type("mw")
    bench.until(lambda: any("r resets" in line for line in bench.heard()))
    before = len(bench.robot.ticks)
    time.sleep(0.5)
    assert not any(speed > 0 for _, speed in bench.robot.ticks[before:])


def test_space_stops_at_once_and_leaves_the_motors_on(bench: Bench) -> None:
    bench.arm()
    with bench.hand.holding("w"):
        bench.until(lambda: bench.speed_mps() > 0.24)
    bench.hand.type("w")
    time.sleep(0.1)
    pressed_s = time.monotonic()
    bench.hand.type(" ")
    bench.until(
        lambda: any(h.stamp_s > pressed_s and h.command.code in (Code.STOP, Code.VEL) for h in bench.robot.heard)
    )
    assert bench.rest() - pressed_s <= 0.8, LATE
    assert bench.driver.status().armed


def test_nothing_is_armed_while_the_mapper_warms_up(bench: Bench) -> None:
    bench.ready = False
    bench.hand.type("m")
    bench.until(lambda: any("warms up" in line for line in bench.heard()))
    assert not bench.driver.status().armed
    assert (Code.ENABLE, 1) not in bench.robot.commands()


@pytest.mark.parametrize("way", ["q", "hang up", "ending"])
def test_whatever_ends_the_program_stops_the_robot_first(bench: Bench, way: str) -> None:
    bench.arm()
    with bench.hand.holding("w"):
        bench.until(lambda: bench.speed_mps() > 0.24)
    ended_s = time.monotonic()
    if way == "q":
        bench.hand.type("wq")
    elif way == "hang up":
        bench.hand.hang_up()
    bench.ending = way == "ending"
    bench.until(bench.helm.quit.is_set)
    assert bench.rest() - ended_s <= 1.0, LATE
