"""What may move the robot, and all that stops it: a state machine without threads, links or a clock of its own."""

import math
from dataclasses import dataclass, field
from enum import Enum, auto

from arcos import Code, Command
from stereogrid.errors import InvalidInputError

from ..errors import RobotError
from .limits import Limits, clamped
from .robot import RobotReport

STALE_COMMAND_S = 0.5
SILENT_S = 0.5
"""Without a report for so long the robot is blind to its driver, and stops."""
PULSE_S = 0.25
REPEAT_S = 0.1
"""Commands are said again and again: any of them may be lost."""
REST_S = 1.5
"""The longest that a stop is waited for before the motors are switched off: off, they do not brake."""
AT_REST_MPS = 0.02
AT_REST_RADPS = math.radians(2)
OFF_S = 2.0
"""Motors that are not off by then have been switched on by somebody else, or by a simulator that knows no off."""
LOW_BATTERY_S = 2.0
"""A battery that drives hard sags for a moment; this long below the limit is empty."""


class Phase(Enum):
    """away: no connection. idle: motors off. arming: they were asked to go on. armed. stopping: to rest, then off."""

    AWAY = auto()
    IDLE = auto()
    ARMING = auto()
    ARMED = auto()
    STOPPING = auto()


@dataclass
class Safety:
    """Says in each `tick` what the robot is told. All times are seconds on one clock and never go back.

    phase; latched: why it may not be armed until `reset`; refused: why the last arming failed; stale_commands: how
    often a velocity was dropped because no newer one came. news: latches since it was last emptied, for the user.
    """

    limits: Limits = field(default_factory=Limits)
    phase: Phase = Phase.AWAY
    latched: str = ""
    refused: str = ""
    stale_commands: int = 0
    news: list[str] = field(default_factory=list)
    _report: RobotReport | None = None
    _heard_s: float = -math.inf
    _asked: tuple[float, float, float] = (0.0, 0.0, -math.inf)
    _emergency: bool = False
    _since_s: float = 0.0
    _until_s: float = 0.0
    _low_since_s: float | None = None
    _off: bool = False
    _said: tuple[int, int] | None = None
    _say_s: float = -math.inf
    _pulse_s: float = -math.inf
    _alarm: bool = False

    # What happens to it

    def opened(self, limits: Limits, now_s: float) -> None:
        """A connection, new or again: the robot was told to stop and to switch its motors off."""
        self.limits = limits
        self._report, self._heard_s = None, now_s
        self._pulse_s = -math.inf
        self.halt()
        self._rest(now_s)

    def lost(self) -> None:
        """The connection is gone: nothing of what was asked for survives it, but a latch."""
        self.phase = Phase.AWAY
        self._report = None
        self.refused = "the connection to the robot is lost"
        self.halt()

    def hear(self, report: RobotReport, now_s: float) -> None:
        """A report came."""
        self._report, self._heard_s = report, now_s
        if self.phase is Phase.ARMING:
            self._hear_arming(report, now_s)
        elif self.phase is Phase.ARMED:
            self._hear_armed(report, now_s)
        elif self.phase is Phase.STOPPING:
            settled = abs(report.speed_mps) < AT_REST_MPS and abs(report.turn_radps) < AT_REST_RADPS
            # The report after the next: the first may tell of the time before the stop.
            if settled and now_s > self._since_s + REPEAT_S:
                self._rest(now_s)
        elif self.phase is Phase.IDLE and not report.motors_on:
            self._off = True

    # What the caller asks for

    def is_silent(self, now_s: float) -> bool:
        """Whether no report came for too long."""
        return now_s - self._heard_s > SILENT_S

    def arm(self, now_s: float, timeout_s: float) -> None:
        """Begin to arm; `phase` tells how it ends, and `refused` why when it ends as IDLE. Raises RobotError."""
        if self.phase is Phase.ARMED:
            return
        reason = self._forbidden(now_s)
        if reason:
            raise RobotError(f"the robot may not be armed: {reason}")
        self.phase, self.refused = Phase.ARMING, ""
        self._since_s, self._until_s = now_s, now_s + timeout_s
        self._say_s = -math.inf
        self.halt()

    def disarm(self, now_s: float) -> None:
        """Stop, then motors off."""
        self._stop_for("it was disarmed", now_s)

    def drive(self, speed_mps: float, turn_radps: float, asked_s: float, now_s: float) -> None:
        """A velocity that was asked for at asked_s. Raises InvalidInputError or RobotError, see RobotDriver."""
        check_velocity(speed_mps, turn_radps)
        if self.latched:
            raise RobotError(f"the robot does not drive: {self.latched}; reset and arm it once that is mended")
        if self.phase is not Phase.ARMED:
            raise RobotError("the robot does not drive: it is not armed")
        if self.is_silent(now_s):
            raise RobotError(f"the robot does not drive: no report came from it for {now_s - self._heard_s:.1f} s")
        limits = self.limits
        self._asked = clamped(speed_mps, limits.speed_mps), clamped(turn_radps, limits.turn_radps), min(asked_s, now_s)

    def halt(self) -> None:
        """Velocity 0."""
        self._asked = 0.0, 0.0, -math.inf

    def e_stop(self, reason: str, now_s: float) -> None:
        """Emergency stop, latched; said to the robot until `reset`."""
        self._emergency = True
        self._latch(f"e-stop ({reason})", now_s)
        self._say_s = -math.inf

    def fault(self, reason: str, now_s: float) -> None:
        """Stop and latch, whatever the phase."""
        self._latch(reason, now_s)

    def reset(self, now_s: float) -> None:
        """See RobotDriver. The e-stop's own bit, which the robot holds until its motors are enabled, is no cause."""
        cause = self._report.fault if self._report else ""
        if cause and cause != "e-stop":
            raise RobotError(f"the robot cannot be reset: {cause}")
        if self.phase is Phase.AWAY or self.is_silent(now_s):
            raise RobotError("the robot cannot be reset: no reports come from it")
        self.latched, self._emergency = "", False

    # What the robot is told

    def tick(self, now_s: float) -> list[Command]:
        """The commands to send now, in their order; call it at least every .05 s."""
        if self.phase is Phase.AWAY:
            return []
        self._watch(now_s)
        said: list[Command] = []
        moving = self.phase in (Phase.ARMED, Phase.ARMING, Phase.STOPPING)
        velocity = self._velocity()
        due = now_s >= self._say_s + REPEAT_S - 1e-6
        if due or (moving and velocity != self._said):
            # Velocities come before anything else: the first packet after a pause may set the robot going.
            said += self._say(velocity, moving)
            self._say_s, self._said = now_s, velocity
        if now_s >= self._pulse_s + PULSE_S - 1e-6:
            said.append(Command(Code.PULSE))
            self._pulse_s = now_s
        return said

    def _say(self, velocity: tuple[int, int], moving: bool) -> list[Command]:
        said = [Command(Code.E_STOP)] if self._emergency else []
        if moving:
            if self._alarm:
                said.append(Command(Code.STOP))
            said += [Command(Code.VEL, velocity[0]), Command(Code.RVEL, velocity[1])]
        if self.phase is Phase.ARMING:
            said += [*self._settings(), Command(Code.ENABLE, 1)]
        elif self.phase is Phase.IDLE and not self._off:
            said.append(Command(Code.ENABLE, 0))
        return said

    def _watch(self, now_s: float) -> None:
        """Everything that passes by itself."""
        if self.phase is Phase.ARMED:
            speed_mps, turn_radps, asked_s = self._asked
            if now_s - asked_s > STALE_COMMAND_S:
                self.stale_commands += bool(speed_mps or turn_radps)
                self.halt()
            if self.is_silent(now_s):
                self.halt()
                self._alarm = True
        elif self.phase is Phase.ARMING and now_s > self._until_s:
            self._stop_for(self._unarmed(now_s), now_s)
        elif self.phase is Phase.STOPPING and now_s > self._until_s:
            self._rest(now_s)
        elif self.phase is Phase.IDLE and now_s > self._until_s:
            self._off = True

    def _velocity(self) -> tuple[int, int]:
        if self.phase is not Phase.ARMED:
            return 0, 0
        speed_mps, turn_radps, _ = self._asked
        limits = self.limits
        turn_degps, most_degps = math.degrees(turn_radps), math.degrees(limits.turn_radps)
        return _whole(1000 * speed_mps, 1000 * limits.speed_mps), _whole(turn_degps, most_degps)

    def _settings(self) -> list[Command]:
        limits = self.limits
        return [
            Command(Code.SETA, _ramp(1000 * limits.acceleration_mps2)),
            Command(Code.SETA, -_ramp(1000 * limits.deceleration_mps2)),
            Command(Code.SETRA, _ramp(math.degrees(limits.turn_acceleration_radps2))),
            Command(Code.SETRA, -_ramp(math.degrees(limits.turn_deceleration_radps2))),
            Command(Code.BUMPSTALL, 3),
        ]

    # How it gets from phase to phase

    def _forbidden(self, now_s: float) -> str:
        """Why the robot may not be armed now."""
        if self.phase is Phase.AWAY:
            return "it is not connected"
        if self.latched:
            return f"{self.latched} (reset it first)"
        if self._report is None or self.is_silent(now_s):
            return "no reports come from it"
        if self._report.battery_v < self.limits.low_battery_v:
            return f"battery {self._report.battery_v:.1f} V, below {self.limits.low_battery_v:.1f} V: charge it"
        # The e-stop's bit goes when the motors are enabled, or else they never are.
        return self._report.fault if self._report.fault != "e-stop" else ""

    def _unarmed(self, now_s: float) -> str:
        """Why arming took too long."""
        if self._report is None or self.is_silent(now_s):
            return "no reports come from it"
        return "its e-stop is pressed" if self._report.e_stopped else "it does not say that its motors are on"

    def _hear_arming(self, report: RobotReport, now_s: float) -> None:
        if _touched(report):
            self._latch(report.fault, now_s)
        elif report.motors_on and not report.e_stopped and now_s > self._since_s + REPEAT_S:
            self.phase, self._alarm, self._low_since_s = Phase.ARMED, False, None

    def _hear_armed(self, report: RobotReport, now_s: float) -> None:
        self._alarm = False
        low = report.battery_v < self.limits.low_battery_v
        if not low:
            self._low_since_s = None
        elif self._low_since_s is None:
            self._low_since_s = now_s
        if report.e_stopped or _touched(report):
            self._latch(report.fault, now_s)
        elif not report.motors_on:
            self._latch("the robot switched its motors off", now_s)
        elif self._low_since_s is not None and now_s - self._low_since_s >= LOW_BATTERY_S:
            self._latch(report.fault, now_s)

    def _latch(self, reason: str, now_s: float) -> None:
        if not self.latched:
            self.latched = reason
            self.news.append(f"stopped: {reason}")
        self._stop_for(self.latched, now_s)

    def _stop_for(self, reason: str, now_s: float) -> None:
        self.halt()
        if self.phase in (Phase.ARMED, Phase.ARMING):
            self.phase, self.refused = Phase.STOPPING, reason
            self._since_s, self._until_s = now_s, now_s + REST_S
            self._say_s, self._alarm = -math.inf, True

    def _rest(self, now_s: float) -> None:
        """At rest: motors off."""
        self.phase, self._off, self._alarm = Phase.IDLE, False, False
        self._until_s = now_s + OFF_S
        self._say_s = -math.inf


def _touched(report: RobotReport) -> bool:
    return any(report.stalled) or bool(report.front_bumpers or report.rear_bumpers)


def check_velocity(speed_mps: float, turn_radps: float) -> None:
    """Raise InvalidInputError for a velocity that is no number."""
    for name, value in (("speed_mps", speed_mps), ("turn_radps", turn_radps)):
        if not math.isfinite(value):
            raise InvalidInputError(f"{name} must be finite, not {value}")


def _whole(value: float, most: float) -> int:
    """value as a whole number that is not beyond +-most."""
    return int(clamped(round(value), math.floor(most + 1e-6)))


def _ramp(value: float) -> int:
    """A ramp as a whole number: 0 would mean none to the robot."""
    return max(1, math.floor(value + 1e-6))
