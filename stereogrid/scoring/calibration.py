"""Are the map's probabilities frequencies? Scores of p (N,) against occupied (N,) bool."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from ..geometry import FloatArray
from .ranking import Truth, ratio
from .score import DIMENSIONLESS, Score

CLIP = 1e-6
"""The log-loss takes p no nearer to 0 and 1 than this, or one certain error would make it infinite."""

BINS = 10

COVERAGE_SIGMAS = 1.96
"""Two-sided 95 % of a Gaussian."""


@dataclass(frozen=True)
class ReliabilityTable:
    """What a reliability diagram draws, for B bins (edges[b], edges[b + 1]]; the first also holds its edge.

    edges (B + 1,); mean_p (B,) and frequency (B,) of occupied cells, NaN in empty bins; count (B,) int64.
    """

    edges: FloatArray
    mean_p: FloatArray
    frequency: FloatArray
    count: NDArray[np.int64]

    @property
    def expected_error(self) -> float:
        """ECE: mean over the cells of their bin's |mean_p - frequency|; NaN without cells."""
        full = self.count > 0
        gaps = np.abs(self.mean_p - self.frequency)[full] * self.count[full]
        return ratio(float(gaps.sum()), int(self.count.sum()))


def reliability_table(
    p: FloatArray, occupied: Truth, *, bins: int = BINS, equal_count: bool = False
) -> ReliabilityTable:
    """Bin p (N,), without NaN, into bins of equal width over [0, 1], or of equal count.

    Equal p never fall in two bins, so the table does not depend on the order of the cells; where many are
    equal (at the map's clamps) bins of equal count come out fewer and unequal.
    """
    if bins < 1 or p.shape != occupied.shape:
        raise InvalidInputError(f"need bins >= 1 and a label for each p, not {bins}, {p.shape}, {occupied.shape}")
    edges = np.linspace(0, 1, bins + 1)
    if equal_count and len(p):
        inner = np.unique(np.quantile(p, edges[1:-1], method="inverted_cdf"))
        edges = np.concatenate([[0.0], inner[(inner > 0) & (inner < 1)], [1.0]])
    bin_of = np.searchsorted(edges[1:-1], p, side="left")
    count = np.bincount(bin_of, minlength=len(edges) - 1)
    per_bin = np.where(count, count, np.nan)
    mean_p = np.bincount(bin_of, weights=p, minlength=len(count)) / per_bin
    frequency = np.bincount(bin_of, weights=occupied, minlength=len(count)) / per_bin
    return ReliabilityTable(edges, mean_p, frequency, count.astype(np.int64))


def brier(p: FloatArray, occupied: Truth) -> FloatArray:
    """Squared error (N,) of each probability."""
    error: FloatArray = (p - occupied) ** 2
    return error


def log_loss(p: FloatArray, occupied: Truth) -> FloatArray:
    """Negative log-likelihood (N,) of each label [nat], p clipped to [CLIP, 1 - CLIP]."""
    clipped = np.clip(p, CLIP, 1 - CLIP)
    loss: FloatArray = -np.log(np.where(occupied, clipped, 1 - clipped))
    return loss


def entropy_bit(p: FloatArray) -> FloatArray:
    """Binary entropy (N,) of each cell [bit]."""
    q = np.clip(p, np.finfo(np.float64).tiny, 1 - np.finfo(np.float64).epsneg)
    entropy: FloatArray = -(q * np.log2(q) + (1 - q) * np.log1p(-q) / np.log(2))
    return entropy


def calibration_scores(p: FloatArray, occupied: Truth) -> dict[str, float]:
    """Every calibration score by name; balanced = mean over the two classes, NaN when either is empty."""
    scores = {}
    for name, loss in (("brier", brier(p, occupied)), ("log_loss", log_loss(p, occupied))):
        scores[name] = _mean(loss)
        scores[f"{name}_balanced"] = (_mean(loss[occupied]) + _mean(loss[~occupied])) / 2
    scores["ece_width"] = reliability_table(p, occupied).expected_error
    scores["ece_count"] = reliability_table(p, occupied, equal_count=True).expected_error
    return scores


def bound_coverage(true_range_m: FloatArray, measured_range_m: FloatArray, sigma_range_m: FloatArray) -> Score:
    """Share of hits whose true error along the ray is within 1.96 sigma; nominal .95 (the paper's claim).

    Arrays of one shape [m]: true and measured range along the ray, and the measurement's standard deviation
    dl (Eqs. 10, 13). A NaN in any of them leaves the hit out.
    """
    arrays = [np.asarray(a, dtype=np.float64) for a in (true_range_m, measured_range_m, sigma_range_m)]
    shapes = [a.shape for a in arrays]
    if len(set(shapes)) > 1:
        raise InvalidInputError(f"true, measured and sigma ranges must have one shape, not {shapes}")
    true_m, measured_m, sigma_m = arrays
    hit = np.isfinite(true_m) & np.isfinite(measured_m) & np.isfinite(sigma_m)
    share, n = covered(in_sigmas((measured_m - true_m)[hit], sigma_m[hit]))
    return Score("bound_coverage", share, DIMENSIONLESS, n)


def in_sigmas(error: FloatArray, sigma: FloatArray) -> FloatArray:
    """|error| / sigma (N,); NaN where no error is claimed and there is none, infinite where there is one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio: FloatArray = np.abs(error) / sigma
    return ratio


def covered(sigmas: FloatArray) -> tuple[float, int]:
    """The share of errors (N,), each in its own sigmas, within 1.96, and how many there are; NaN are left out."""
    n = int(np.count_nonzero(~np.isnan(sigmas)))
    return ratio(int(np.count_nonzero(sigmas <= COVERAGE_SIGMAS)), n), n


def stretch(sigmas: FloatArray, share: float = 0.95) -> float:
    """By what all sigmas must be multiplied to cover that share of errors (N,), each in its own.

    1 = as claimed, more = overconfident. NaN are left out; NaN without any, and where no factor covers so many.
    """
    known = sigmas[~np.isnan(sigmas)]
    needed = float(np.quantile(known, share, method="inverted_cdf")) if len(known) else np.inf
    return needed / COVERAGE_SIGMAS if np.isfinite(needed) else float("nan")


def _mean(values: FloatArray) -> float:
    return ratio(float(values.sum()), len(values))
