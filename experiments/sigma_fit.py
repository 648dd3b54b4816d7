"""Fitting a sigma table to errors whose truth is known, and counting how many errors its sigmas cover."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from stereogrid.geometry import FloatArray
from stereogrid.matching.sigma import KNOTS, LARGEST_PX, SMALLEST_PX, SigmaTable, rows
from stereogrid.matching.sigma_cues import CUES, cues, look_up
from stereogrid.observation import Disparity

from .pairs import Mask
from .sigma_scenes import Scene

SAMPLES, FITTED = 20_000, 3_000
"""Pixels of a scene that are judged, and those among them that are fitted to."""
COARSEST_STEP_PX = 0.5
"""Scenes whose truth is rounded more coarsely are for testing only."""
SHARES = (0.68, 0.95)
SOFTNESS = 0.05
"""Width [log px] over which the corner of the loss is rounded, so that it has a gradient."""
STIFFNESS = 2e-3
"""Weight of the squared differences between neighbouring knots."""


@dataclass(frozen=True)
class Sample:
    """Matched pixels (N) of a scene: cues (C, N), |error| [px], whether both images show them, step of the truth."""

    scene: Scene
    cues: FloatArray
    error_px: FloatArray
    visible: Mask

    @classmethod
    def of(cls, scene: Scene, found: Disparity) -> "Sample":
        """SAMPLES of the pixels of scene that were matched and whose truth is known."""
        error_px = np.abs(found.disparity_px - scene.truth_px)
        at = np.flatnonzero(~np.isnan(error_px))
        at = np.random.default_rng(0).permutation(at)[:SAMPLES]
        seen = cues(scene.left, scene.right, found.disparity_px).reshape(len(CUES), -1)[:, at]
        return cls(scene, seen, error_px.ravel()[at], scene.visible.ravel()[at])

    @property
    def fits(self) -> bool:
        """Whether its truth is fine enough to fit to."""
        return self.scene.step_px <= COARSEST_STEP_PX

    def sigma_px(self, table: SigmaTable) -> FloatArray:
        """Sigma (N) of the pixels [px], as the matcher would give it."""
        sigma = np.zeros((1, self.error_px.size), np.float32)
        limits = np.array([SMALLEST_PX, LARGEST_PX], np.float32)
        look_up(self.cues[:, None, :], rows(KNOTS), rows(table.log_sigma), limits, sigma)
        return sigma[0].astype(float)


@dataclass(frozen=True)
class Coverage:
    """Shares [%] of n errors within one and two sigmas, and the median sigma [px]."""

    one: float
    two: float
    n: int
    median_px: float


def coverage(sample: Sample, sigma_px: FloatArray, *, rounding: bool = True, hidden: bool = False) -> Coverage:
    """Over the visible matches, or with the hidden ones; rounding: widen sigma by the truth's own rounding."""
    judged = sample.visible | hidden
    error, sigma = sample.error_px[judged], sigma_px[judged]
    wide = np.hypot(sigma, sample.scene.step_px / np.sqrt(12)) if rounding else sigma
    one, two = (100 * float(np.mean(error <= times * wide)) for times in (1, 2))
    return Coverage(one, two, error.size, float(np.median(sigma)))


def fit(samples: Sequence[Sample], start: SigmaTable | None = None) -> SigmaTable:
    """The table for which 68 % of the errors are within one sigma and 95 % within two, wherever the cues agree.

    log sigma minimises the quantile losses (Koenker and Bassett 1978) of log |e| at 68 % and of log |e| / 2 at 95 %,
    each group of scenes weighing the same, or as its scenes say. The truth's rounding is taken from the errors first.
    """
    groups = [sample.scene.group for sample in samples]
    shapes, beyond, errors, weights = [], [], [], []
    for sample in samples:
        at = np.flatnonzero(sample.visible)[:FITTED]
        shapes.append(hats(sample.cues[:, at]))
        beyond.append(np.log(np.maximum(sample.cues[CUES.index("shift_px"), at] / KNOTS["shift_px"][-1], 1)))
        errors.append([np.log(_without_rounding(sample, at, times) / times) for times in (1, 2)])
        weights.append(np.full(at.size, sample.scene.weight / groups.count(sample.scene.group) / at.size))
    hat, known, weight = np.concatenate(shapes), np.concatenate(beyond), np.concatenate(weights)
    weight /= weight.sum()
    log_error = np.concatenate(errors, axis=1) - known
    first = rows(start.log_sigma).ravel().astype(float) if start else np.full(hat.shape[1], -0.4)
    best = minimize(_loss, first, args=(hat, log_error, weight), jac=True, method="L-BFGS-B", options={"maxiter": 300})
    return _table(best.x.reshape(len(CUES), -1))


def _without_rounding(sample: Sample, at: FloatArray, times: int) -> FloatArray:
    """|e| that would be covered by times sigma as e is by times the sigma widened by the truth's rounding."""
    square = sample.error_px[at] ** 2 - (times * sample.scene.step_px) ** 2 / 12
    covered: FloatArray = np.sqrt(np.maximum(square, SMALLEST_PX**2))
    return covered


def hats(cue: FloatArray) -> FloatArray:
    """(N, C K): how much of each knot's value each pixel's log sigma takes; cue (C, N)."""
    parts = []
    for values, name in zip(cue, CUES, strict=True):
        knots = np.array(KNOTS[name])
        parts.extend(np.interp(values, knots, unit) for unit in np.eye(len(knots)))
    return np.stack(parts, axis=1)


def _loss(
    parameters: FloatArray, hat: FloatArray, log_error: FloatArray, weight: FloatArray
) -> tuple[float, FloatArray]:
    log_sigma = hat @ parameters
    total, slope = 0.0, np.zeros_like(log_sigma)
    for share, error in zip(SHARES, log_error, strict=True):
        excess = (error - log_sigma) / SOFTNESS
        total += float(weight @ (SOFTNESS * np.logaddexp(0, excess) - (1 - share) * SOFTNESS * excess))
        slope -= weight * (0.5 * (1 + np.tanh(excess / 2)) - (1 - share))
    steps = np.diff(parameters.reshape(len(CUES), -1), axis=1)
    pull = np.zeros((len(CUES), steps.shape[1] + 1))
    pull[:, 1:] += steps
    pull[:, :-1] -= steps
    return total + STIFFNESS * float(np.square(steps).sum()), hat.T @ slope + 2 * STIFFNESS * pull.ravel()


def _table(parts: FloatArray) -> SigmaTable:
    """The parts by cue; only sums count, so all but the first cue's are moved to begin at 0."""
    begin = parts[1:, :1].copy()
    parts[1:] -= begin
    parts[0] += begin.sum()
    return SigmaTable({cue: tuple(round(float(p), 3) for p in row) for cue, row in zip(CUES, parts, strict=True)})
