"""The motion error of a robot, fitted to repeated runs over marks (the paper's "repetitive experiments")."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..errors import InvalidInputError, unknown_name
from ..geometry import FloatArray
from ..intervals import Bounds, mean_bounds, spread_bounds
from .error import Growth, MotionError
from .growth_fit import RunSums, fit_growth
from .legs import EXACT, LegsOf, Measured
from .runs import Run, Runs

FEWEST = 3
FEW = 10
BOOTSTRAPS = ("drawn", "resampled")
"""Whole runs are drawn anew from what was fitted, normal errors and all, or resampled from those that there are.

Few runs do not hold the spread that others would have: of twelve, resampled ones give 95 % intervals of a and b that
hold the truth in 82 to 91 % of the cases, drawn ones in 91 to 96 % (`python -m experiments motion`). Resampled ones do
not take errors for normal.
"""


@dataclass(frozen=True)
class FittedGrowth:
    """One error's growth, fitted to n runs up to the length reached; each with the bounds of its interval.

    bias: odometry - truth by the length [1 or rad/m], which the growth leaves out; sigma: after the length reached.
    """

    growth: Growth
    a_bounds: Bounds
    b_bounds: Bounds
    bias: float
    bias_bounds: Bounds
    sigma: float
    sigma_bounds: Bounds
    reached: float
    n: int

    @property
    def relative_error(self) -> float:
        """Of sigma, roughly: 1 / sqrt(2 (n - 1))."""
        return float(1 / np.sqrt(2 * (self.n - 1)))


@dataclass(frozen=True)
class MotionFit:
    """What repeated runs say: the error, each part as fitted (along, across, heading, turn; those that could be).

    n_runs: that were used. keeps_bias: it is in b. warnings: what a user should know before they believe it.
    """

    error: MotionError
    parts: Mapping[str, FittedGrowth]
    n_runs: int
    keeps_bias: bool
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class FitOptions:
    """measured: how well the truth is. keep_bias: leave the bias in, as part of b, for a robot that is not corrected.

    bootstrap: one of BOOTSTRAPS; resamples: how often; level: of the intervals.
    """

    measured: Measured = EXACT
    keep_bias: bool = False
    bootstrap: str = "drawn"
    resamples: int = 2000
    level: float = 0.95

    def __post_init__(self) -> None:
        if self.bootstrap not in BOOTSTRAPS:
            raise unknown_name("bootstrap", self.bootstrap, BOOTSTRAPS)
        if self.resamples < 100:
            raise InvalidInputError(f"resamples must be at least 100, not {self.resamples}")
        if not 0 < self.level < 1:
            raise InvalidInputError(f"level must be between 0 and 1, not {self.level}")


def fit_motion(runs: Runs, rng: np.random.Generator, options: FitOptions | None = None) -> MotionFit:
    """Fit the motion error. Raises InvalidInputError where fewer than three runs are straight, or turn on the spot."""
    options = options or FitOptions()
    straight, turns = runs.of_kind("straight"), runs.of_kind("turn")
    _check_enough(runs, straight, turns)
    parts, measured = {}, options.measured
    fitted = partial(_fitted, rng=rng, options=options)
    with_heading = all(run.has_headings for run in runs)
    if len(straight) >= FEWEST:
        parts["along"] = fitted(straight, measured.along)
        heading_a = 0.0
        if with_heading:
            parts["heading"] = fitted(straight, measured.heading)
            heading_a = parts["heading"].growth.a
        parts["across"] = fitted(straight, partial(measured.across, heading_a=heading_a))
    if len(turns) >= FEWEST:
        parts["turn"] = fitted(turns, measured.turn)
    order = [name for name in ("along", "across", "heading", "turn") if name in parts]
    used = (len(straight) if "along" in parts else 0) + (len(turns) if "turn" in parts else 0)
    growths: dict[str, Any] = {name: parts[name].growth for name in order}
    warnings = tuple(_warnings(runs, parts, options))
    return MotionFit(MotionError(**growths), {name: parts[name] for name in order}, used, options.keep_bias, warnings)


def _fitted(runs: Sequence[Run], legs: LegsOf, *, rng: np.random.Generator, options: FitOptions) -> FittedGrowth:
    sums = RunSums.of([legs(run) for run in runs])
    n, zero = len(runs), options.keep_bias
    chosen = rng.integers(0, n, (options.resamples, n))
    resampled = sums.take(chosen)
    best = fit_growth(sums, about_zero=zero)
    again = sums.drawn(best, options.resamples, rng) if options.bootstrap == "drawn" else resampled
    refitted = fit_growth(again, about_zero=zero)
    reached = float(np.median(sums.length))
    bounds = partial(spread_bounds, level=options.level)
    a_low, a_high = bounds(float(np.sqrt(best[0])), np.sqrt(refitted[0]))
    return FittedGrowth(
        growth=Growth(*best.tolist()),
        a_bounds=(a_low**2, a_high**2),
        b_bounds=bounds(float(best[1]), refitted[1]),
        bias=float(sums.bias),
        bias_bounds=mean_bounds(resampled.bias, n, options.level),
        sigma=float(_sigma(best, reached)),
        sigma_bounds=bounds(float(_sigma(best, reached)), _sigma(refitted, reached)),
        reached=reached,
        n=n,
    )


def _sigma(growth: FloatArray, length: float) -> FloatArray:
    sigma: FloatArray = np.sqrt(growth[0] * length + np.square(growth[1] * length))
    return sigma


def _check_enough(runs: Runs, straight: Sequence[Run], turns: Sequence[Run]) -> None:
    if max(len(straight), len(turns)) >= FEWEST:
        return
    other = [run for run in runs if not run.kind]
    hint = f"; {_neither(other[0])}" if other else ""
    raise InvalidInputError(
        f"{len(straight)} straight runs and {len(turns)} turns on the spot: at least {FEWEST} of a kind are needed to "
        f"see a spread, and {FEW} or more to know it{hint}"
    )


def _neither(run: Run) -> str:
    return (
        f"{run} is neither straight nor a turn on the spot: it ends {run.length_m:.3g} m from its start and turns by "
        f"{np.degrees(run.turned_rad):.3g} degrees (are the units right?)"
    )


def _warnings(runs: Runs, parts: Mapping[str, FittedGrowth], options: FitOptions) -> Iterator[str]:
    """What limits the fit, the gravest first."""
    straight, turns = runs.of_kind("straight"), runs.of_kind("turn")
    if not all(run.has_headings for run in runs):
        yield (
            "no headings: heading and turn are not fitted and count as exact, and across holds what the heading does "
            "to the way; it is right for straight drives as long as these runs, and too small for longer ones"
        )
    elif "turn" not in parts:
        yield f"{len(turns)} turns on the spot, fewer than {FEWEST}: turn is not fitted and counts as exact"
    if "along" not in parts:
        yield f"{len(straight)} straight runs, fewer than {FEWEST}: along, across and heading are not fitted"
    yield from (f"left out: {_neither(run)}" for run in runs if not run.kind)
    if len(runs.surfaces) > 1:
        names = ", ".join(surface or "(none)" for surface in runs.surfaces)
        yield f"runs on {len(runs.surfaces)} surfaces ({names}) are fitted together: what differs between them is in b"
    for kind, members in (("straight", straight), ("turn", turns)):
        if len(members) >= FEWEST:
            yield from _of_marks(kind, members)
    yield from _of_bias(parts, options)


def _of_marks(kind: str, runs: Sequence[Run]) -> Iterator[str]:
    legs = EXACT.along if kind == "straight" else EXACT.turn
    sums, what = RunSums.of([legs(run) for run in runs]), {"straight": "straight runs", "turn": "turns"}[kind]
    if len(runs) < FEW:
        share = 100 / np.sqrt(2 * (len(runs) - 1))
        yield f"{len(runs)} {what} tell a sigma to {share:.0f} %; {FEW} or more are wanted"
    if not sums.separable:
        yield (
            f"the {what} have one mark each, all at one length: random slip a and scale b cannot be told apart there. "
            "All is taken for b, which is the larger of the two beyond that length, and the smaller before it"
        )
    ways = np.array([_way(kind, run) for run in runs])
    if np.linalg.norm(ways.mean(axis=0)) > 0.9:
        yield f"the {what} all go one way: what the ground does that way, as its slope, cannot be told from bias"


def _way(kind: str, run: Run) -> FloatArray:
    if kind == "turn":
        return np.array([np.sign(run.turns_rad.sum())])
    way: FloatArray = (run.true[-1, :2] - run.true[0, :2]) / run.length_m
    return way


def _of_bias(parts: Mapping[str, FittedGrowth], options: FitOptions) -> Iterator[str]:
    """Where the bias is sure and as large as the spread, a map that is not told of it is misled."""
    if options.keep_bias:
        return
    for name, part in parts.items():
        low, high = part.bias_bounds
        if low * high > 0 and abs(part.bias) * part.reached > part.sigma:
            yield (
                f"{name}: the bias ({part.bias:.3g} by the length) is larger than the spread and is in no sigma: "
                "correct the odometry by it, or keep it in b (--keep-bias)"
            )
