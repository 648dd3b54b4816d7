"""Pairs two streams of stamped pictures that nothing synchronises: the nearest in time, within a bound."""

from collections import deque
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from stereogrid.errors import InvalidInputError

from .pairs import PairCounts

LEFT, RIGHT = 0, 1
MOST_WAITING = 8
"""Pictures that wait for a partner, a side."""


class Stamped(Protocol):
    """Anything with a moment."""

    @property
    def stamp_s(self) -> float:
        """On hardware.clock."""


T = TypeVar("T", bound=Stamped)


class SkewBound:
    """How far apart in time the two pictures of a pair may be [s].

    max_skew_s where the robot goes straight. While it turns at w rad/s a picture moves by focal_px * w pixels a second,
    which a matcher takes for disparity: then no more than smear_px / (focal_px * |w|) either.
    turn_radps: how fast it turns now; None: never.
    """

    def __init__(
        self,
        max_skew_s: float,
        focal_px: float,
        turn_radps: Callable[[], float] | None = None,
        smear_px: float = 1.0,
    ) -> None:
        if not (max_skew_s >= 0 and focal_px > 0 and smear_px > 0):
            raise InvalidInputError(
                f"max_skew_s must be >= 0, focal_px and smear_px > 0, not {max_skew_s}, {focal_px} and {smear_px}"
            )
        self.max_skew_s = max_skew_s
        self._focal_px, self._smear_px, self._turn_radps = focal_px, smear_px, turn_radps

    def now_s(self) -> float:
        """The bound for a pair that is made now."""
        smear_pxps = self._focal_px * abs(self._turn_radps()) if self._turn_radps is not None else 0.0
        if smear_pxps * self.max_skew_s > self._smear_px:
            return self._smear_px / smear_pxps
        return self.max_skew_s


class Pairing(Generic[T]):
    """Takes the pictures of both sides as they come, gives the pairs.

    period_s: of the cameras; within half of it no nearer partner can come, so that a pair need not wait for the next
    picture. counts: pairs beyond the bound go to `skewed`, pictures without a partner to `broken`; the pairs
    themselves are counted by who gives them out.
    """

    def __init__(self, period_s: float, bound: SkewBound, counts: PairCounts) -> None:
        if not period_s > 0:
            raise InvalidInputError(f"period_s must be > 0, not {period_s}")
        self._near_s = 0.5 * period_s
        self.bound, self._counts = bound, counts
        self._waiting: tuple[deque[T], deque[T]] = (deque(), deque())
        self._newest_s = [float("-inf"), float("-inf")]
        self.last_skew_s: float | None = None
        """Between the last two pictures that were compared, paired or not."""

    def add(self, side: int, picture: T) -> list[tuple[T, T]]:
        """A picture of LEFT or RIGHT; the pairs (left, right) that it completes, oldest first."""
        if not picture.stamp_s > self._newest_s[side]:
            self._counts.broken += 1
            return []
        self._newest_s[side] = picture.stamp_s
        queue = self._waiting[side]
        queue.append(picture)
        if len(queue) > MOST_WAITING:
            self._leave(side)
        pairs: list[tuple[T, T]] = []
        while all(self._waiting) and self._step(pairs):
            pass
        return pairs

    def waiting(self) -> int:
        """Pictures of both sides that wait for a partner."""
        return sum(map(len, self._waiting))

    def _step(self, pairs: list[tuple[T, T]]) -> bool:
        """Decide on the two oldest pictures; false where that must wait for the next picture."""
        left, right = self._waiting[LEFT][0], self._waiting[RIGHT][0]
        early = LEFT if left.stamp_s <= right.stamp_s else RIGHT
        late_s = max(left.stamp_s, right.stamp_s)
        skew_s = abs(right.stamp_s - left.stamp_s)
        follower = self._waiting[early][1] if len(self._waiting[early]) > 1 else None
        if follower is not None and abs(follower.stamp_s - late_s) < skew_s:
            self._leave(early)
            return True
        bound_s = self.bound.now_s()
        if skew_s > self._near_s and follower is None:
            if skew_s <= bound_s:
                return False
            self.last_skew_s = skew_s
            self._leave(early)
            return True
        self.last_skew_s = skew_s
        for queue in self._waiting:
            queue.popleft()
        if skew_s <= bound_s:
            pairs.append((left, right))
        else:
            self._counts.skewed += 1
        return True

    def _leave(self, side: int) -> None:
        """The side's oldest picture has no partner."""
        self._waiting[side].popleft()
        self._counts.broken += 1
