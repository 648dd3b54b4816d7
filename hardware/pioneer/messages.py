"""What goes between a caller and the driver's process: one JSON object a datagram, over a socket pair.

To the driver: {"number": n, "do": name, "with": arguments, "asks": whether a reply is waited for}. To the caller:
{"report": ...}, {"log": line}, {"status": ..., "seen": the number of the newest message that it knows of}, and
{"reply": n, "error": [kind, message] or null} with a status.
"""

import json
import socket
from dataclasses import asdict
from typing import Any

from stereogrid.errors import InvalidInputError, MissingExtraError, StereogridError
from stereogrid.observation import Odometry

from ..errors import RobotError
from .robot import RobotReport, RobotStatus

Message = dict[str, Any]
MOST_BYTES = 1 << 16
NO_WAIT = socket.MSG_DONTWAIT
ERRORS = {kind.__name__: kind for kind in (InvalidInputError, MissingExtraError, RobotError)}


def pair() -> tuple[socket.socket, socket.socket]:
    """The two ends; datagrams stay whole, and an end whose owner dies reads as closed."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def encoded(message: Message) -> bytes:
    """A message as a datagram."""
    return json.dumps(message).encode()


def receive(channel: socket.socket) -> Message | None:
    """The next message; None once the other end is closed. Raises TimeoutError as the socket does."""
    try:
        data = channel.recv(MOST_BYTES)
    except ConnectionError:
        return None
    if not data:
        return None
    message: Message = json.loads(data)
    return message


def report_fields(report: RobotReport) -> Message:
    """A report as JSON takes it; floats come out of it as they went in."""
    fields = asdict(report)
    fields["odometry"]["T_odom_base"] = report.odometry.T_odom_base.tolist()
    return fields


def report_of(fields: Message) -> RobotReport:
    """The report again."""
    return RobotReport(
        **{
            **fields,
            "odometry": Odometry(**fields["odometry"]),
            "stalled": tuple(fields["stalled"]),
            "sonar_m": {int(number): range_m for number, range_m in fields["sonar_m"].items()},
        }
    )


def status_of(fields: Message) -> RobotStatus:
    """A status that asdict took apart."""
    return RobotStatus(**fields)


def error_fields(error: StereogridError) -> list[str]:
    """An error's kind and what it says."""
    return [type(error).__name__, str(error)]


def error_of(fields: list[str]) -> StereogridError:
    """The error again, of the same kind where a caller knows it."""
    kind, message = fields
    return ERRORS.get(kind, RobotError)(message)
