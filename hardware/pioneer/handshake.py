"""From an open link to a robot that reports: SYNC, OPEN, CONFIG, and a faster serial line where it may be."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import arcos
from arcos import Code, Command, Sip
from arcos.commands import BAUDS
from arcos.config_reply import AUTO_BAUD, CONFIG_REPLY

from ..errors import RobotError
from .link import BAUD, Link, LinkError

SYNCS = (arcos.SYNC0, arcos.SYNC1, arcos.SYNC2)
ATTEMPTS = 6
ANSWER_S = (0.5, 0.5, 1.0)
"""How long one answer is waited for: longer and longer, for a slow radio link."""
QUIET_S = 0.15
SILENCE_S = 1.0
"""After .9 s without a byte a robot's serial line goes back to its first speed."""
BAUD_SWITCH_S = 0.01

REST = tuple(Command(code, argument).packet() for code, argument in ((Code.STOP, None), (Code.VEL, 0), (Code.RVEL, 0)))
"""What comes first wherever a connection begins: a robot whose watchdog stopped it moves on at the next packet."""
OFF = Command(Code.ENABLE, 0).packet()
CLOSE = Command(Code.CLOSE).packet()
OPEN = Command(Code.OPEN, 1).packet()
PULSE = arcos.SYNC0


@dataclass(frozen=True)
class Session:
    """Who answered: its names, its factors, and its CONFIG where it sends one."""

    identity: arcos.Identity
    robot: arcos.Robot
    config: arcos.ConfigReply | None


class Handshake:
    """One attempt to connect over a link.

    quieten: stop and close a robot that may still be open before the first SYNC; not for one that hangs up on that.
    going: asked while it waits; once false it ends in a LinkError.
    """

    def __init__(
        self,
        link: Link,
        parser: arcos.PacketParser,
        *,
        quieten: bool = True,
        log: Callable[[str], None] = lambda _: None,
        going: Callable[[], bool] = lambda: True,
    ) -> None:
        self._link, self._parser, self._quiet = link, parser, quieten
        self._log, self._going = log, going
        self._reports = 0

    def run(self) -> Session:
        """Connect. The robot stands still, with its motors off, from the first packet on.

        Raises LinkError when the link is cut, RobotError when nobody answers or the robot is of an unknown kind.
        """
        # What another link left half said is not this one's.
        self._parser.give_up()
        for attempt in range(ATTEMPTS):
            if self._link.is_serial:
                # One that was left at the speed its last client chose is found sooner.
                self._link.set_baud((BAUD, BAUDS[2])[attempt % 2])
                self._link.send(b"WMS2\r")
            if self._quiet:
                self._quieten()
            answer_s = ANSWER_S[min(attempt // 2, len(ANSWER_S) - 1)]
            identity = self._sync(answer_s)
            if identity is not None:
                robot = _robot_of(identity)
                if self._open(answer_s):
                    return self._settle(identity, robot)
            self._drain(SILENCE_S if self._link.is_serial else QUIET_S)
        look = "switched on, and its cable in HOST" if self._link.is_serial else "switched on, and this its port"
        raise RobotError(f"no robot answers on {self._link.name}: is it {look}?")

    def _sync(self, answer_s: float) -> arcos.Identity | None:
        """SYNC0, 1 and 2; None when their answers do not come, or out of sequence.

        Reports in place of an answer are those of a robot that is still open; some simulators send both.
        """
        body = b""
        for number, sync in enumerate(SYNCS):
            self._link.send(sync)
            self._reports = 0
            found = self._hear(answer_s, lambda body: body[0] <= 2, reported=self._hold)
            if found is None and self._reports:
                self._log("the robot is still open from before: closing it first")
                self._quieten()
            if found is None or found[0] != number:
                return None
            body = found
        try:
            return arcos.Identity.decode(body)
        except arcos.ArcosError:
            return None

    def _open(self, answer_s: float) -> bool:
        """Whether reports come; sent twice, for a packet may be lost."""
        for _ in range(2):
            self._link.send(b"".join((OPEN, *REST, OFF)))
            if self._hear(answer_s, Sip.is_sip) is not None:
                return True
        return False

    def _settle(self, identity: arcos.Identity, robot: arcos.Robot) -> Session:
        body = self._ask_config() or self._ask_config()
        config = None
        if body is not None:
            try:
                config = arcos.ConfigReply.decode(body)
            except arcos.ArcosError as error:
                self._log(f"the robot's CONFIG is not understood, so it is not used: {error}")
        if self._link.is_serial and config is not None and config.auto_baud == AUTO_BAUD:
            self._switch_baud(robot.baud)
        return Session(identity, robot, config)

    def _ask_config(self) -> bytes | None:
        self._link.send(Command(Code.CONFIG, 1).packet())
        return self._hear(ANSWER_S[0], lambda body: body[0] == CONFIG_REPLY)

    def _switch_baud(self, baud: int) -> None:
        """A faster line, or the first speed again where the robot does not follow."""
        self._link.send(Command(Code.HOSTBAUD, BAUDS.index(baud)).packet())
        time.sleep(BAUD_SWITCH_S)
        self._link.set_baud(baud)
        self._link.send(PULSE)
        # The first may have come, or been on its way, before the switch.
        if all(self._hear(ANSWER_S[0], Sip.is_sip) is not None for _ in range(2)):
            return
        self._log(f"the robot does not follow to {baud} baud: back to {BAUD}")
        self._link.set_baud(BAUD)
        # Nothing is sent: only silence brings the robot back.
        self._drain(SILENCE_S)
        self._link.send(PULSE)
        if self._hear(ANSWER_S[2], Sip.is_sip) is None:
            raise LinkError(f"the robot on {self._link.name} was lost when the line's speed changed")

    def _hold(self) -> None:
        """A robot that reports took SYNC0 for a PULSE, and may go on with what its watchdog had ended."""
        self._link.send(b"".join((*REST, OFF)))

    def _quieten(self) -> None:
        """Stop and close a robot that may still be open; one that is not, does not mind."""
        self._link.send(b"".join((*REST, OFF, CLOSE)))
        self._drain(QUIET_S)

    def _drain(self, duration_s: float) -> None:
        """Forget what comes for a while, and whatever was half said."""
        self._hear(duration_s, lambda _: False)
        self._parser.give_up()

    def _hear(
        self, timeout_s: float, wanted: Callable[[bytes], bool], *, reported: Callable[[], None] = lambda: None
    ) -> bytes | None:
        """The first packet's body that is wanted; others are passed over, but the first report that comes alone is
        told of.
        """
        told = False
        end_s = time.monotonic() + timeout_s
        while (left_s := end_s - time.monotonic()) > 0:
            if not self._going():
                raise LinkError("the connection was given up")
            for body in self._parser.feed(self._link.receive(min(left_s, 0.05))):
                self._reports += Sip.is_sip(body)
                if wanted(body):
                    return body
            if self._reports and not told:
                told = True
                reported()
        return None


def _robot_of(identity: arcos.Identity) -> arcos.Robot:
    try:
        return arcos.robot_of(identity.subclass)
    except arcos.ArcosError as error:
        raise RobotError(
            f"{identity.name or 'the robot'} ({identity.robot_class}) cannot be driven: {error}"
        ) from error
