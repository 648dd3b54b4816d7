"""Real sockets and real pseudo-terminals, with a robot without physics: no client takes it down or makes it wait."""

import os
import socket
import time
from collections.abc import Iterator

import pytest
from arcos_client import OPEN, SYNCS, Client, TcpWire, TerminalWire, order
from kinematic_body import TICK_S, KinematicBody
from served_robot import ServedRobot

import arcos
from arcos import Code, Sip
from sim.firmware.links import Outbox
from sim.firmware.pacer import MOST_TICKS, Pacer
from sim.firmware.tcp import TcpLink
from sim.firmware.terminal import TerminalLink
from stereogrid.errors import InvalidInputError


@pytest.fixture
def robot() -> Iterator[ServedRobot]:
    with ServedRobot(TcpLink(0), speed_up=4) as served:
        yield served


def port(robot: ServedRobot) -> int:
    assert isinstance(robot.link, TcpLink)
    return robot.link.port


def wait_for_line(robot: ServedRobot, part: str) -> None:
    """Until the log has a line; the test's own time limit is what ends an endless wait."""
    end_s = time.monotonic() + 20
    while not any(part in line for line in robot.lines):
        assert time.monotonic() < end_s, f"no line with {part!r} in {robot.lines}"
        time.sleep(0.01)


def run_ticks(robot: ServedRobot, duration_s: float) -> None:
    """Let simulated time pass."""
    end_s = robot.body.time_s + duration_s
    limit_s = time.monotonic() + 20
    while robot.body.time_s < end_s:
        assert time.monotonic() < limit_s, "the robot's time stands still"
        time.sleep(0.01)


def test_a_client_connects_drives_and_closes(robot: ServedRobot) -> None:
    client = Client(TcpWire(port(robot)))
    assert client.connect().subclass == "p3at"
    client.send(order(Code.ENABLE, 1), order(Code.VEL, 200))
    assert client.drive_until(lambda sip: sip.left_mmps == 200).motors_on
    client.send(order(Code.CLOSE, 1))
    client.close()
    wait_for_line(robot, "the client left; so far")
    assert isinstance(robot.body, KinematicBody) and robot.body.coasting


def test_clients_come_one_after_another_and_each_starts_at_sync0(robot: ServedRobot) -> None:
    for _ in range(3):
        client = Client(TcpWire(port(robot)))
        client.connect()
        client.close()
    assert sum(line == "a client came" for line in robot.lines) == 3


def test_a_client_that_reconnects_at_once_is_served(robot: ServedRobot) -> None:
    for _ in range(20):
        client = Client(TcpWire(port(robot)))
        assert client.ask(arcos.SYNC0, lambda _: True) == b"\0"
        client.send(arcos.SYNC1)
        client.close()


def test_a_second_client_is_let_go_and_the_first_notices_nothing(robot: ServedRobot) -> None:
    first = Client(TcpWire(port(robot)))
    first.connect()
    others = [socket.create_connection(("127.0.0.1", port(robot)), timeout=20) for _ in range(3)]
    for other in others:
        assert other.recv(1) == b""
        other.close()
    assert first.sip() is not None
    wait_for_line(robot, "refused a second client: the robot is taken")
    first.close()


def test_a_client_that_is_killed_leaves_a_robot_that_stops_and_the_next_one_is_served(robot: ServedRobot) -> None:
    client = Client(TcpWire(port(robot)))
    client.connect()
    client.send(order(Code.ENABLE, 1), order(Code.SETA, -2000), order(Code.VEL, 200))
    client.drive_until(lambda sip: sip.left_mmps == 200)
    # A reset instead of an orderly end, as from a process that is killed with unread data.
    client.wire._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # type: ignore[attr-defined]
    client.close()
    wait_for_line(robot, "the client left")
    run_ticks(robot, 1.0)
    assert robot.body.wheel_speeds_mps[0] > 0.19
    run_ticks(robot, 1.2)
    assert not robot.body.wheel_speeds_mps.any()
    client = Client(TcpWire(port(robot)))
    client.connect()
    assert not client.sip().motors_on
    client.close()


@pytest.mark.parametrize(
    "garbage",
    [os.urandom(1 << 16), b"\xfa\xfb\xca" * 20000, arcos.SYNC0[:-1] * 12000, order(Code.CONFIG, 1) * 7000],
    ids=["random", "headers", "half packets", "questions"],
)
def test_a_flood_delays_neither_the_robot_nor_the_next_client(robot: ServedRobot, garbage: bytes) -> None:
    flooder = Client(TcpWire(port(robot)))
    flooder.connect()
    flooder.wire._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 16)  # type: ignore[attr-defined]
    flooder.wire._socket.setblocking(False)  # type: ignore[attr-defined]
    start_s, sent = robot.body.time_s, 0
    limit_s = time.monotonic() + 20
    while robot.body.time_s < start_s + 3.0:
        assert time.monotonic() < limit_s, "the robot's time stands still"
        try:
            sent += flooder.wire._socket.send(garbage)  # type: ignore[attr-defined]
        except BlockingIOError:
            time.sleep(0.001)
    assert sent > 1 << 18
    flooder.close()
    client = Client(TcpWire(port(robot)))
    client.connect()
    client.close()


def test_a_client_that_never_reads_gets_no_halves_of_packets_when_it_does(robot: ServedRobot) -> None:
    client = Client(TcpWire(port(robot)))
    client.connect()
    limit_s = time.monotonic() + 20
    while not robot.link.dropped:
        assert time.monotonic() < limit_s
        client.send(order(Code.CONFIG, 1) * 20)
        time.sleep(0.01)
    client.drive_until(lambda sip: not sip.moving, within=2)
    client.listen(0.5)
    assert client.parser.bad == 0 and client.parser.skipped == 0
    client.close()


def test_a_port_in_use_is_named_with_what_to_do() -> None:
    link = TcpLink(0)
    with pytest.raises(InvalidInputError, match=f"port {link.port} is in use: choose another one"):
        TcpLink(link.port)
    link.close()
    with pytest.raises(InvalidInputError, match="a port must be 0 to 65535, not 70000"):
        TcpLink(70000)


def test_over_a_terminal_the_robot_stays_open_when_its_client_goes_as_on_a_serial_line() -> None:
    link = TerminalLink()
    with ServedRobot(link, subclass="p3at-sh", speed_up=4) as robot:
        first = Client(TerminalWire(link.name))
        first.send(b"WMS2\r")
        assert first.connect().subclass == "p3at-sh"
        first.send(order(Code.ENABLE, 1), order(Code.VEL, 200))
        first.drive_until(lambda sip: sip.left_mmps == 200)
        first.close()
        wait_for_line(robot, "the client closed the line")
        run_ticks(robot, 3.5)
        assert not robot.body.wheel_speeds_mps.any()
        # What the driver of the real robot must be ready for: still open, and any packet sets it going again.
        second = Client(TerminalWire(link.name))
        assert Sip.is_sip(second.ask(arcos.SYNC0, lambda _: True))
        assert second.drive_until(lambda sip: sip.left_mmps == 200).motors_on
        second.send(order(Code.CLOSE, 1))
        assert second.ask(arcos.SYNC0, lambda body: body == b"\0") == b"\0"
        second.close()


def test_a_terminals_next_client_hears_nothing_old() -> None:
    link = TerminalLink()
    with ServedRobot(link, speed_up=4) as robot:
        first = Client(TerminalWire(link.name))
        first.connect()
        # Reports that nobody reads.
        run_ticks(robot, 2.0)
        first.close()
        wait_for_line(robot, "the client closed the line")
        robot.firmware.hang_up()
        second = Client(TerminalWire(link.name))
        assert second.listen(0.3) is None and second.bodies == []
        second.connect()
        second.close()


def test_a_terminal_that_nobody_reads_does_not_stop_the_robot() -> None:
    link = TerminalLink()
    with ServedRobot(link, speed_up=8) as robot:
        client = Client(TerminalWire(link.name))
        client.connect()
        limit_s = time.monotonic() + 20
        while not link.dropped:
            assert time.monotonic() < limit_s
            client.send(order(Code.CONFIG, 1) * 5)
            run_ticks(robot, 0.2)
        client.listen(0.5)
        assert client.parser.bad == 0 and client.parser.skipped == 0
        client.close()


def test_an_outbox_keeps_order_and_drops_only_whole_packets() -> None:
    outbox = Outbox()
    packets = [bytes([k]) * 100 for k in range(200)]
    sent = b""

    def write(data: bytes) -> int:
        nonlocal sent
        sent += data[:130]
        return min(len(data), 130)

    for k, packet in enumerate(packets):
        outbox.put(packet)
        if k % 2:
            outbox.flush(write)
    for _ in range(200):
        outbox.flush(write)
    kept = [sent[at : at + 100] for at in range(0, len(sent), 100)]
    assert all(piece in packets for piece in kept) and kept == sorted(kept)
    assert outbox.dropped == 200 - len(kept) > 0


class Clock:
    """Time that passes only by sleeping and by what a test says a tick cost."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s


def test_ticks_follow_the_clock() -> None:
    clock = Clock()
    pacer = Pacer(0.1, clock=clock, sleep=clock.sleep)
    ticks = 0
    for cost_s in [0.01, 0.05, 0.25, 0.0, 0.0, 0.3, 0.02] * 10:
        ticks += pacer.wait()
        clock.sleep(cost_s)
    assert ticks == pytest.approx((clock.now_s - 100) / 0.1, abs=4)
    assert (pacer.slips, pacer.lost_s) == (0, 0.0)


def test_a_machine_that_is_far_too_slow_loses_time_and_counts_it_but_never_spirals() -> None:
    clock = Clock()
    pacer = Pacer(0.1, clock=clock, sleep=clock.sleep)
    ticks = 0
    for _ in range(50):
        due = pacer.wait()
        assert 1 <= due <= MOST_TICKS
        ticks += due
        clock.sleep(0.2 * due)
    assert pacer.slips > 0
    assert 0.1 * ticks + pacer.lost_s == pytest.approx(clock.now_s - 100, abs=1.1)


def test_a_late_machine_is_told_so_once_in_a_while() -> None:
    clock = Clock()
    link = TcpLink(0)
    robot = ServedRobot(link)
    robot.loop.pacer = Pacer(TICK_S, clock=clock, sleep=clock.sleep)
    for _ in range(40):
        clock.sleep(1.0)
        robot.loop.step()
    link.close()
    notes = [line for line in robot.lines if "this machine is late" in line]
    assert 1 <= len(notes) <= 3 and "slips)" in notes[0]


def test_on_a_late_machine_no_packet_is_lost_and_only_a_flood_is_cut() -> None:
    clock = Clock()

    def late() -> float:
        # Every look at the clock is a second later than the last.
        clock.sleep(1.0)
        return clock.now_s

    link = TcpLink(0)
    robot = ServedRobot(link)
    robot.loop.pacer = Pacer(TICK_S, clock=late, sleep=clock.sleep)
    wire = TcpWire(link.port)
    for packet in (*SYNCS, OPEN):
        wire.write(packet)
        robot.loop.step()
        robot.loop.step()
    assert robot.firmware.is_open
    wire.write(order(200) * 5000)
    for _ in range(10):
        robot.loop.step()
    assert 0 < robot.firmware.counts.unknown < 5000
    wire.close()
    link.close()


def test_the_clients_handshake_is_the_shared_one() -> None:
    assert b"".join(SYNCS).hex() == "fafb03000000fafb03010001fafb03020002" and OPEN.hex() == "fafb06013b0100023b"
