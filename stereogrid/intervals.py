"""Bootstrap intervals: of a mean and of a spread, from what units that are drawn again give."""

import numpy as np
from scipy.special import ndtr, ndtri, stdtrit

from .geometry import FloatArray

Bounds = tuple[float, float]


def mean_bounds(means: FloatArray, n: int, level: float = 0.95) -> Bounds:
    """Bounds of a mean of n units from the means (B,) of resampled units: percentiles, taken farther out for few units.

    As Hesterberg, The American Statistician 69, 2015, section 4.
    """
    tail = ndtr(np.sqrt(n / (n - 1)) * stdtrit(n - 1, (1 - level) / 2))
    low, high = np.quantile(means, [tail, 1 - tail])
    return float(low), float(high)


def spread_bounds(estimate: float, refitted: FloatArray, level: float = 0.95) -> Bounds:
    """Bounds of a standard deviation (or of any amount >= 0 whose square is a variance) from refitted ones (B,).

    Percentiles, corrected for bias and acceleration (Efron, JASA 82, 1987): a variance from few runs is skewed, and
    plain percentiles lie too low. The acceleration is a sixth of the skewness of the refitted variances.
    """
    near = 1e-9 * max(estimate, 0.0)
    below = np.mean(refitted < estimate - near) + 0.5 * np.mean(np.abs(refitted - estimate) <= near)
    shift = ndtri(np.clip(below, 0.005, 0.995))
    squares = (refitted / max(float(refitted.max()), 1e-300)) ** 2
    bend = _skewness(squares) / 6
    moved = shift + ndtri([(1 - level) / 2, (1 + level) / 2])
    low, high = np.quantile(refitted, ndtr(shift + moved / np.maximum(1 - bend * moved, 0.05)))
    return float(low), float(high)


def _skewness(values: FloatArray) -> float:
    """The third moment over the second to 3/2; none where the values are all but one."""
    off = values - values.mean()
    spread = float(np.mean(off**2))
    return float(np.mean(off**3)) / spread**1.5 if spread > 1e-20 else 0.0
