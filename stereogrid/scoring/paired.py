"""Is one arm better than another? Differences between arms that saw the same noise, with a bootstrap interval.

The unit is the seed (or world), never the voxel: cells of one map err together. With common random numbers, each
seed's difference between two arms is free of what the seed does to both.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm, t

from ..errors import InvalidInputError
from ..geometry import as_floats

RESAMPLES = 10_000


@dataclass(frozen=True)
class Interval:
    """A mean with its confidence interval over n units; NaN bounds where there are fewer than two."""

    mean: float
    low: float
    high: float
    n: int


def paired_difference(
    arm: ArrayLike, reference: ArrayLike, *, rng: np.random.Generator, level: float = 0.95
) -> Interval:
    """The mean of arm - reference, both (N,) in the same order of units, with its bootstrap interval.

    A unit whose value is NaN in either is left out. Raises InvalidInputError for shapes that do not pair.
    """
    a, b = as_floats(arm), as_floats(reference)
    if a.ndim != 1 or a.shape != b.shape:
        raise InvalidInputError(f"paired values must be (N,) and (N,), not {a.shape} and {b.shape}")
    return bootstrap_mean(a - b, rng=rng, level=level)


def bootstrap_mean(values: ArrayLike, *, rng: np.random.Generator, level: float = 0.95) -> Interval:
    """The mean of values (N,), NaN left out, with its bootstrap interval: resampled means, expanded percentiles.

    Plain percentiles are too narrow for few units, by sqrt((n - 1) / n) and by taking the normal for Student's t:
    for n = 5 they hold the true mean in 83 % of the cases, not 95 %. Taken farther out in the tails, as here, they
    hold it in 92 % (Hesterberg, The American Statistician 69, 2015, section 4).
    """
    if not 0 < level < 1:
        raise InvalidInputError(f"level must be between 0 and 1, not {level}")
    kept = as_floats(values)
    kept = kept[~np.isnan(kept)]
    n = len(kept)
    mean = float(kept.mean()) if n else np.nan
    if n < 2:
        return Interval(mean, np.nan, np.nan, n)
    means = rng.choice(kept, size=(RESAMPLES, n)).mean(axis=1)
    tail = norm.cdf(np.sqrt(n / (n - 1)) * t.ppf((1 - level) / 2, n - 1))
    low, high = np.quantile(means, [tail, 1 - tail])
    return Interval(mean, float(low), float(high), n)
