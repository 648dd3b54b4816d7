"""What the rest of the program sees of a robot: reports that come, a velocity to ask for, and why it may not move."""

from dataclasses import dataclass
from typing import Protocol

from stereogrid.observation import Odometry

from ..mailbox import Mailbox


@dataclass(frozen=True)
class RobotReport:
    """One report (SIP) in metres, radians and volts.

    stamp_s: when it was sent, as well as that can be told, on hardware.clock: its arrival less its time on the wire.
    odometry: since the connection, unwrapped. odometry_lost: how often so far a gap in the reports left the motion
    unknown: where it differs between two reports, so may their poses by anything. sonar_m: newest range of each sonar
    by its number, of those in this report. fault: what in the report itself forbids motion ("front bumper 3", "left
    wheel stalls", "e-stop", "battery 11.2 V"), "" for nothing.
    """

    stamp_s: float
    odometry: Odometry
    odometry_lost: int
    speed_mps: float
    turn_radps: float
    battery_v: float
    motors_on: bool
    e_stopped: bool
    stalled: tuple[bool, bool]
    front_bumpers: int
    rear_bumpers: int
    sonar_m: dict[int, float]
    fault: str = ""


@dataclass(frozen=True)
class RobotStatus:
    """The driver's own state. connected: reports come. armed: it may move. latched: why it may not until `reset`,
    "" for nothing; counts: packets and their kinds of trouble so far, by name, for status lines and logs.
    """

    connected: bool
    armed: bool
    latched: str
    counts: dict[str, int]


class RobotDriver(Protocol):
    """A robot. Every call may come from any thread and returns at once, but for `arm` and `close`."""

    def arm(self, timeout_s: float = 2.0) -> None:
        """Motors on, confirmed by the robot. Raises RobotError with the reason where it may not or does not."""

    def disarm(self) -> None:
        """Stop, motors off."""

    def drive(self, speed_mps: float, turn_radps: float) -> None:
        """Ask for a velocity, which holds for .5 s. Clamped to the limits; raises InvalidInputError for NaN or inf,
        RobotError when not armed or latched."""

    def stop(self) -> None:
        """Velocity 0 at once; stays armed."""

    def e_stop(self, reason: str = "asked for") -> None:
        """Emergency stop, latched."""

    def reset(self) -> None:
        """Forget what is latched, once its cause is gone; the robot must be armed again. Raises RobotError else."""

    def latest(self) -> RobotReport | None:
        """The newest report."""

    def status(self) -> RobotStatus:
        """The driver's state."""

    def odometry_at(self, stamp_s: float) -> Odometry | None:
        """The odometry at a moment between two reports, interpolated; None where it is not known (yet)."""

    def subscribe(self, most: int = 64) -> Mailbox[RobotReport]:
        """A mailbox of the reports from now on."""

    def close(self) -> None:
        """VEL 0, RVEL 0, ENABLE 0, CLOSE; then the link. Again: nothing."""
