"""Keys that drive only while they are held, on a terminal that never tells when one is let go."""

import math
from dataclasses import dataclass

FIRST_HOLD_S = 0.5
"""How long one press moves: a terminal repeats a key that is held only after a quarter to two thirds of a second."""
REPEAT_HOLD_S = 0.3
"""How long each repeat moves: they come thirty times a second, and over a slow line in clumps."""
REPEAT_WITHIN_S = 0.75
"""A key that comes again within this was held; where a terminal's first repeat is later than FIRST_HOLD_S, the robot
hesitates once."""

DIRECTIONS = {
    "w": (1, 0),
    "s": (-1, 0),
    "a": (0, 1),
    "d": (0, -1),
    "up": (1, 0),
    "down": (-1, 0),
    "left": (0, 1),
    "right": (0, -1),
}
"""Forwards and turn to the left of each key."""


@dataclass
class DeadMan:
    """The direction that is held now. Times are of hardware.clock."""

    _key: str = ""
    _pressed_s: float = -math.inf
    _until_s: float = -math.inf

    def press(self, key: str, now_s: float) -> None:
        """A key of DIRECTIONS came from the terminal."""
        held = key == self._key and now_s - self._pressed_s <= REPEAT_WITHIN_S
        self._key, self._pressed_s = key, now_s
        self._until_s = now_s + (REPEAT_HOLD_S if held else FIRST_HOLD_S)

    def release(self) -> None:
        """Whatever was held is held no more."""
        self._key, self._until_s = "", -math.inf

    def direction(self, now_s: float) -> tuple[int, int]:
        """Forwards and turn, each -1, 0 or 1; (0, 0) once nothing is held."""
        return DIRECTIONS[self._key] if now_s < self._until_s else (0, 0)
