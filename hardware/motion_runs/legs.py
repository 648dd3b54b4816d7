"""How a robot is led along a line or through a turn by its odometry: poses in, velocities out."""

import math
from dataclasses import dataclass, field

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, yaw_rad

HEADING_GAIN = 1.5
"""[1/s] a heading that is off by a degree is turned back at 1.5 degrees a second."""


@dataclass(frozen=True)
class Pace:
    """fastest: in the middle of the way; slowest: at its end; change: of the speed, a second.

    All in metres a second or, of a turn, radians a second.
    """

    fastest: float
    slowest: float
    change: float

    def __post_init__(self) -> None:
        if not 0 < self.slowest <= self.fastest < math.inf or not 0 < self.change < math.inf:
            raise InvalidInputError(f"a pace needs 0 < slowest <= fastest and a change above 0, not {self}")

    def speed(self, left: float, before: float, dt_s: float) -> float:
        """The speed for the next dt_s, when it was `before` and so much is left: up, along and down a trapezoid."""
        if left <= 0:
            return 0.0
        rising, braking = before + self.change * dt_s, math.sqrt(2 * self.change * left)
        return max(self.slowest, min(self.fastest, rising, braking))

    def takes_s(self, way: float) -> float:
        """About how long a way takes [s], with its ends."""
        return way / self.fastest + 2 * self.fastest / self.change


DRIVING = Pace(fastest=0.25, slowest=0.02, change=0.15)
TURNING = Pace(fastest=math.radians(25), slowest=math.radians(2), change=math.radians(20))
"""RVEL counts whole degrees a second."""


@dataclass(frozen=True)
class Leg:
    """A straight way ahead of `amount` [m] ("straight"), or a turn on the spot by `amount` [rad], left positive
    ("turn")."""

    kind: str
    amount: float
    pace: Pace = DRIVING

    def __post_init__(self) -> None:
        if self.kind not in ("straight", "turn"):
            raise InvalidInputError(f"a leg is straight or a turn, not {self.kind!r}")
        if not math.isfinite(self.amount) or self.amount == 0 or (self.kind == "straight" and self.amount < 0):
            raise InvalidInputError(f"a leg has a length above 0, not {self.amount:g}")

    @property
    def is_turn(self) -> bool:
        """Whether it is a turn on the spot."""
        return self.kind == "turn"

    @property
    def takes_s(self) -> float:
        """About how long it takes [s]."""
        return self.pace.takes_s(abs(self.amount))

    def describe(self, done: float | None = None) -> str:
        """Itself, or what is done of it, in words."""
        amount = self.amount if done is None else done
        if self.is_turn:
            return f"{abs(math.degrees(amount)):.0f} degrees to the {'left' if self.amount > 0 else 'right'}"
        return f"{amount:.2f} m ahead"


@dataclass
class Steering:
    """Leads a robot through a leg from T_odom_start (4, 4). done: how much of it, as odometry tells it [m or rad]."""

    leg: Leg
    T_odom_start: FloatArray
    done: float = field(default=0.0, init=False)
    _speed: float = field(default=0.0, init=False)

    def velocity(self, T_odom_base: FloatArray, dt_s: float) -> tuple[float, float] | None:
        """The velocity [m/s, rad/s] to ask for during the next dt_s, by the newest pose; None: it is there."""
        turned_rad = math.remainder(yaw_rad(T_odom_base) - yaw_rad(self.T_odom_start), 2 * math.pi)
        if self.leg.is_turn:
            # Unwrapped: between two reports it turns by less than half a turn.
            self.done += math.remainder(turned_rad - self.done, 2 * math.pi)
        else:
            self.done = float((T_odom_base[:3, 3] - self.T_odom_start[:3, 3]) @ self.T_odom_start[:3, 0])
        sign = math.copysign(1.0, self.leg.amount)
        left = sign * (self.leg.amount - self.done)
        self._speed = self.leg.pace.speed(left, self._speed, dt_s)
        if left <= 0:
            return None
        return (0.0, sign * self._speed) if self.leg.is_turn else (self._speed, -HEADING_GAIN * turned_rad)
