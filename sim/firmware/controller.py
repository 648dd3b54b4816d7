"""What commands do to the robot."""

from collections.abc import Callable
from math import pi, radians, remainder

import arcos
from arcos import Code, Command
from arcos.commands import BAUDS

from .motion import Axis, Motion
from .senses import Place

MM = 0.001
NUMBER_MAX = 0x7FFF
"""All arguments but VEL2's are signed 16-bit numbers."""


class Controller:
    """The settings of an open robot, its motion, and the place that its client calls (0, 0, 0).

    place: where the robot is, in the frame odom. baud: of a serial line, in name only.
    """

    def __init__(self, robot: arcos.Robot, config: arcos.ConfigReply, tick_s: float) -> None:
        self.robot = robot
        self.motion = Motion(_driving(config), _turning(config), tick_s)
        self.place = self.origin = Place()
        self.sonars_on = True
        self.baud = BAUDS[0]

    @property
    def seen_place(self) -> Place:
        """Where its client believes the robot is."""
        return self.place.seen_from(self.origin)

    def obey(self, command: Command) -> bool:
        """Do as told; False for a command that is not known here. Raises ArcosError for an argument without sense.

        While the motors are off, commands to move are heard and forgotten.
        """
        if command.code in _MOTIONS:
            if self.motion.motors_on:
                _MOTIONS[Code(command.code)](self, command)
        elif command.code in _SETTINGS:
            _SETTINGS[Code(command.code)](self, command)
        else:
            return False
        return True

    def stop(self) -> None:
        """Come to rest by the ramps."""
        self.motion.driving.go(0.0)
        self.motion.turning.go(0.0)

    def head(self, heading_rad: float) -> None:
        """Turn the short way to a heading, in the client's frame."""
        self.motion.turning.travel(remainder(heading_rad - self.seen_place.heading_rad, 2 * pi))

    def set_origin(self) -> None:
        """Here is (0, 0, 0)."""
        self.origin = self.place

    def drive_sides(self, command: Command) -> None:
        """VEL2."""
        left_mps, right_mps = (MM * side for side in arcos.vel2_mmps(command, self.robot))
        self.motion.driving.go(0.5 * (left_mps + right_mps))
        self.motion.turning.go((right_mps - left_mps) / self.robot.effective_track_m)

    def switch_sonars(self, argument: int) -> None:
        """SONAR: bit 0 switches; which array the other bits choose makes no difference."""
        self.sonars_on = bool(argument & 1)

    def switch_baud(self, argument: int) -> None:
        """HOSTBAUD."""
        if not 0 <= argument < len(BAUDS):
            raise arcos.ArcosError(f"HOSTBAUD must be 0 to {len(BAUDS) - 1}, not {argument}")
        self.baud = BAUDS[argument]

    def set_bump_stall(self, argument: int) -> None:
        """BUMPSTALL."""
        self.motion.bump_stall = argument & 3


def _driving(config: arcos.ConfigReply) -> Axis:
    return Axis(
        top=MM * config.top_speed_mmps,
        top_ramp=MM * config.top_acceleration_mmps2,
        rate_max=MM * config.max_speed_mmps,
        acceleration=MM * config.acceleration_mmps2,
        deceleration=MM * config.deceleration_mmps2,
        exact=0.002,
    )


def _turning(config: arcos.ConfigReply) -> Axis:
    return Axis(
        top=radians(config.top_turn_degps),
        top_ramp=radians(config.top_turn_acceleration_degps2),
        rate_max=radians(config.max_turn_degps),
        acceleration=radians(config.turn_acceleration_degps2),
        deceleration=radians(config.turn_deceleration_degps2),
        exact=radians(0.2),
    )


def _number(command: Command) -> int:
    argument = command.argument
    if not isinstance(argument, int) or abs(argument) > NUMBER_MAX:
        raise arcos.ArcosError(f"command {command.code} needs a signed 16-bit number, not {argument!r}")
    return argument


def _bare(act: Callable[[Controller], None]) -> Callable[[Controller, Command], None]:
    """An act that looks at no argument."""
    return lambda controller, _: act(controller)


def _numbered(act: Callable[[Controller, int], None]) -> Callable[[Controller, Command], None]:
    """An act that needs a number."""
    return lambda controller, command: act(controller, _number(command))


_MOTIONS: dict[Code, Callable[[Controller, Command], None]] = {
    Code.MOVE: _numbered(lambda c, mm: c.motion.driving.travel(MM * mm)),
    Code.VEL: _numbered(lambda c, mmps: c.motion.driving.go(MM * mmps)),
    Code.ROTATE: _numbered(lambda c, degps: c.motion.turning.go(radians(degps))),
    Code.RVEL: _numbered(lambda c, degps: c.motion.turning.go(radians(degps))),
    Code.HEAD: _numbered(lambda c, deg: c.head(radians(deg))),
    Code.DHEAD: _numbered(lambda c, deg: c.motion.turning.travel(radians(deg))),
    Code.VEL2: Controller.drive_sides,
    Code.STOP: _bare(Controller.stop),
}

_SETTINGS: dict[Code, Callable[[Controller, Command], None]] = {
    # Its use is that it was heard; a robot that is open has nothing to open.
    Code.PULSE: _bare(lambda _: None),
    Code.OPEN: _bare(lambda _: None),
    Code.SAY: _bare(lambda _: None),
    Code.ENABLE: _numbered(lambda c, on: c.motion.enable(on != 0)),
    Code.SETA: _numbered(lambda c, mmps2: c.motion.driving.set_ramp(MM * mmps2)),
    Code.SETV: _numbered(lambda c, mmps: c.motion.driving.set_rate_max(MM * mmps)),
    Code.SETRA: _numbered(lambda c, degps2: c.motion.turning.set_ramp(radians(degps2))),
    Code.SETRV: _numbered(lambda c, degps: c.motion.turning.set_rate_max(radians(degps))),
    Code.SETO: _bare(Controller.set_origin),
    Code.SONAR: _numbered(Controller.switch_sonars),
    Code.BUMPSTALL: _numbered(Controller.set_bump_stall),
    Code.HOSTBAUD: _numbered(Controller.switch_baud),
    Code.E_STOP: _bare(lambda c: c.motion.emergency_stop()),
}
