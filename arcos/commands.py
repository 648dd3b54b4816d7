"""Commands: what a client tells the robot."""

from dataclasses import dataclass
from enum import IntEnum

from .errors import ArcosError
from .packets import BODY_MAX, packet
from .robots import Robot

POSITIVE, NEGATIVE, STRING = 0x3B, 0x1B, 0x2B
"""Argument types. A negative number is sent as its magnitude."""
WORD_MAX = 0xFFFF
STRING_MAX = BODY_MAX - 4


class Code(IntEnum):
    """The commands that robot and driver know, with their arguments' units."""

    PULSE = 0  # also SYNC0
    OPEN = 1  # also SYNC1
    CLOSE = 2  # also SYNC2
    ENABLE = 4  # 1: motors on, 0: off
    SETA = 5  # [mm/s^2]; negative: deceleration
    SETV = 6  # [mm/s]
    SETO = 7  # here is (0, 0, 0)
    MOVE = 8  # [mm]
    ROTATE = 9  # [deg/s]
    SETRV = 10  # [deg/s]
    VEL = 11  # [mm/s]
    HEAD = 12  # [deg]
    DHEAD = 13  # [deg]
    SAY = 15
    CONFIG = 18
    RVEL = 21  # [deg/s]
    SETRA = 23  # [deg/s^2]; negative: deceleration
    SONAR = 28
    STOP = 29
    VEL2 = 32  # low byte right, high byte left, both signed [Robot.vel2_mmps]
    BUMPSTALL = 44  # 0: off, 1: front, 2: rear, 3: both
    HOSTBAUD = 50  # see BAUDS
    E_STOP = 55


BAUDS = (9600, 19200, 38400, 57600, 115200)
"""The speeds that HOSTBAUD's argument counts."""


@dataclass(frozen=True)
class Command:
    """A code (0 to 255; known ones are in Code) and its argument: a number of at most 16 bits, a string, or none."""

    code: int
    argument: int | bytes | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.code <= 0xFF:
            raise ArcosError(f"a command's code must be 0 to 255, not {self.code}")
        if isinstance(self.argument, bytes):
            if len(self.argument) > STRING_MAX:
                raise ArcosError(f"a command's string has at most {STRING_MAX} bytes, not {len(self.argument)}")
        elif self.argument is not None and not -WORD_MAX <= self.argument <= WORD_MAX:
            raise ArcosError(f"a command's argument must be within +-{WORD_MAX}, not {self.argument}")

    def body(self) -> bytes:
        """The body of its packet."""
        head = bytes([self.code])
        if self.argument is None:
            return head
        if isinstance(self.argument, bytes):
            # AriaCoda ends it with a 0 that the length does not count.
            return head + bytes([STRING, len(self.argument)]) + self.argument + b"\0"
        kind = POSITIVE if self.argument >= 0 else NEGATIVE
        return head + bytes([kind]) + abs(self.argument).to_bytes(2, "little")

    def packet(self) -> bytes:
        """It as it goes over the wire."""
        return packet(self.body())

    @staticmethod
    def decode(body: bytes) -> "Command":
        """The command in a packet's body; bytes behind its argument are ignored.

        Raises ArcosError for an unknown kind of argument or one that is cut off.
        """
        if not body:
            raise ArcosError("a command needs a code")
        if len(body) == 1:
            return Command(body[0])
        kind = body[1]
        if kind == STRING:
            if len(body) < 3 or len(body) < 3 + body[2]:
                raise ArcosError(f"the string of command {body[0]} is cut off")
            return Command(body[0], body[3 : 3 + body[2]])
        if kind not in (POSITIVE, NEGATIVE):
            raise ArcosError(f"command {body[0]} has an argument of the unknown type 0x{kind:02x}")
        if len(body) < 4:
            raise ArcosError(f"the number of command {body[0]} is cut off")
        magnitude = int.from_bytes(body[2:4], "little")
        return Command(body[0], magnitude if kind == POSITIVE else -magnitude)


def vel2(left: int, right: int, *, unsigned: bool = False) -> Command:
    """VEL2 for the two sides, each -128 to 127 in Robot.vel2_mmps.

    The two bytes make a 16-bit word, which AriaCoda sends as the signed number that it is; Player sends the same word
    as if it were never negative (unsigned).
    """
    for name, side in (("left", left), ("right", right)):
        if not -128 <= side <= 127:
            raise ArcosError(f"VEL2's {name} must be -128 to 127, not {side}")
    word = (left & 0xFF) << 8 | (right & 0xFF)
    return Command(Code.VEL2, word if unsigned or word < 0x8000 else word - 0x10000)


def vel2_mmps(command: Command, robot: Robot) -> tuple[int, int]:
    """The left and the right speed [mm/s] that a VEL2 command asks for, in either encoding."""
    if not isinstance(command.argument, int):
        raise ArcosError("VEL2 needs a number")
    word = command.argument & 0xFFFF
    left, right = word >> 8, word & 0xFF
    signed = [side - 0x100 if side >= 0x80 else side for side in (left, right)]
    return signed[0] * robot.vel2_mmps, signed[1] * robot.vel2_mmps
