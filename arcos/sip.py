"""Standard SIPs, the robot's report every tenth of a second."""

import struct
from dataclasses import dataclass
from enum import IntFlag
from typing import NamedTuple

from .errors import ArcosError
from .fields import Reader, check_fits
from .packets import BODY_MAX

STOPPED, MOVING = 0x32, 0x33
_HEAD = {
    "x_raw": "H",
    "y_raw": "H",
    "heading_raw": "h",
    "left_mmps": "h",
    "right_mmps": "h",
    "battery_dv": "B",
    "stall_bumpers": "H",
    "control_raw": "h",
    "flags": "H",
    "compass_raw": "B",
}
_TAIL = {
    "gripper": "B",
    "analog_port": "B",
    "analog": "B",
    "digital_in": "B",
    "digital_out": "B",
    "battery2_dv": "H",
    "charge": "B",
    "turn_ddegps": "h",
    "fault": "H",
    "sideways_mmps": "h",
    "temperature_c": "b",
    "charge_percent": "b",
}
BUMPERS = 7
"""Bits for bumpers at either end; the P3-AT has five."""
LEFT_STALL, REAR_SHIFT, RIGHT_STALL, FRONT_SHIFT = 0x0001, 1, 0x0100, 9


class Flag(IntFlag):
    """Bits of Sip.flags."""

    MOTORS_ON = 1 << 0
    SONARS = 0b1111 << 1
    E_STOP = 0b11 << 5
    LEDGE = 0b11 << 7
    JOYSTICK = 1 << 9
    CHARGER = 1 << 10


class Sonar(NamedTuple):
    """One sonar's number and range in raw units of Robot.range_mm."""

    number: int
    range_raw: int


@dataclass(frozen=True)
class Sip:
    """One report, in the units of the wire.

    moving: the packet's type. x_raw, y_raw: position, of 15 or 16 bits that wrap, in units of Robot.distance_mm.
    heading_raw: counterclockwise, in units of Robot.angle_rad. left_mmps, right_mmps: speed of the wheels.
    battery_dv: tenths of a volt. stall_bumpers: see the properties. flags: bits of Flag. compass_raw: units of 2 deg.
    From gripper on each field may be missing with all that follow it: None. turn_ddegps: tenths of a degree a
    second. temperature_c: -127 when there is no thermometer. rest: bytes behind the last whole field.
    """

    moving: bool
    x_raw: int
    y_raw: int
    heading_raw: int
    left_mmps: int
    right_mmps: int
    battery_dv: int
    stall_bumpers: int
    control_raw: int
    flags: int
    compass_raw: int
    sonars: tuple[Sonar, ...]
    gripper: int | None = None
    analog_port: int | None = None
    analog: int | None = None
    digital_in: int | None = None
    digital_out: int | None = None
    battery2_dv: int | None = None
    charge: int | None = None
    turn_ddegps: int | None = None
    fault: int | None = None
    sideways_mmps: int | None = None
    temperature_c: int | None = None
    charge_percent: int | None = None
    rest: bytes = b""

    def __post_init__(self) -> None:
        for name, letter in _HEAD.items():
            check_fits(name, getattr(self, name), letter)
        for sonar in self.sonars:
            check_fits("a sonar's number", sonar.number, "B")
            check_fits("a sonar's range_raw", sonar.range_raw, "H")
        names = self._present_tail()
        for name in _TAIL:
            value = getattr(self, name)
            if (value is not None) != (name in names):
                raise ArcosError(f"{name} cannot follow a field that is missing")
            if value is not None:
                check_fits(name, value, _TAIL[name])
        if len(self.body()) > BODY_MAX:
            raise ArcosError(f"a SIP of {len(self.sonars)} sonars does not fit into a packet")

    @property
    def stalled(self) -> tuple[bool, bool]:
        """Whether the left and the right motor are stalled."""
        return bool(self.stall_bumpers & LEFT_STALL), bool(self.stall_bumpers & RIGHT_STALL)

    @property
    def front_bumpers(self) -> int:
        """Bits of the front bumpers that are pressed."""
        return self.stall_bumpers >> FRONT_SHIFT & (1 << BUMPERS) - 1

    @property
    def rear_bumpers(self) -> int:
        """Bits of the rear bumpers that are pressed."""
        return self.stall_bumpers >> REAR_SHIFT & (1 << BUMPERS) - 1

    @property
    def motors_on(self) -> bool:
        """Whether the robot's motors are enabled."""
        return bool(self.flags & Flag.MOTORS_ON)

    @property
    def e_stopped(self) -> bool:
        """Whether an emergency stop holds the robot."""
        return bool(self.flags & Flag.E_STOP)

    def body(self) -> bytes:
        """The body of its packet."""
        values = [getattr(self, name) for name in _HEAD]
        head = struct.pack("<B" + "".join(_HEAD.values()), MOVING if self.moving else STOPPED, *values)
        sonars = bytes([len(self.sonars)]) + b"".join(struct.pack("<BH", *sonar) for sonar in self.sonars)
        tail = self._present_tail()
        letters = "".join(_TAIL[name] for name in tail)
        return head + sonars + struct.pack(f"<{letters}", *(getattr(self, name) for name in tail)) + self.rest

    def _present_tail(self) -> list[str]:
        names = list(_TAIL)
        missing = next((k for k, name in enumerate(names) if getattr(self, name) is None), len(names))
        return names[:missing]

    @staticmethod
    def is_sip(body: bytes) -> bool:
        """Whether a packet's body is a standard SIP, by its type."""
        return body[:1] in (bytes([STOPPED]), bytes([MOVING]))

    @staticmethod
    def decode(body: bytes) -> "Sip":
        """The report in a packet's body. Raises ArcosError when it is no SIP or ends before its sonars do."""
        if not Sip.is_sip(body):
            raise ArcosError("the body is no standard SIP")
        reader = Reader(body, 1)
        head = {name: reader.integer(letter) for name, letter in _HEAD.items()}
        count = reader.integer("B")
        sonars = tuple(Sonar(reader.integer("B"), reader.integer("H")) for _ in range(count))
        tail = {}
        for name, letter in _TAIL.items():
            if not reader.holds(letter):
                break
            tail[name] = reader.integer(letter)
        return Sip(moving=body[0] == MOVING, sonars=sonars, **head, **tail, rest=reader.rest)


def stall_bumpers(*, stalled: tuple[bool, bool], front: int, rear: int) -> int:
    """Sip.stall_bumpers from its parts: stalled (left, right), bits of the front and of the rear bumpers."""
    mask = (1 << BUMPERS) - 1
    bits = (front & mask) << FRONT_SHIFT | (rear & mask) << REAR_SHIFT
    return bits | LEFT_STALL * bool(stalled[0]) | RIGHT_STALL * bool(stalled[1])
