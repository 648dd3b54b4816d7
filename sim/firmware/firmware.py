"""The controller's talk, a state machine: bytes from a client and senses in, bytes and wheel speeds out."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from math import pi, remainder

import arcos
from arcos import Code, Command, Flag
from arcos.commands import BAUDS

from .controller import Controller
from .senses import Senses, SipWriter, Wheels

WATCHDOG_S = 2.0
HALF_PACKET_S = 0.25
"""At 9600 baud the longest packet takes 0.22 s: one that has not ended by then never will."""
BAUD_SILENCE_S = 0.9
"""A serial line that is silent for this long goes back to its first speed."""
POSITION_BITS = {"p3at": 15, "p3at-sh": 16}
E_STOP_FLAG = 1 << 5
_EARLY_S = 1e-6
"""Times are sums of ticks, which round."""


class Stage(Enum):
    """How far a connection has come: the packet that the controller waits for, or that it is open."""

    SYNC0 = auto()
    SYNC1 = auto()
    SYNC2 = auto()
    OPENING = auto()
    OPEN = auto()


@dataclass
class Counts:
    """Packets that had no effect: commands that are not known here, and arguments that make no sense."""

    unknown: int = 0
    malformed: int = 0


class Firmware:
    """One robot's firmware, of a subclass in arcos.ROBOTS. Times are seconds since any moment and never go back.

    Call `receive` with what a client sent and `tick` after each tick of tick_s; `wheels` says what to do in the next
    one; call `report` whenever `report_due`. A client that vanishes is noticed by the watchdog alone, as on a serial
    line; `hang_up` is for links that notice. A robot that falls is for `fall` to tell; the next client that opens the
    robot gets a new one, and `has_fallen` is false from then on.
    """

    def __init__(self, subclass: str = "p3at", *, name: str = "stereogrid", tick_s: float = 1 / 30) -> None:
        self.robot = arcos.robot_of(subclass)
        self.identity = arcos.Identity(name, "Pioneer", subclass)
        self.config = arcos.ConfigReply(
            subtype=subclass,
            name=name,
            top_speed_mmps=self.robot.max_mmps,
            top_turn_degps=self.robot.max_turn_degps,
            watchdog_ms=round(1000 * WATCHDOG_S),
        )
        self._config_reply = arcos.packet(self.config.body())
        self.parser = arcos.PacketParser()
        self.counts = Counts()
        self.stage = Stage.SYNC0
        self.tick_s = tick_s
        self.controller = Controller(self.robot, self.config, tick_s)
        self._writer = SipWriter(self.robot, POSITION_BITS[subclass])
        self._heard_s = self._byte_s = self._report_s = 0.0

    @property
    def wheels(self) -> Wheels:
        """What the wheels shall do in the next tick."""
        return self.controller.motion.wheels

    @property
    def is_open(self) -> bool:
        """Whether a client has opened the robot."""
        return self.stage is Stage.OPEN

    @property
    def has_fallen(self) -> bool:
        """Whether the robot lies, and nobody has opened a new one since."""
        return self.controller.motion.fallen

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Take what came over the link; the answer, to be sent at once."""
        if not data:
            return b""
        self._byte_s = now_s
        return self._take(self.parser.feed(data), now_s)

    def hang_up(self) -> None:
        """The link is gone: the next client starts at SYNC0. The robot goes on until the watchdog stops it."""
        self.stage = Stage.SYNC0
        # What one client left half said is not the next one's.
        self.parser.give_up()

    def fall(self) -> None:
        """The robot fell and lies."""
        self.controller.motion.fall()

    def tick(self, senses: Senses, now_s: float) -> bytes:
        """A tick is over, and this is what the body felt; answers to packets whose end was waited for in vain."""
        answer = b""
        silent_s = now_s - self._byte_s
        if silent_s > BAUD_SILENCE_S:
            self.controller.baud = BAUDS[0]
        if self.parser.pending and silent_s > HALF_PACKET_S:
            answer = self._take(self.parser.give_up(), now_s)
        turned_rad = remainder(senses.place.heading_rad - self.controller.place.heading_rad, 2 * pi)
        self.controller.place = senses.place
        unheard = now_s - self._heard_s > WATCHDOG_S - _EARLY_S
        self.controller.motion.advance(senses, turned_rad, paused=unheard)
        return answer

    def report_due(self, now_s: float) -> bool:
        """Whether it is time for a SIP."""
        return self.is_open and now_s > self._report_s - _EARLY_S

    def report(self, senses: Senses, sonar_m: Sequence[float], now_s: float) -> bytes:
        """A SIP as a packet; sonar_m: the ranges of all sonars."""
        cycle_s = self.config.sip_cycle_ms / 1000
        self._report_s += cycle_s
        if self._report_s < now_s:
            # What a standstill missed is not made up for.
            self._report_s = now_s + cycle_s
        controller, motion = self.controller, self.controller.motion
        flags = Flag.MOTORS_ON * motion.motors_on | E_STOP_FLAG * motion.e_stopped | Flag.SONARS * controller.sonars_on
        sip = self._writer.sip(
            senses,
            controller.seen_place,
            sonar_m if controller.sonars_on else (),
            stalled=motion.stalled,
            flags=int(flags),
        )
        return arcos.packet(sip.body())

    def _take(self, bodies: list[bytes], now_s: float) -> bytes:
        return b"".join(self._obey(body, now_s) if self.is_open else self._greet(body, now_s) for body in bodies)

    def _greet(self, body: bytes, now_s: float) -> bytes:
        """The handshake; whatever comes out of turn starts it again."""
        if body == b"\0":
            self.stage = Stage.SYNC1
            return arcos.packet(body)
        if body == b"\1" and self.stage is Stage.SYNC1:
            self.stage = Stage.SYNC2
            return arcos.packet(body)
        if body == b"\2" and self.stage is Stage.SYNC2:
            self.stage = Stage.OPENING
            return arcos.packet(self.identity.body())
        opens = body[0] == Code.OPEN and self.stage is Stage.OPENING
        self.stage = Stage.SYNC0
        if opens:
            self._open(now_s)
        return b""

    def _open(self, now_s: float) -> None:
        """A client has the robot: motors off, settings as after switching on, and here is (0, 0, 0).

        An emergency stop outlives the connection that asked for it, but not a robot that fell.
        """
        last = self.controller
        self.controller = Controller(self.robot, self.config, self.tick_s)
        self.controller.baud = last.baud
        if not last.motion.fallen:
            self.controller.place = self.controller.origin = last.place
            self.controller.motion.e_stopped = last.motion.e_stopped
        self.stage = Stage.OPEN
        self._heard_s = now_s
        self._report_s = now_s + self.config.sip_cycle_ms / 1000

    def _obey(self, body: bytes, now_s: float) -> bytes:
        """One packet of an open connection; even one without sense keeps the watchdog quiet."""
        self._heard_s = now_s
        try:
            command = Command.decode(body)
            if command.code == Code.CONFIG:
                return self._config_reply
            if command.code == Code.CLOSE:
                self.controller.motion.enable(False)
                self.stage = Stage.SYNC0
            elif not self.controller.obey(command):
                self.counts.unknown += 1
        except arcos.ArcosError:
            self.counts.malformed += 1
        return b""
