"""The handshake over real links, with the simulated firmware and with robots that behave otherwise."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

import pytest
from arcos_client import Client, TcpWire, TerminalWire, order
from served_robot import ListeningFirmware, ServedRobot

import arcos
from arcos import Code, Sip
from arcos.commands import BAUDS
from hardware.errors import RobotError
from hardware.pioneer import handshake
from hardware.pioneer.handshake import Handshake, Session
from hardware.pioneer.link import Link, LinkError, open_link
from sim.firmware.links import News
from sim.firmware.tcp import TcpLink
from sim.firmware.terminal import TerminalLink

STOPS = [(Code.STOP, None), (Code.VEL, 0), (Code.RVEL, 0), (Code.ENABLE, 0)]


@contextmanager
def met(robot: ServedRobot, **options: bool) -> Iterator[tuple[Session, Link, arcos.PacketParser]]:
    """A session with a robot, and its link."""
    with robot, closing(open_link(robot.link.name)) as link:
        parser = arcos.PacketParser()
        yield Handshake(link, parser, log=robot.lines.append, **options).run(), link, parser


def has_report(link: Link, parser: arcos.PacketParser) -> bool:
    end_s = time.monotonic() + 5.0
    while time.monotonic() < end_s:
        if any(map(Sip.is_sip, parser.feed(link.receive(0.1)))):
            return True
    return False


@pytest.mark.parametrize("subclass", ["p3at", "p3at-sh"])
def test_over_tcp_the_robot_is_met_with_its_own_factors(subclass: str) -> None:
    robot = ServedRobot(TcpLink(0), subclass=subclass)
    with met(robot) as (session, link, parser):
        assert session.identity.subclass == subclass and session.robot is arcos.ROBOTS[subclass]
        assert session.config is not None and session.config.top_speed_mmps == 1200
        assert has_report(link, parser)
        assert robot.firmware.is_open and not robot.firmware.controller.motion.motors_on
    said = robot.commands()
    opened = said.index((Code.OPEN, 1))
    assert said[:4] == said[opened + 1 : opened + 5] == STOPS
    assert Code.HOSTBAUD not in dict(said)


def test_over_a_serial_line_it_goes_on_faster() -> None:
    robot = ServedRobot(TerminalLink())
    with met(robot) as (session, link, parser):
        assert has_report(link, parser)
        assert (Code.HOSTBAUD, 2) in robot.commands() and BAUDS[2] == session.robot.baud == 38400
        assert robot.firmware.controller.baud == 38400
    assert robot.firmware.parser.skipped == len(b"WMS2\r") and robot.firmware.parser.bad == 0


@pytest.mark.parametrize("kind", ["tcp", "pty"])
def test_a_robot_that_is_still_open_and_driving_is_stopped_before_anything_else(kind: str) -> None:
    robot = ServedRobot(TcpLink(0) if kind == "tcp" else TerminalLink())
    with robot:
        first = Client(TcpWire(robot.link.port) if isinstance(robot.link, TcpLink) else TerminalWire(robot.link.name))
        first.connect()
        first.send(order(Code.ENABLE, 1), order(Code.VEL, 200))
        first.drive_until(lambda sip: sip.left_mmps > 150)
        first.close()
        count = len(robot.heard)
        with closing(open_link(robot.link.name)) as link:
            session = Handshake(link, arcos.PacketParser(), quieten=True).run()
            assert session.identity.subclass == "p3at"
            said = robot.commands()[count:]
            assert said[:4] == STOPS and said.index((Code.PULSE, None)) > 3
            assert robot.firmware.wheels.speed_mps == 0 and not robot.firmware.controller.motion.motors_on


def test_a_robot_that_answers_syncs_with_reports_is_closed_and_met() -> None:
    robot = ServedRobot(TerminalLink())
    with robot:
        first = Client(TerminalWire(robot.link.name))
        first.connect()
        first.close()
        with closing(open_link(robot.link.name)) as link:
            Handshake(link, arcos.PacketParser(), log=robot.lines.append, quieten=False).run()
    assert any("still open" in line for line in robot.lines)
    # Its first SYNC was a PULSE: the robot is held before it hears another word.
    said = robot.commands()
    assert said[said.index((Code.PULSE, None), 4) + 1 :][:4] == STOPS


class Odd(ListeningFirmware):
    """answer: what becomes of each answer."""

    def __init__(self, answer: Callable[[bytes, bytes], bytes], subclass: str = "p3at-sh") -> None:
        super().__init__(subclass)
        self._answer = answer

    def receive(self, data: bytes, now_s: float) -> bytes:
        return self._answer(data, super().receive(data, now_s)) if data else b""


def test_a_robot_without_config_is_driven_at_its_first_speed() -> None:
    def silent_on_config(_: bytes, answer: bytes) -> bytes:
        return b"" if answer[3:4] == b"\x20" else answer

    robot = ServedRobot(TerminalLink(), firmware=Odd(silent_on_config))
    with met(robot) as (session, link, parser):
        assert session.config is None
        assert has_report(link, parser)
    assert Code.HOSTBAUD not in dict(robot.commands())


def test_a_config_that_is_lost_is_asked_for_again() -> None:
    lost: list[bytes] = []

    def loses_one(_: bytes, answer: bytes) -> bytes:
        if answer[3:4] == b"\x20" and not lost:
            lost.append(answer)
            return b""
        return answer

    with met(ServedRobot(TcpLink(0), firmware=Odd(loses_one))) as (session, _, _):
        assert lost and session.config is not None


def test_a_robot_with_a_laser_has_the_factors_of_the_one_without() -> None:
    robot = ServedRobot(TcpLink(0))
    robot.firmware.identity = arcos.Identity("Old", "Pioneer", "P3AT-SH-lms500")
    with met(robot) as (session, _, _):
        assert session.robot is arcos.ROBOTS["p3at-sh"]


def test_reports_and_unknown_packets_around_the_answers_do_no_harm() -> None:
    sip = arcos.packet(Sip(False, *([0] * 10), sonars=()).body())
    other = arcos.packet(b"\x90hello") + b"\xfa\xfb\xfa" + arcos.packet(b"\xf0")

    robot = ServedRobot(TcpLink(0), firmware=Odd(lambda _, answer: sip + other + answer + other + sip))
    with met(robot) as (session, link, parser):
        assert session.config is not None and has_report(link, parser)


def test_a_sync_that_is_lost_starts_again_from_the_first() -> None:
    lost: list[bytes] = []

    def loses_one(data: bytes, answer: bytes) -> bytes:
        if answer == arcos.SYNC1 and not lost:
            lost.append(answer)
            return b""
        return answer

    robot = ServedRobot(TcpLink(0), firmware=Odd(loses_one))
    with met(robot):
        pass
    syncs = [code for code, argument in robot.commands() if code in (0, 1) and argument is None]
    assert lost and syncs[:4] == [0, 1, 0, 1]


def test_a_robot_of_an_unknown_kind_is_refused_with_the_choices() -> None:
    robot = ServedRobot(TcpLink(0))
    robot.firmware.identity = arcos.Identity("Old", "Pioneer", "p2at")
    with (
        pytest.raises(RobotError, match=r"Old .*no robot of the subclass 'p2at'; choose from: p3at, p3at-sh"),
        met(robot),
    ):
        pass
    assert not robot.firmware.is_open


class Picky(TcpLink):
    """Hangs up on who does not begin with SYNC0."""

    begun = False

    def poll(self) -> News:
        news = super().poll()
        self.begun = self.begun or news.data.startswith(arcos.SYNC0)
        if news.data and not self.begun:
            self._hang_up()
            return News(left=True)
        return news


def test_a_robot_that_hangs_up_on_a_stop_can_be_asked_without() -> None:
    robot = ServedRobot(Picky(0))
    with pytest.raises(LinkError, match="hung up"), met(robot):
        pass
    robot = ServedRobot(Picky(0))
    with met(robot, quieten=False) as (session, _, _):
        assert session.identity.subclass == "p3at"


class Slow(ListeningFirmware):
    """Does not follow to a new speed: it takes all for noise until .9 s were silent."""

    deaf = False
    byte_s = 0.0

    def receive(self, data: bytes, now_s: float) -> bytes:
        if not data:
            return b""
        self.deaf = self.deaf and now_s - self.byte_s < 0.9
        self.byte_s = now_s
        if self.deaf:
            return b""
        count = len(self.heard)
        answer = super().receive(data, now_s)
        self.deaf = any(each.command.code == Code.HOSTBAUD for each in self.heard[count:])
        return answer

    def report_due(self, now_s: float) -> bool:
        return super().report_due(now_s) and not (self.deaf and now_s - self.byte_s < 0.9)


def test_a_robot_that_does_not_follow_to_the_faster_line_is_met_at_the_first_speed() -> None:
    robot = ServedRobot(TerminalLink(), firmware=Slow())
    with met(robot) as (_, link, parser):
        assert has_report(link, parser)
        assert robot.firmware.is_open and link.byte_s == 0.0
    assert any("does not follow to 38400 baud" in line for line in robot.lines)


def test_nobody_answering_is_said_with_what_to_look_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(handshake, "ATTEMPTS", 2)
    robot = ServedRobot(TcpLink(0), firmware=Odd(lambda *_: b""))
    with (
        pytest.raises(RobotError, match=r"no robot answers on 127\.0\.0\.1:\d+: is it switched on, and this"),
        met(robot),
    ):
        pass


def test_it_gives_up_when_it_is_told_to() -> None:
    with closing(TcpLink(0)) as deaf, closing(open_link(deaf.name)) as link:
        start_s = time.monotonic()
        with pytest.raises(LinkError, match="given up"):
            Handshake(link, arcos.PacketParser(), going=lambda: time.monotonic() < start_s + 0.3).run()
        assert time.monotonic() - start_s < 2.0
