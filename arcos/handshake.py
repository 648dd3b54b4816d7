"""How a connection starts: SYNC0 and SYNC1 are echoed, SYNC2 is answered with the robot's names, then OPEN."""

from dataclasses import astuple, dataclass

from .errors import ArcosError
from .fields import Reader, text_bytes
from .packets import packet

SYNC0, SYNC1, SYNC2 = (packet(bytes([k])) for k in range(3))
"""The three packets; the same bytes are PULSE, OPEN and CLOSE of a robot that is open."""
IDENTITY = 0x02


@dataclass(frozen=True)
class Identity:
    """The robot's answer to SYNC2: its own name, its class and its subclass, a key of ROBOTS."""

    name: str
    robot_class: str
    subclass: str

    def __post_init__(self) -> None:
        self.body()

    def body(self) -> bytes:
        """The body of its packet."""
        return bytes([IDENTITY]) + b"".join(text_bytes(text) for text in astuple(self))

    @staticmethod
    def decode(body: bytes) -> "Identity":
        """The names in a body. Raises ArcosError when it is no answer to SYNC2."""
        if body[:1] != bytes([IDENTITY]) or len(body) == 1:
            raise ArcosError("the body is no answer to SYNC2")
        # The last 0 is left out by some.
        reader = Reader(body + b"\0", 1)
        return Identity(reader.text(), reader.text(), reader.text())
