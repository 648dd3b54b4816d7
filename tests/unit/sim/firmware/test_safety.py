"""What stops the robot: the watchdog, an emergency stop, a stall, a bumper, motors off."""

from dataclasses import replace

import pytest
from arcos_client import Bench, order
from kinematic_body import TICK_S

import arcos
from arcos import Code


@pytest.fixture
def bench() -> Bench:
    """A robot that drives at .2 m/s."""
    bench = Bench().connect()
    bench.tell(order(Code.VEL, 200))
    bench.run(1.5)
    return bench


def ticks_until_still(bench: Bench) -> int:
    return next(k for k, speed in enumerate(bench.speeds_mps) if abs(speed) < 1e-9)


def test_the_watchdog_stops_a_robot_that_hears_nothing_for_two_seconds(bench: Bench) -> None:
    bench.tell(arcos.SYNC0)
    bench.speeds_mps.clear()
    bench.run(4.0, pulse=False)
    slowing = next(k for k, speed in enumerate(bench.speeds_mps) if speed < 0.1999)
    assert slowing * TICK_S == pytest.approx(2.0, abs=2 * TICK_S)
    # .2 m/s at .3 m/s^2.
    assert ticks_until_still(bench) * TICK_S == pytest.approx(2.0 + 0.67, abs=3 * TICK_S)


def test_after_a_watchdog_stop_any_packet_makes_the_robot_go_on_by_itself(bench: Bench) -> None:
    assert not bench.run(4.0, pulse=False)[-1].moving
    assert bench.run(1.0)[-1].left_mmps == 200


def test_a_broken_packet_does_not_feed_the_watchdog(bench: Bench) -> None:
    broken = arcos.SYNC0[:-1] + b"\x01"
    for _ in range(40):
        bench.tell(broken)
        sips = bench.run(0.1, pulse=False)
    assert not sips[-1].moving and bench.firmware.parser.bad == 40


def test_a_client_that_vanishes_leaves_the_robot_to_the_watchdog_and_a_new_handshake_does_not_wake_it(
    bench: Bench,
) -> None:
    bench.tell(arcos.SYNC0)
    bench.firmware.hang_up()
    bench.speeds_mps.clear()
    for packet in (arcos.SYNC0, arcos.SYNC1, arcos.SYNC2) * 10:
        bench.tell(packet)
        bench.run(0.1, pulse=False)
    assert ticks_until_still(bench) * TICK_S == pytest.approx(2.67, abs=0.15)
    bench.connect()
    assert not any(sip.moving for sip in bench.run(1.0))


def test_close_stops_the_robot_and_switches_its_motors_off(bench: Bench) -> None:
    bench.tell(order(Code.CLOSE, 1))
    bench.run(0.1)
    assert bench.body.coasting


def test_an_emergency_stop_brakes_at_once_and_holds_until_enable(bench: Bench) -> None:
    bench.tell(order(Code.E_STOP))
    bench.speeds_mps.clear()
    sip = bench.run(0.1)[-1]
    assert bench.speeds_mps[0] == 0
    assert (sip.motors_on, sip.e_stopped, sip.moving) == (False, True, False)
    assert not bench.body.coasting
    bench.tell(order(Code.VEL, 200), order(Code.MOVE, 500))
    assert not any(sip.moving for sip in bench.run(1.0))
    bench.tell(order(Code.ENABLE, 0))
    sip = bench.run(1.0)[-1]
    assert (sip.motors_on, sip.e_stopped, sip.moving) == (False, True, False)
    bench.tell(order(Code.ENABLE, 1))
    sip = bench.run(1.0)[-1]
    assert (sip.motors_on, sip.e_stopped, sip.moving) == (True, False, False)
    bench.tell(order(Code.VEL, 200))
    assert bench.run(1.0)[-1].left_mmps == 200


def test_an_emergency_stop_outlives_its_connection(bench: Bench) -> None:
    bench.tell(order(Code.E_STOP), order(Code.CLOSE, 1))
    assert bench.connect(motors=False).run(0.1)[-1].e_stopped
    bench.tell(order(Code.ENABLE, 1))
    assert not bench.run(0.1)[-1].e_stopped


def test_motors_off_lets_the_wheels_roll_free_and_forgets_the_speed(bench: Bench) -> None:
    bench.tell(order(Code.ENABLE, 0))
    bench.run(0.1)
    assert bench.body.coasting
    bench.tell(order(Code.ENABLE, 1))
    assert not bench.run(1.0)[-1].moving


def test_a_stall_is_reported_while_the_motors_rest_and_then_they_try_again(bench: Bench) -> None:
    bench.body.held = True
    assert bench.run(0.1)[-1].stalled == (True, True)
    bench.body.held = False
    sips = bench.run(3.0)
    assert sum(sip.stalled == (True, True) for sip in sips) == pytest.approx(9, abs=1)
    assert not any(sip.moving for sip in sips[:9])
    assert sips[-1].stalled == (False, False) and sips[-1].left_mmps == 200


def test_a_robot_that_stays_blocked_stalls_again_and_one_that_is_told_to_stop_does_not(bench: Bench) -> None:
    bench.body.held = True
    sips = bench.run(6.0)
    assert sum(any(sip.stalled) for sip in sips) > 0.8 * len(sips)
    bench.tell(order(Code.STOP))
    assert not any(any(sip.stalled) for sip in bench.run(4.0)[20:])


@pytest.mark.parametrize(
    ("mode", "speed", "bumpers", "stops"),
    [
        (3, 200, (0b00100, 0), True),
        (1, 200, (0b00100, 0), True),
        (2, 200, (0b00100, 0), False),
        (0, 200, (0b00100, 0), False),
        (3, -200, (0b00100, 0), False),
        (3, -200, (0, 0b00001), True),
        (3, 200, (0, 0b00001), False),
        (2, -200, (0, 0b00001), True),
        (1, -200, (0, 0b00001), False),
    ],
)
def test_bumpers_stop_the_robot_on_its_way_into_them_as_bumpstall_says(
    bench: Bench, mode: int, speed: int, bumpers: tuple[int, int], stops: bool
) -> None:
    bench.tell(order(Code.BUMPSTALL, mode), order(Code.VEL, speed))
    bench.run(2.0)
    bench.body.bumpers = bumpers
    sip = bench.run(0.3)[-1]
    assert (sip.front_bumpers, sip.rear_bumpers) == bumpers
    assert sip.moving != stops and sip.stalled == (stops, stops)


def test_a_robot_at_a_wall_can_back_off(bench: Bench) -> None:
    bench.body.bumpers = (0b00100, 0)
    assert bench.run(3.0)[-1].stalled == (True, True)
    bench.tell(order(Code.VEL, -200))
    sip = bench.run(3.0)[-1]
    assert sip.left_mmps == -200 and not any(sip.stalled)


def test_an_empty_battery_shows(bench: Bench) -> None:
    bench.body.battery_v = 11.04
    assert bench.run(0.1)[-1].battery_dv == 110


def test_a_stall_does_not_outlive_its_connection(bench: Bench) -> None:
    bench.body.held = True
    bench.run(1.0)
    bench.firmware.hang_up()
    sip = bench.connect(motors=False).run(0.1)[-1]
    assert sip == replace(sip, stall_bumpers=0)
