"""Laws of the firmware as a state machine, in injected time: the handshake, the reports, what commands do."""

from itertools import pairwise
from math import pi

import pytest
from arcos_client import OPEN, SYNCS, Bench, order, parsed
from hypothesis import given, settings
from hypothesis import strategies as st
from kinematic_body import TICK_S

import arcos
from arcos import Code, ConfigReply, Identity, Sip, heading_step, position_step, vel2
from sim.firmware.firmware import WATCHDOG_S, Firmware


@pytest.fixture
def bench() -> Bench:
    """A robot that a client has opened, motors on."""
    return Bench().connect()


def turned(sips: list[Sip]) -> int:
    return sum(heading_step(a.heading_raw, b.heading_raw) for a, b in pairwise(sips))


def moved(sips: list[Sip]) -> int:
    return sum(position_step(a.x_raw, b.x_raw) for a, b in pairwise(sips))


# The handshake


@pytest.mark.parametrize("opening", [OPEN, arcos.SYNC1], ids=["with an argument", "bare"])
def test_the_handshake_echoes_then_names_the_robot_then_reports_begin(opening: bytes) -> None:
    bench = Bench(Firmware("p3at-sh", name="Marvin"))
    assert bench.tell(arcos.SYNC0) == arcos.SYNC0
    assert bench.tell(arcos.SYNC1) == arcos.SYNC1
    names = Identity.decode(parsed(bench.tell(arcos.SYNC2))[0])
    assert names == Identity("Marvin", "Pioneer", "p3at-sh")
    assert bench.run(0.5, pulse=False) == []
    assert bench.tell(opening) == b""
    assert len(bench.run(1.0)) == 10


def test_garbage_before_the_handshake_is_skipped() -> None:
    bench = Bench()
    assert bench.tell(b"WMS2\r" + b"\xfa\xfa\xfb\x00junk" + arcos.SYNC0) == arcos.SYNC0


@given(st.lists(st.sampled_from([*SYNCS, OPEN, order(Code.VEL, 100), order(Code.CONFIG)]), max_size=12))
def test_only_the_right_sequence_opens_the_robot(packets: list[bytes]) -> None:
    bench = Bench()
    opened = False
    for k, packet in enumerate(packets):
        bench.tell(packet)
        last = packets[max(k - 3, 0) : k + 1]
        opened = opened or (last[:3] == list(SYNCS) and last[3:] in ([OPEN], [arcos.SYNC1]))
        if opened:
            break
    assert bench.firmware.is_open == opened


def test_a_robot_that_is_open_answers_a_sync_with_its_reports(bench: Bench) -> None:
    assert bench.tell(arcos.SYNC0) == b""
    assert len(bench.run(0.1)) == 1
    bench.tell(order(Code.CLOSE, 1))
    assert bench.run(1.0) == []
    assert bench.tell(arcos.SYNC0) == arcos.SYNC0


def test_the_next_client_starts_at_sync0_and_finds_motors_off_and_position_zero(bench: Bench) -> None:
    bench.tell(order(Code.VEL, 200))
    bench.run(2.0)
    bench.firmware.hang_up()
    assert bench.tell(arcos.SYNC1) == b""
    sip = bench.connect(motors=False).run(0.1)[0]
    assert (sip.motors_on, sip.x_raw, sip.y_raw, sip.heading_raw) == (False, 0, 0, 0)


def test_what_one_client_left_half_said_does_not_hold_up_the_next(bench: Bench) -> None:
    bench.tell(b"\xfa\xfb\xc8")
    bench.firmware.hang_up()
    assert bench.tell(arcos.SYNC0) == arcos.SYNC0


# Reports


def test_reports_come_every_tenth_of_a_second_and_hold_the_sonars_and_the_whole_tail(bench: Bench) -> None:
    sips = bench.run(3.0)
    assert len(sips) == 30
    assert [sonar.number for sonar in sips[0].sonars] == list(range(16))
    assert (sips[0].sonars[0].range_raw, sips[0].sonars[15].range_raw) == (100, 5000)
    assert (sips[0].battery_dv, sips[0].battery2_dv, sips[0].temperature_c) == (129, 129, -127)
    assert sips[0].charge_percent == 0 and not sips[0].rest


def test_sonars_can_be_switched_off_and_on(bench: Bench) -> None:
    bench.tell(order(Code.SONAR, 0))
    off = bench.run(0.1)[0]
    bench.tell(order(Code.SONAR, 1))
    on = bench.run(0.1)[0]
    assert (off.sonars, off.flags & arcos.Flag.SONARS) == ((), 0)
    assert (len(on.sonars), on.flags & arcos.Flag.SONARS) == (16, arcos.Flag.SONARS)


def test_a_standstill_of_the_machine_is_not_made_up_for_by_a_burst_of_reports(bench: Bench) -> None:
    bench.run(1.0)
    bench.body.time_s += 5.0
    assert len(bench.run(1.0)) <= 11


@pytest.mark.parametrize(("subclass", "bits", "distance_mm"), [("p3at", 15, 0.465), ("p3at-sh", 16, 1.0)])
def test_position_wraps_as_that_robots_does_and_can_be_followed(subclass: str, bits: int, distance_mm: float) -> None:
    bench = Bench(Firmware(subclass)).connect()
    bench.tell(order(Code.SETV, 1200), order(Code.VEL, -1200))
    sips = bench.run(80.0)
    assert all(0 <= sip.x_raw < 1 << bits for sip in sips)
    assert max(sip.x_raw for sip in sips) > (1 << bits) * 0.9
    assert moved(sips) * distance_mm == pytest.approx(-1200 * 79, rel=0.05)
    assert bench.body.odometry.T_odom_base[0, 3] * 1000 == pytest.approx(moved(sips) * distance_mm, abs=300)


def test_heading_wraps_and_can_be_followed(bench: Bench) -> None:
    bench.tell(order(Code.RVEL, 90))
    sips = bench.run(10.0)
    assert all(-2048 <= sip.heading_raw < 2048 for sip in sips)
    assert turned(sips) / 4096 * 360 == pytest.approx(90 * 10 - 45, abs=15)
    assert sips[-1].turn_ddegps == pytest.approx(900, abs=2)
    assert (sips[-1].left_mmps, sips[-1].right_mmps) == pytest.approx((-462, 462), abs=2)


def test_seto_makes_this_place_the_origin_with_x_ahead(bench: Bench) -> None:
    bench.tell(order(Code.DHEAD, 90))
    bench.run(4.0)
    bench.tell(order(Code.SETO), order(Code.MOVE, 500))
    sip = bench.run(6.0)[-1]
    assert sip.x_raw * 0.465 == pytest.approx(500, abs=5)
    assert min(sip.y_raw, 0x8000 - sip.y_raw) <= 2 and abs(sip.heading_raw) <= 2


def test_config_says_what_the_robot_does(bench: Bench) -> None:
    reply = ConfigReply.decode(parsed(bench.tell(order(Code.CONFIG, 1)))[0])
    assert (reply.subtype, reply.sip_cycle_ms, reply.watchdog_ms) == ("p3at", 100, 1000 * WATCHDOG_S)
    bench.tell(order(Code.VEL, 5000))
    sips = bench.run(6.0)
    assert sips[-1].left_mmps == reply.max_speed_mmps
    gained = [b.left_mmps - a.left_mmps for a, b in pairwise(sips)]
    assert max(gained) == pytest.approx(reply.acceleration_mmps2 * reply.sip_cycle_ms / 1000, abs=1)


# What moves the robot


@pytest.mark.parametrize(
    "command",
    [order(Code.VEL, 200), order(Code.RVEL, 20), order(Code.MOVE, 500), order(Code.DHEAD, 90), vel2(10, 10).packet()],
    ids=["VEL", "RVEL", "MOVE", "DHEAD", "VEL2"],
)
def test_nothing_moves_before_enable_and_nothing_is_remembered(command: bytes) -> None:
    bench = Bench().connect(motors=False)
    bench.tell(command)
    assert not any(sip.moving or sip.motors_on for sip in bench.run(1.0))
    bench.tell(order(Code.ENABLE, 1))
    assert not any(sip.moving for sip in bench.run(1.0))
    bench.tell(command)
    assert any(sip.moving for sip in bench.run(1.0))


@pytest.mark.parametrize("distance_mm", [1000, -1000, 30])
def test_move_goes_that_far_and_stays(bench: Bench, distance_mm: int) -> None:
    bench.tell(order(Code.MOVE, distance_mm))
    sips = bench.run(8.0)
    assert moved(sips) * 0.465 == pytest.approx(distance_mm, abs=4)
    assert not sips[-1].moving
    farthest = max(abs(position_step(0, sip.x_raw)) for sip in sips)
    assert farthest * 0.465 <= abs(distance_mm) + 3


@pytest.mark.parametrize(
    ("command", "degrees"), [((Code.DHEAD, 90), 90), ((Code.DHEAD, -45), -45), ((Code.HEAD, 270), -90)]
)
def test_turns_end_at_their_heading(bench: Bench, command: tuple[Code, int], degrees: int) -> None:
    bench.tell(order(*command))
    sips = bench.run(6.0)
    assert sips[-1].heading_raw * 2 * pi / 4096 == pytest.approx(degrees * pi / 180, abs=0.006)
    assert not sips[-1].moving


def test_head_is_seen_from_the_clients_origin(bench: Bench) -> None:
    bench.tell(order(Code.DHEAD, 90))
    bench.run(4.0)
    bench.tell(order(Code.SETO), order(Code.HEAD, 0))
    assert abs(turned(bench.run(4.0))) <= 2
    for _ in range(2):
        bench.tell(order(Code.HEAD, -30))
        assert bench.run(3.0)[-1].heading_raw == pytest.approx(-30 / 360 * 4096, abs=3)


@settings(max_examples=20)
@given(st.integers(-40, 40), st.integers(-40, 40), st.booleans())
def test_vel2_drives_the_sides_in_both_encodings(left: int, right: int, unsigned: bool) -> None:
    bench = Bench().connect()
    bench.tell(order(Code.SETV, 1200), order(Code.SETRV, 300), vel2(left, right, unsigned=unsigned).packet())
    sip = bench.run(7.0)[-1]
    assert (sip.left_mmps, sip.right_mmps) == pytest.approx((20 * left, 20 * right), abs=1)


def test_driving_and_turning_do_not_cancel_each_other(bench: Bench) -> None:
    bench.tell(order(Code.VEL, 200), order(Code.RVEL, 20))
    sip = bench.run(2.0)[-1]
    assert 0.5 * (sip.left_mmps + sip.right_mmps) == pytest.approx(200, abs=1)
    assert sip.turn_ddegps == pytest.approx(200, abs=2)
    bench.tell(order(Code.STOP))
    assert not bench.run(1.0)[-1].moving


@settings(max_examples=25)
@given(st.lists(st.integers(-700, 700), min_size=1, max_size=5), st.integers(50, 2000), st.integers(50, 2000))
def test_speed_never_changes_faster_than_it_may(goals: list[int], faster: int, slower: int) -> None:
    bench = Bench().connect()
    bench.tell(order(Code.SETA, faster), order(Code.SETA, -slower))
    for goal in goals:
        bench.tell(order(Code.VEL, goal))
        bench.run(1.0)
    for a, b in zip([0.0, *bench.speeds_mps], bench.speeds_mps, strict=False):
        ramp = faster if abs(b) > abs(a) else slower
        assert abs(b - a) <= 0.001 * ramp * TICK_S + 1e-9


def test_setv_and_setrv_limit_the_speeds_and_are_limited_themselves(bench: Bench) -> None:
    bench.tell(order(Code.SETV, 300), order(Code.VEL, 700), order(Code.SETRV, 10), order(Code.RVEL, -100))
    sip = bench.run(4.0)[-1]
    assert 0.5 * (sip.left_mmps + sip.right_mmps) == pytest.approx(300, abs=1)
    assert sip.turn_ddegps == pytest.approx(-100, abs=2)
    bench.tell(order(Code.RVEL, 0))
    bench.run(1.0)
    bench.speeds_mps.clear()
    bench.tell(order(Code.SETV, 3000), order(Code.SETA, 30000), order(Code.VEL, 3000))
    assert bench.run(6.0)[-1].left_mmps == 1200
    gained = [b - a for a, b in pairwise(bench.speeds_mps)]
    assert max(gained) == pytest.approx(0.001 * bench.firmware.config.top_acceleration_mmps2 * TICK_S)


@pytest.mark.parametrize("argument", [None, b"fast", 40000, -40000])
def test_an_argument_without_sense_changes_nothing_and_is_counted(bench: Bench, argument: int | bytes | None) -> None:
    bench.tell(order(Code.VEL, argument))
    assert not any(sip.moving for sip in bench.run(0.5))
    assert bench.firmware.counts.malformed == 1


def test_unknown_commands_are_ignored_and_counted(bench: Bench) -> None:
    bench.tell(order(62, 1), order(90, 5), order(200), order(Code.SAY, b"hello"))
    assert len(bench.run(1.0)) == 10
    assert bench.firmware.counts.unknown == 3


@given(st.binary(max_size=400))
def test_no_bytes_whatever_break_an_open_robot(data: bytes) -> None:
    bench = Bench().connect()
    bench.tell(data, arcos.packet(data[:200] or b"\0"))
    bench.run(0.3)
    bench.firmware.hang_up()
    assert len(bench.connect().run(0.2)) == 2


def test_a_half_packet_delays_the_next_one_by_a_quarter_second_at_most(bench: Bench) -> None:
    bench.tell(order(Code.VEL, 200), b"\xfa\xfb\xc8" + order(Code.STOP))
    bench.run(0.4, pulse=False)
    bench.run(1.0)
    assert not bench.run(0.1)[-1].moving


def test_hostbaud_is_followed_and_forgotten_in_silence(bench: Bench) -> None:
    bench.tell(order(Code.HOSTBAUD, 2))
    bench.run(0.5)
    assert bench.firmware.controller.baud == 38400
    bench.run(1.0, pulse=False)
    assert bench.firmware.controller.baud == 9600
    bench.tell(order(Code.HOSTBAUD, 7))
    assert bench.firmware.counts.malformed == 1
