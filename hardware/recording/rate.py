"""How fast a counter goes up."""

from dataclasses import dataclass, field

RATE_OVER_S = 2.0


@dataclass
class Rate:
    """How much a second a counter went up lately."""

    _past: list[tuple[float, int]] = field(default_factory=list)

    def of(self, count: int, at_s: float) -> float:
        """The rate, now that the counter stands there."""
        self._past.append((at_s, count))
        while len(self._past) > 2 and at_s - self._past[1][0] >= RATE_OVER_S:
            self._past.pop(0)
        then_s, before = self._past[0]
        elapsed_s = at_s - then_s
        return (count - before) / elapsed_s if elapsed_s > 0 else 0.0
