"""What the robot feels: its bumpers, and wheels that do not turn as they should."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

SEGMENTS = 5
BUMPER_X_M = 0.24
"""A contact of the body beyond this, before or behind the middle, is on a bumper."""
SEGMENT_M = 0.096
"""A bumper's segment is this wide."""
PATIENCE_S = 0.3
SLOW = 0.3
"""A side that turns at less than this share of the command for PATIENCE_S is stalled."""
MOVING_RADPS = 0.2
"""A command below this asks for too little to tell."""


def bumpers(points_base_m: Iterable[Any]) -> tuple[int, int]:
    """The front and the rear bumpers' bit masks from the places (x, y, ...) of contacts in base.

    Bit k of the front: segment k from left to right; of the rear: from right to left, so on round the robot.
    """
    front = rear = 0
    for x, y, *_ in points_base_m:
        if x > BUMPER_X_M:
            front |= 1 << _segment(-y)
        elif x < -BUMPER_X_M:
            rear |= 1 << _segment(y)
    return front, rear


@dataclass
class StallWatch:
    """Notices a side whose motor cannot turn its wheels as told."""

    _blocked_s: tuple[float, float] = (0.0, 0.0)

    def update(
        self, targets_radps: Iterable[float], spins_radps: Iterable[float], duration_s: float
    ) -> tuple[bool, bool]:
        """Whether the left and the right wheels are stalled, after another while."""
        left, right = (
            since + duration_s if abs(target) > MOVING_RADPS and spin * target < SLOW * target**2 else 0.0
            for since, target, spin in zip(self._blocked_s, targets_radps, spins_radps, strict=True)
        )
        self._blocked_s = (left, right)
        return left >= PATIENCE_S, right >= PATIENCE_S


def _segment(clockwise_m: float) -> int:
    return min(max(round(clockwise_m / SEGMENT_M + (SEGMENTS - 1) / 2), 0), SEGMENTS - 1)
