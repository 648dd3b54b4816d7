"""ARCOS, the serial protocol of the Pioneer robots, as bytes in and values out: for the robot's driver and its twin.

Pure: no I/O, no threads, no clock. A link's bytes go through `PacketParser`; a body becomes a `Command` at the robot,
a `Sip`, a `ConfigReply` or an `Identity` at the client.
"""

from .commands import Code, Command, vel2, vel2_mmps
from .config_reply import ConfigReply
from .errors import ArcosError
from .handshake import SYNC0, SYNC1, SYNC2, Identity
from .packets import BODY_MAX, PacketParser, checksum, packet
from .position import heading_step, position_step
from .robots import ROBOTS, Robot, robot_of
from .sip import Flag, Sip, Sonar

__all__ = [
    "BODY_MAX",
    "ROBOTS",
    "SYNC0",
    "SYNC1",
    "SYNC2",
    "ArcosError",
    "Code",
    "Command",
    "ConfigReply",
    "Flag",
    "Identity",
    "PacketParser",
    "Robot",
    "Sip",
    "Sonar",
    "checksum",
    "heading_step",
    "packet",
    "position_step",
    "robot_of",
    "vel2",
    "vel2_mmps",
]
