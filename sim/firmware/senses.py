"""What the controller knows of the robot's body, and how it writes that into a SIP."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, degrees, pi, remainder, sin
from typing import Protocol

import arcos
from arcos.position import HEADING_TURN
from arcos.sip import stall_bumpers
from stereogrid.geometry import FloatArray, yaw_rad

from ..robot.odometry import WheelOdometry

MOVING_MPS = 0.005
"""Wheels slower than this are at rest."""
NO_THERMOMETER_C = -127
OPEN_INPUTS = 0xFF
"""Digital inputs that nothing is connected to."""


class Body(Protocol):
    """The robot as the controller drives it: sim.robot.pioneer.Pioneer."""

    T_world_base: FloatArray
    odometry: WheelOdometry
    time_s: float
    bumpers: tuple[int, int]
    stalled: tuple[bool, bool]

    @property
    def battery_v(self) -> float:
        """Volts now."""

    @property
    def wheel_speeds_mps(self) -> FloatArray:
        """(2,): left, right."""

    def sonar_m(self) -> FloatArray:
        """(16,) ranges."""

    def drive(self, speed_mps: float, turn_radps: float) -> None:
        """One tick at these speeds."""

    def coast(self) -> None:
        """One tick with the motors off."""


@dataclass(frozen=True)
class Wheels:
    """What the wheels shall do: speed and turn rate of the robot, by its effective track; or roll free."""

    speed_mps: float
    turn_radps: float
    powered: bool

    def drive(self, body: Body) -> None:
        """Let the body do it for one tick."""
        if self.powered:
            body.drive(self.speed_mps, self.turn_radps)
        else:
            body.coast()


@dataclass(frozen=True)
class Place:
    """Where the robot believes it is: x, y [m] and heading [rad], in the frame odom or in one given by `seen_from`."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def seen_from(self, origin: "Place") -> "Place":
        """This place in a frame that lies at origin."""
        dx, dy = self.x_m - origin.x_m, self.y_m - origin.y_m
        c, s = cos(origin.heading_rad), sin(origin.heading_rad)
        turn_rad = remainder(self.heading_rad - origin.heading_rad, 2 * pi)
        return Place(c * dx + s * dy, c * dy - s * dx, turn_rad)


@dataclass(frozen=True)
class Senses:
    """What the body reports each tick; bumpers as bit masks, stalled (left, right)."""

    place: Place
    left_mps: float
    right_mps: float
    stalled: tuple[bool, bool]
    front_bumpers: int
    rear_bumpers: int
    battery_v: float

    @staticmethod
    def of(body: Body) -> "Senses":
        """The senses of a body now."""
        T_odom_base = body.odometry.T_odom_base
        left_mps, right_mps = body.wheel_speeds_mps
        front, rear = body.bumpers
        return Senses(
            place=Place(float(T_odom_base[0, 3]), float(T_odom_base[1, 3]), yaw_rad(T_odom_base)),
            left_mps=float(left_mps),
            right_mps=float(right_mps),
            stalled=body.stalled,
            front_bumpers=front,
            rear_bumpers=rear,
            battery_v=body.battery_v,
        )


@dataclass(frozen=True)
class SipWriter:
    """Turns senses into SIPs of a robot whose position counters have position_bits bits."""

    robot: arcos.Robot
    position_bits: int

    def sip(
        self, senses: Senses, place: Place, sonar_m: Sequence[float], *, stalled: tuple[bool, bool], flags: int
    ) -> arcos.Sip:
        """The report of a robot at `place`, in the frame of its client. sonar_m: empty when the sonars are off."""
        battery_dv = round(10 * senses.battery_v)
        turn_radps = 500 * (senses.right_mps - senses.left_mps) * self.robot.turn_per_difference
        return arcos.Sip(
            moving=max(abs(senses.left_mps), abs(senses.right_mps)) > MOVING_MPS,
            x_raw=self._position(place.x_m),
            y_raw=self._position(place.y_m),
            heading_raw=_wrapped(round(place.heading_rad / (2 * pi) * HEADING_TURN), HEADING_TURN),
            left_mmps=round(1000 * senses.left_mps / self.robot.velocity_mmps),
            right_mmps=round(1000 * senses.right_mps / self.robot.velocity_mmps),
            battery_dv=min(battery_dv, 0xFF),
            stall_bumpers=stall_bumpers(stalled=stalled, front=senses.front_bumpers, rear=senses.rear_bumpers),
            control_raw=0,
            flags=flags,
            compass_raw=0,
            sonars=tuple(
                arcos.Sonar(number, round(1000 * range_m / self.robot.range_mm))
                for number, range_m in enumerate(sonar_m)
            ),
            gripper=0,
            analog_port=0,
            analog=0,
            digital_in=OPEN_INPUTS,
            digital_out=OPEN_INPUTS,
            battery2_dv=battery_dv,
            charge=0,
            turn_ddegps=round(10 * degrees(turn_radps)),
            fault=0,
            sideways_mmps=0,
            temperature_c=NO_THERMOMETER_C,
            charge_percent=0,
        )

    def _position(self, distance_m: float) -> int:
        return round(1000 * distance_m / self.robot.distance_mm) & ((1 << self.position_bits) - 1)


def _wrapped(value: int, turn: int) -> int:
    """value within -turn / 2 and turn / 2 - 1."""
    return (value + turn // 2) % turn - turn // 2
