"""What the driver lets a caller ask of the robot."""

import math
from dataclasses import dataclass, fields, replace

import arcos
from stereogrid.errors import InvalidInputError

MM = 0.001


@dataclass(frozen=True)
class Limits:
    """Highest speed, turn rate and their ramps, all > 0, and the lowest voltage at which the robot may move.

    A stop is steeper than a start: at .3 m/s it takes .3 s and 5 cm.
    """

    speed_mps: float = 0.3
    turn_radps: float = math.radians(30)
    acceleration_mps2: float = 0.3
    deceleration_mps2: float = 1.0
    turn_acceleration_radps2: float = math.radians(100)
    turn_deceleration_radps2: float = math.radians(200)
    low_battery_v: float = 11.5

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0):
                raise InvalidInputError(f"the robot's limit {field.name} must be finite and > 0, not {value}")

    def within(self, robot: arcos.Robot, config: arcos.ConfigReply | None) -> "Limits":
        """These limits, none above what the robot itself is made for; config: what it says of itself, if it does."""
        top = config or arcos.ConfigReply()
        speed_mps = MM * _least(robot.max_mmps, top.top_speed_mmps)
        turn_radps = math.radians(_least(robot.max_turn_degps, top.top_turn_degps))
        ramp_mps2 = MM * (top.top_acceleration_mmps2 or math.inf)
        turn_ramp_radps2 = math.radians(top.top_turn_acceleration_degps2 or math.inf)
        return replace(
            self,
            speed_mps=min(self.speed_mps, speed_mps),
            turn_radps=min(self.turn_radps, turn_radps),
            acceleration_mps2=min(self.acceleration_mps2, ramp_mps2),
            deceleration_mps2=min(self.deceleration_mps2, ramp_mps2),
            turn_acceleration_radps2=min(self.turn_acceleration_radps2, turn_ramp_radps2),
            turn_deceleration_radps2=min(self.turn_deceleration_radps2, turn_ramp_radps2),
        )


DEFAULT_LIMITS = Limits()


def _least(ours: int, theirs: int) -> int:
    """A robot that says 0 says nothing."""
    return min(ours, theirs or ours)


def clamped(value: float, most: float) -> float:
    """value within +-most."""
    return max(-most, min(value, most))
