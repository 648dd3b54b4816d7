"""Stamps of reports that come at a steady rate over a link that delays each by a little, and never by the same."""

from dataclasses import dataclass

LATE_S = 0.03
"""A stamp is at most this much earlier than the arrival: what a USB adapter and a busy computer add."""
TRUST = 0.1
"""Share of a delay that is taken for the robot's own clock's."""
PERIOD_S = 0.1
PERIODS_S = (0.02, 0.3)


@dataclass
class SteadyStamps:
    """Arrivals in, stamps out: never later than the arrival, but to keep them rising, and never LATE_S earlier."""

    _period_s: float = PERIOD_S
    _last_s: float | None = None
    _arrived_s: float = 0.0

    def steady(self, arrived_s: float) -> float:
        """The stamp of a report that came at arrived_s."""
        stamp_s = arrived_s
        if self._last_s is not None:
            gap_s = arrived_s - self._arrived_s
            if gap_s < 1.5 * self._period_s:
                low_s, high_s = PERIODS_S
                self._period_s = min(max(self._period_s + TRUST * (gap_s - self._period_s), low_s), high_s)
                due_s = self._last_s + self._period_s
                stamp_s = min(arrived_s, max(due_s + TRUST * (arrived_s - due_s), arrived_s - LATE_S))
            stamp_s = max(stamp_s, self._last_s + 1e-6)
        self._last_s, self._arrived_s = stamp_s, arrived_s
        return stamp_s
