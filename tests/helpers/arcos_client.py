"""Clients of a robot that speaks ARCOS: one that lives in simulated time, and one over a real link."""

import os
import select
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from kinematic_body import TICK_S, KinematicBody

import arcos
from arcos import Code, Command, PacketParser, Sip
from sim.firmware.firmware import Firmware
from sim.firmware.senses import Senses

SYNCS = (arcos.SYNC0, arcos.SYNC1, arcos.SYNC2)
OPEN = Command(Code.OPEN, 1).packet()


def order(code: int, argument: int | bytes | None = None) -> bytes:
    """A command's packet."""
    return Command(code, argument).packet()


def parsed(data: bytes) -> list[bytes]:
    """The bodies in what a robot sent, none of which may be broken."""
    parser = PacketParser()
    bodies = parser.feed(data)
    assert (parser.bad, parser.skipped, parser.pending) == (0, 0, 0)
    return bodies


@dataclass
class Bench:
    """A firmware with a body, in time that passes only in `run`."""

    firmware: Firmware = field(default_factory=Firmware)
    body: KinematicBody = field(default_factory=KinematicBody)
    answers: bytes = b""
    speeds_mps: list[float] = field(default_factory=list)

    def tell(self, *packets: bytes) -> bytes:
        """Send; the answer."""
        answer = self.firmware.receive(b"".join(packets), self.body.time_s)
        self.answers += answer
        return answer

    def run(self, duration_s: float, *, pulse: bool = True) -> list[Sip]:
        """Let time pass, with a PULSE every .5 s; the SIPs that came."""
        sips = []
        for tick in range(round(duration_s / TICK_S)):
            if pulse and tick % 15 == 0:
                self.tell(arcos.SYNC0)
            self.firmware.wheels.drive(self.body)
            senses = Senses.of(self.body)
            self.answers += self.firmware.tick(senses, self.body.time_s)
            self.speeds_mps.append(float(self.body.wheel_speeds_mps.mean()))
            if self.firmware.report_due(self.body.time_s):
                packet = self.firmware.report(senses, self.body.sonar_m().tolist(), self.body.time_s)
                sips += [Sip.decode(body) for body in parsed(packet)]
        return sips

    def connect(self, *, motors: bool = True) -> "Bench":
        """Handshake and OPEN, and by default ENABLE."""
        for packet in (*SYNCS, OPEN):
            self.tell(packet)
        if motors:
            self.tell(order(Code.ENABLE, 1))
        return self


class Wire(Protocol):
    """A real link, from the client's side."""

    def fileno(self) -> int:
        """For select."""

    def read(self) -> bytes:
        """What is there; empty at the end."""

    def write(self, data: bytes) -> None:
        """All of it."""

    def close(self) -> None:
        """Hang up."""


class TcpWire:
    """A TCP connection to 127.0.0.1."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=5)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self) -> bytes:
        try:
            return self._socket.recv(65536)
        except ConnectionError:
            return b""

    def write(self, data: bytes) -> None:
        self._socket.sendall(data)

    def close(self) -> None:
        self._socket.close()


class TerminalWire:
    """A terminal opened as serial programs do it: raw, 8N1, 9600 baud."""

    def __init__(self, path: str) -> None:
        import termios
        import tty

        self._handle = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        # Not flushed: what is old is for the robot's side to keep away.
        tty.setraw(self._handle, termios.TCSANOW)
        settings = termios.tcgetattr(self._handle)
        settings[4] = settings[5] = termios.B9600
        termios.tcsetattr(self._handle, termios.TCSANOW, settings)

    def fileno(self) -> int:
        return self._handle

    def read(self) -> bytes:
        return os.read(self._handle, 65536)

    def write(self, data: bytes) -> None:
        os.write(self._handle, data)

    def close(self) -> None:
        os.close(self._handle)


class Client:
    """A client over a wire; it keeps every body that came, and reads only while it waits for something."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self.parser = PacketParser()
        self.bodies: list[bytes] = []

    def send(self, *packets: bytes) -> None:
        self.wire.write(b"".join(packets))

    def listen(self, duration_s: float, until: Callable[[bytes], bool] = lambda _: False) -> bytes | None:
        """Read for a while, or until a body comes of which until() is true: that one, else None."""
        end_s = time.monotonic() + duration_s
        while (left_s := end_s - time.monotonic()) > 0:
            if not select.select([self.wire], [], [], left_s)[0]:
                continue
            data = self.wire.read()
            if not data:
                return None
            found = self.parser.feed(data)
            self.bodies += found
            for body in found:
                if until(body):
                    return body
        return None

    def ask(self, packet: bytes, until: Callable[[bytes], bool]) -> bytes:
        """Send and wait for the answer, which must come."""
        self.send(packet)
        answer = self.listen(20.0, until)
        assert answer is not None, f"no answer to {packet.hex()}"
        return answer

    def connect(self) -> arcos.Identity:
        """Handshake and OPEN; who is there."""
        for packet in SYNCS[:2]:
            assert self.ask(packet, lambda _: True) == packet[3:-2]
        identity = arcos.Identity.decode(self.ask(SYNCS[2], lambda _: True))
        self.ask(OPEN, Sip.is_sip)
        return identity

    def sip(self, *, pulse: bool = True) -> Sip:
        """The next SIP."""
        if pulse:
            self.send(arcos.SYNC0)
        body = self.listen(20.0, Sip.is_sip)
        assert body is not None, "no SIP came"
        return Sip.decode(body)

    def drive_until(self, seen: Callable[[Sip], bool], *, within: int = 100, pulse: bool = True) -> Sip:
        """SIPs until one shows what is looked for; it must be one of the next `within`."""
        for _ in range(within):
            sip = self.sip(pulse=pulse)
            if seen(sip):
                return sip
        raise AssertionError(f"not within {within} SIPs; the last was {sip}")

    def close(self) -> None:
        self.wire.close()
