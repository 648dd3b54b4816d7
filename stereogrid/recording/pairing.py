"""Which left picture was taken with which right one, by their stamps."""

import numpy as np
from numpy.typing import NDArray

from .odometry_path import Stamps

MAX_SKEW_S = 0.05


def paired(left_ns: Stamps, right_ns: Stamps, max_skew_s: float | None = None) -> NDArray[np.int64]:
    """(M, 2): numbers of the left and right pictures that are each other's nearest in time, in order.

    left_ns (L,), right_ns (R,): increasing. Those further apart than max_skew_s make no pair; by default than half the
    time from one left picture to the next, and .05 s.
    """
    if max_skew_s is None:
        period_s = float(np.median(np.diff(left_ns))) / 1e9 if len(left_ns) > 1 else np.inf
        max_skew_s = min(period_s / 2, MAX_SKEW_S)
    right_of_left, left_of_right = _nearest(right_ns, left_ns), _nearest(left_ns, right_ns)
    lefts = np.arange(len(left_ns))
    mutual = left_of_right[right_of_left] == lefts
    close = np.abs(right_ns[right_of_left] - left_ns) <= max_skew_s * 1e9
    chosen = mutual & close
    return np.stack([lefts[chosen], right_of_left[chosen]], axis=1)


def _nearest(among_ns: Stamps, to_ns: Stamps) -> NDArray[np.int64]:
    """The number of the stamp nearest to each; of two that are as near, the earlier."""
    after = np.clip(np.searchsorted(among_ns, to_ns), 1, max(len(among_ns) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(among_ns) - 1)
    nearest: NDArray[np.int64] = np.where(to_ns - among_ns[before] <= among_ns[after] - to_ns, before, after)
    return nearest
