"""How fast an error grows, as a random walk and by what each run keeps: fitted to repeated runs with marks.

The error of run i at the length d is e_i(d) = (k + b xi_i) d + sqrt(a) W_i(d): xi_i is normal, W_i a random walk. So
the marks of one run err together, with covariance a min(d, d') + b^2 d d', and a fit of the runs' spread at each mark
alone throws most of the knowledge away. All that the marks tell of a run is its slope to the last of them, D away,
s_i = e_i(D) / D, of variance b^2 + a / D; and R_i, the sum of (leg's error - s_i h)^2 / h over its m legs of length h,
which is a times chi-squared of m - 1 degrees. That is a one-way layout with random effects: a within the runs, b
between them (Whitmore, Lifetime Data Analysis 1, 1995; Searle, Casella and McCulloch, Variance Components, 1992).
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ..geometry import Array, FloatArray

ITERATIONS = 20
SAME_LENGTH = 1.25
"""Runs of one mark each tell a from b by their lengths alone: the longest must be so many times the shortest."""
TINY = 1e-300


@dataclass(frozen=True)
class RunSums:
    """What N runs tell of one error, the runs in the last axis (..., N) of each array.

    length D, slope s, within R as above, degrees m - 1. noise_within, noise_slope: what the measuring of the truth adds
    to the means of R and of (s - k)^2. moment, square: the sums of e d and of d^2 over the marks, for the bias.
    """

    length: FloatArray
    slope: FloatArray
    within: FloatArray
    degrees: FloatArray
    noise_within: FloatArray
    noise_slope: FloatArray
    moment: FloatArray
    square: FloatArray

    @classmethod
    def of(cls, legs: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> "RunSums":
        """From each run's legs: the errors (m,) that they add, their lengths (m,), the noise (m, m) of these errors."""
        return cls(*np.array([_sums(*run) for run in legs]).T)

    def take(self, chosen: Array) -> "RunSums":
        """The runs of these numbers, in the shape of chosen (..., N)."""
        return RunSums(*(getattr(self, each.name)[chosen] for each in fields(self)))

    def drawn(self, growth: FloatArray, count: int, rng: np.random.Generator) -> "RunSums":
        """(count, N) runs without bias, drawn anew from the growth a, b (2,), over the same marks, measured as well."""
        a, b = growth
        shape, ones = (count, len(self.length)), np.maximum(self.degrees, 1.0)
        slope = rng.standard_normal(shape) * np.sqrt(b**2 + a / self.length + self.noise_slope)
        within = (a + self.noise_within / ones) * 2 * rng.standard_gamma(np.broadcast_to(self.degrees / 2, shape))
        kept = {each.name: np.broadcast_to(getattr(self, each.name), shape) for each in fields(self)}
        return RunSums(**(kept | {"slope": slope, "within": within}))

    @property
    def bias(self) -> FloatArray:
        """Least squares through the origin over all the marks (...): k = sum(e d) / sum(d^2)."""
        bias: FloatArray = self.moment.sum(axis=-1) / self.square.sum(axis=-1)
        return bias

    @property
    def separable(self) -> bool:
        """Whether a and b can be told apart: by several marks in a run, or by runs of different lengths."""
        return bool((self.degrees > 0).any() or self.length.max() > SAME_LENGTH * self.length.min())


def _sums(errors: FloatArray, steps: FloatArray, noise: FloatArray) -> list[float]:
    reached, erred, length = np.cumsum(steps), np.cumsum(errors), float(steps.sum())
    # R = errors @ spread @ errors, to whose mean noise adds the trace of spread @ noise.
    spread = np.diag(1 / steps) - 1 / length
    within, noise_within = float(errors @ spread @ errors), float(np.sum(spread * noise))
    of_slope = (length, erred[-1] / length, max(within, 0.0), len(steps) - 1.0)
    return [
        *of_slope,
        max(noise_within, 0.0),
        float(noise.sum()) / length**2,
        float(erred @ reached),
        float(reached @ reached),
    ]


def fit_growth(runs: RunSums, *, about_zero: bool = False) -> FloatArray:
    """a and b (2, ...) of each row of runs, none below zero.

    Fisher's scoring of the likelihood, as least squares of squares: each R and each (s - k)^2 is set against its mean,
    linear in a and b^2, by weights from its variance. Where the best a or b^2 would be negative it is zero and the
    other takes all. about_zero: b holds what the runs err by in common too. Runs that cannot tell the two get b alone.
    """
    separable = runs.separable
    scale = np.mean(runs.slope**2 * runs.length, axis=-1, keepdims=True) + TINY
    a = runs.within.sum(axis=-1, keepdims=True) / np.maximum(runs.degrees.sum(axis=-1, keepdims=True), 1.0)
    a, b2 = (a if separable else np.zeros_like(a)), np.mean(runs.slope**2, axis=-1, keepdims=True)
    for _ in range(ITERATIONS):
        a, b2 = _scored(runs, np.maximum(a, 1e-9 * scale) if separable else a, b2 + TINY, about_zero)
    return np.stack([a[..., 0], np.sqrt(b2[..., 0])])


def _scored(runs: RunSums, a: FloatArray, b2: FloatArray, about_zero: bool) -> tuple[FloatArray, FloatArray]:
    """The next a and b^2 (..., 1)."""
    per_length, variance = 1 / runs.length, b2 + a / runs.length + runs.noise_slope
    total = (1 / variance).sum(axis=-1, keepdims=True)
    if about_zero:
        between = runs.slope**2 - runs.noise_slope
    else:
        k = (runs.slope / variance).sum(axis=-1, keepdims=True) / total
        # k lies nearer to each run than the true mean does: by so much is the square too small.
        between = (runs.slope - k) ** 2 / (1 - 1 / (total * variance)) - runs.noise_slope
    # Relative weights serve, and keep squares of tiny variances from falling below what a float can hold.
    unit = variance.min(axis=-1, keepdims=True)
    q = 0.5 * (unit / variance) ** 2
    degrees = np.maximum(runs.degrees, 1.0)
    p = 0.5 * runs.degrees * (unit / np.maximum(a + runs.noise_within / degrees, 1e-9 * unit)) ** 2
    inside = (runs.within - runs.noise_within) / degrees
    return _nonnegative(
        *((p + q * per_length**2).sum(axis=-1, keepdims=True), (q * per_length).sum(axis=-1, keepdims=True)),
        q.sum(axis=-1, keepdims=True),
        (p * inside + q * per_length * between).sum(axis=-1, keepdims=True),
        (q * between).sum(axis=-1, keepdims=True),
        separable=runs.separable,
    )


def _nonnegative(
    aa: FloatArray, ab: FloatArray, bb: FloatArray, ya: FloatArray, yb: FloatArray, *, separable: bool
) -> tuple[FloatArray, FloatArray]:
    """The a and b^2, neither negative, that solve [[aa, ab], [ab, bb]] [a, b^2] = [ya, yb] best."""
    only_b = np.maximum(yb / bb, 0)
    if not separable:
        return np.zeros_like(only_b), only_b
    det = aa * bb - ab**2
    told = det > 1e-9 * aa * bb
    a, b2 = (np.where(told, y / np.where(told, det, 1.0), -1.0) for y in (ya * bb - yb * ab, yb * aa - ya * ab))
    only_a = np.maximum(ya / aa, 0)
    return np.where(a < 0, 0.0, np.where(b2 < 0, only_a, a)), np.where(a < 0, only_b, np.maximum(b2, 0))
