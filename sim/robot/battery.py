"""The robot's batteries: volts that fall as charge is drawn."""

from collections.abc import Iterable
from dataclasses import dataclass

from stereogrid.errors import InvalidInputError

FULL_V, EMPTY_V = 12.9, 11.0
CAPACITY_AH = 21.6
"""Three lead batteries of 7.2 Ah."""
RESISTANCE_OHM = 0.02
IDLE_A = 1.2
"""What the computer, the sonars and the controller draw."""
EFFICIENCY = 0.7
HEAT_W_PER_NM2 = 0.4
"""What a motor turns into heat as it holds a torque; at standstill that is all of it."""


@dataclass
class Battery:
    """rest_v: its voltage [V] when nothing is drawn, 12.9 full and 11.0 empty. now_a: the current drawn [A]."""

    rest_v: float = FULL_V
    now_a: float = IDLE_A

    def __post_init__(self) -> None:
        if not EMPTY_V <= self.rest_v <= FULL_V:
            raise InvalidInputError(f"a battery's voltage must be {EMPTY_V:g} to {FULL_V:g}, not {self.rest_v}")

    @property
    def volts(self) -> float:
        """At the terminals [V]."""
        return self.rest_v - RESISTANCE_OHM * self.now_a

    def draw(self, torques_nm: Iterable[float], spins_radps: Iterable[float], duration_s: float) -> None:
        """Feed the two sides' motors for a while; what a braking motor gives back is lost."""
        watts = 0.0
        for torque, spin in zip(torques_nm, spins_radps, strict=True):
            watts += max(torque * spin, 0.0) / EFFICIENCY + HEAT_W_PER_NM2 * torque**2
        self.now_a = IDLE_A + watts / self.rest_v
        spent = self.now_a * duration_s / (3600 * CAPACITY_AH)
        self.rest_v = max(self.rest_v - spent * (FULL_V - EMPTY_V), EMPTY_V)
