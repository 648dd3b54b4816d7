"""A map without a true mesh: does it foretell what observations see that had no part in it?

Each held-out reading is a ray that ends on a surface. Before the end, by more than a margin, space is free; the cell
that holds the end is occupied. And a map foretells the range at which a ray ends: it is the first occupied cell, with
the probability that this one is and those before it are not.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import ndtr

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import FloatArray, as_floats, as_pose, transform
from ..observation import Disparity
from ..sensor_model import depth_sigma_m, range_and_sigma_m
from .calibration import brier, log_loss
from .ranking import OCCUPIED_ABOVE, Truth, auc, ratio
from .score import DIMENSIONLESS, Score

MARGIN_SIGMAS = 3.0
"""So many of the reading's sigmas before its end, and a cell's diagonal more, nothing is said of a ray."""
OUTLIERS = 0.05
"""Share of readings that are taken to be anywhere: one that no map could foretell must not outweigh all others."""
TAIL_SIGMAS = 4.0
RAYS_AT_ONCE = 4096

HELD_OUT_NAMES: dict[str, tuple[str, str]] = {
    "held_out_auc": (DIMENSIONLESS, "chance that the end of a held-out ray has a higher p than a point before it"),
    "held_out_occupied_recall": (DIMENSIONLESS, "share of the ends at p > .5"),
    "held_out_false_occupied": (DIMENSIONLESS, "share of the points well before the ends at p > .5"),
    "held_out_brier_balanced": (
        DIMENSIONLESS,
        "mean squared error of p, mean over both kinds of points; .25 at p = .5",
    ),
    "held_out_log_loss_balanced": ("nat", "mean negative log-likelihood of both kinds of points, mean of the two"),
    "held_out_log_likelihood": ("nat", "mean log-probability that a ray ends within the step where it does"),
    "held_out_coverage_occupied": (DIMENSIONLESS, "share of the ends in cells that the map has touched"),
    "held_out_coverage_free": (DIMENSIONLESS, "share of the points before the ends in cells that the map has touched"),
}
"""name -> (unit, meaning). A cell that the map has not touched counts as the prior, so that abstaining does not win."""


class Probable(Protocol):
    """Any map that gives probabilities."""

    def probability(self, points_m: FloatArray) -> FloatArray:
        """Probability of occupancy (N,) at points (N, 3) in world [m], NaN where never updated."""
        ...


@dataclass(frozen=True)
class HeldOutRays:
    """N readings: from origin_m (N, 3) to end_m (N, 3) in world [m]; sigma_m (N,) along the ray [m]."""

    origin_m: FloatArray
    end_m: FloatArray
    sigma_m: FloatArray

    def __post_init__(self) -> None:
        origin, end, sigma = (np.ascontiguousarray(as_floats(a)) for a in (self.origin_m, self.end_m, self.sigma_m))
        if end.ndim != 2 or end.shape[1] != 3 or origin.shape != end.shape or sigma.shape != (len(end),):
            raise InvalidInputError(f"rays are (N, 3), (N, 3), (N,), not {origin.shape}, {end.shape}, {sigma.shape}")
        if not (np.isfinite(origin).all() and np.isfinite(end).all() and np.isfinite(sigma).all()):
            raise InvalidInputError("a held-out ray contains NaN or infinity")
        if not (sigma > 0).all() or (origin == end).all(axis=1).any():
            raise InvalidInputError("a held-out ray needs a length, and a sigma above 0")
        for name, array in (("origin_m", origin), ("end_m", end), ("sigma_m", sigma)):
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.sigma_m)

    @property
    def range_m(self) -> FloatArray:
        """Lengths (N,) [m]."""
        length: FloatArray = np.linalg.norm(self.end_m - self.origin_m, axis=1)
        return length

    @classmethod
    def of_disparity(
        cls,
        camera: StereoCamera,
        disparity: Disparity,
        T_world_cam: FloatArray,
        *,
        n: int,
        max_range_m: float,
        rng: np.random.Generator,
        max_sigma_m: float = math.inf,
    ) -> "HeldOutRays":
        """n matched pixels drawn by rng (fewer where there are not so many), within max_range_m and max_sigma_m."""
        row, column = np.nonzero(disparity.valid)
        depth_m = camera.depth_m(disparity.disparity_px[row, column])
        points = camera.ray_directions[row, column] * depth_m[:, None]
        sigma_px = disparity.sigma_px[row, column]
        range_m, sigma_m = range_and_sigma_m(points, depth_sigma_m(camera, depth_m, sigma_px))
        fit = np.flatnonzero((range_m <= max_range_m) & (sigma_m <= max_sigma_m))
        chosen = np.sort(rng.choice(fit, size=min(n, len(fit)), replace=False))
        T = as_pose(T_world_cam, "T_world_cam")
        origin = np.broadcast_to(T[:3, 3], (len(chosen), 3))
        return cls(origin, transform(T, points[chosen]), sigma_m[chosen])

    @classmethod
    def joined(cls, parts: Iterable["HeldOutRays"]) -> "HeldOutRays":
        """All rays of the parts, in their order."""
        held = list(parts)
        empty = [np.empty((0, 3)), np.empty((0, 3)), np.empty(0)]
        arrays = (
            [*([none] if not held else []), *(getattr(p, name) for p in held)]
            for none, name in zip(empty, ("origin_m", "end_m", "sigma_m"), strict=True)
        )
        return cls(*(np.concatenate(each) for each in arrays))

    def parts(self, size: int) -> Iterator["HeldOutRays"]:
        """The rays in portions of that size."""
        for start in range(0, len(self), size):
            part = slice(start, start + size)
            yield HeldOutRays(self.origin_m[part], self.end_m[part], self.sigma_m[part])


def held_out_scores(
    grid: Probable,
    rays: HeldOutRays,
    *,
    cell_m: float,
    max_range_m: float,
    min_range_m: float = 0.0,
    prior: float = 0.5,
) -> list[Score]:
    """The scores of HELD_OUT_NAMES, in its order, of a map of cells of cell_m.

    Readings end between min_range_m, up to which a ray is free and nothing is asked, and max_range_m [m]. Points stand
    in the middles of steps of cell_m along each ray. An untouched cell counts as the prior; a score that is not defined
    (no ray, none that is long enough) is NaN. Raises InvalidInputError when an argument makes no sense.
    """
    for name, value in (("cell_m", cell_m), ("max_range_m", max_range_m)):
        if not (np.isfinite(value) and value > 0):
            raise InvalidInputError(f"{name} must be positive and finite, not {value}")
    if not 0 <= min_range_m < max_range_m:
        raise InvalidInputError(f"min_range_m must be from 0 to below {max_range_m}, not {min_range_m}")
    if not 0 < prior < 1:
        raise InvalidInputError(f"prior must lie between 0 and 1, not {prior}")
    ends = _asked(grid, rays.end_m)
    before, likelihood = [np.empty(0)], [np.empty(0)]
    for part in rays.parts(RAYS_AT_ONCE):
        at_m, p = _along(grid, part, cell_m)
        clear_m = part.range_m - MARGIN_SIGMAS * part.sigma_m - math.sqrt(3) * cell_m
        before.append(p[(at_m > min_range_m) & (at_m < clear_m[:, None])])
        stops = np.where(at_m > min_range_m, _known(p, prior), 0)
        likelihood.append(_log_likelihood(part, stops, cell_m, max_range_m))
    return _scores(ends, np.concatenate(before), np.concatenate(likelihood), prior)


def _scores(ends: FloatArray, before: FloatArray, likelihood: FloatArray, prior: float) -> list[Score]:
    """ends (N,), before (M,): p, NaN where the map is unknown; likelihood (N,)."""
    n, m = len(ends), len(before)
    touched = [float(np.count_nonzero(~np.isnan(p))) for p in (ends, before)]
    p = _known(np.concatenate([ends, before]), prior)
    occupied = np.arange(n + m) < n
    squares, losses = brier(p, occupied), log_loss(p, occupied)
    values = {
        "held_out_auc": (auc(p, occupied), n + m),
        "held_out_occupied_recall": (_mean(p[occupied] > OCCUPIED_ABOVE), n),
        "held_out_false_occupied": (_mean(p[~occupied] > OCCUPIED_ABOVE), m),
        "held_out_brier_balanced": ((_mean(squares[occupied]) + _mean(squares[~occupied])) / 2, n + m),
        "held_out_log_loss_balanced": ((_mean(losses[occupied]) + _mean(losses[~occupied])) / 2, n + m),
        "held_out_log_likelihood": (_mean(likelihood), n),
        "held_out_coverage_occupied": (ratio(touched[0], n), n),
        "held_out_coverage_free": (ratio(touched[1], m), m),
    }
    return [Score(name, values[name][0], unit, values[name][1]) for name, (unit, _) in HELD_OUT_NAMES.items()]


def _along(grid: Probable, rays: HeldOutRays, step_m: float) -> tuple[FloatArray, FloatArray]:
    """Ranges (S,) of the middles of steps as far as any reading may end [m], and p (N, S) there, NaN unknown."""
    farthest = float((rays.range_m + TAIL_SIGMAS * rays.sigma_m).max())
    middles: FloatArray = (np.arange(math.ceil(farthest / step_m), dtype=np.float64) + 0.5) * step_m
    toward = (rays.end_m - rays.origin_m) / rays.range_m[:, None]
    points = rays.origin_m[:, None] + toward[:, None] * middles[:, None]
    return middles, _asked(grid, points.reshape(-1, 3)).reshape(points.shape[:2])


def _log_likelihood(rays: HeldOutRays, p: FloatArray, step_m: float, max_range_m: float) -> FloatArray:
    """log (N,) of the probability of the step in which a reading ends: its own error blurs where the map says it ends.

    The ray first meets step j of p (N, S) with probability p_j (1 - p_1) ... (1 - p_{j-1}).
    """
    survival = np.cumprod(1 - p, axis=1)
    first = p * np.concatenate([np.ones((len(p), 1)), survival[:, :-1]], axis=1)
    edges = np.arange(p.shape[1] + 1) * step_m
    beyond = ndtr((rays.range_m[:, None] - edges) / rays.sigma_m[:, None])
    ends = (first * (beyond[:, :-1] - beyond[:, 1:])).sum(axis=1)
    log: FloatArray = np.log((1 - OUTLIERS) * ends + OUTLIERS * step_m / max_range_m)
    return log


def _asked(grid: Probable, points_m: FloatArray) -> FloatArray:
    p = np.asarray(grid.probability(points_m), dtype=np.float64)
    if p.shape != (len(points_m),) or ((p < 0) | (p > 1)).any():
        raise InvalidInputError(f"the map must give {len(points_m)} values in [0, 1] or NaN, not {p.shape}")
    return p


def _known(p: FloatArray, prior: float) -> FloatArray:
    return np.where(np.isnan(p), prior, p)


def _mean(values: FloatArray | Truth) -> float:
    return ratio(float(values.sum()), len(values))
