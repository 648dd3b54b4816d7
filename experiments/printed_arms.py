"""The arms of the comparison with the print: which equations are as printed; and Eq. 2, which cannot be run."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stereogrid import as_printed
from stereogrid.camera import StereoCamera
from stereogrid.config import MappingConfig
from stereogrid.geometry import FloatArray
from stereogrid.grid import OccupancyGrid
from stereogrid.observation import Disparity
from stereogrid.scoring import OCCUPIED, CellLabels, Score
from stereogrid.scoring.score import DIMENSIONLESS
from stereogrid.sensor_model import SensorModel, depth_sigma_m, likelihood_ratios, log_odds, odds, range_and_sigma_m

CORRECTED, PRINTED = "as corrected", "Eqs. 3, 11, 12"
LINEAR, SUM, ALL = "Eq. 13", "sum of rays", "Eqs. 3, 11-13, sum of rays"
CUT_OFF = "Eq. 2, cut off"
LOW_CORRECTED, LOW_PRINTED = "as corrected, prior .2", "Eqs. 3, 11, 12, prior .2"
LOW_PRIOR = 0.2
AT_LOWER, AT_UPPER, LOST = "at_lower_clamp", "at_upper_clamp", "occupied_at_lower_clamp"
CLAMP_MEANINGS = {
    AT_LOWER: "share of the touched cells of V whose log-odds stand at the lower clamp",
    AT_UPPER: "share of the touched cells of V whose log-odds stand at the upper clamp",
    LOST: "share of the touched OCCUPIED cells of V at the lower clamp: surely free, says the map",
}


@dataclass(frozen=True)
class Form:
    """printed: Eqs. 3, 11 and 12; linear: Eq. 13; rays: every ray adds. twin: the arm that differs in these alone."""

    twin: str
    printed: bool = False
    linear: bool = False
    rays: bool = False
    prior: float = 0.5

    def mapping(self, usual: MappingConfig) -> MappingConfig:
        """The usual way to map, in this form."""
        model = replace(with_prior(usual.model, self.prior), form="printed" if self.printed else "corrected")
        grid = replace(usual.grid, fusion="sum_of_rays" if self.rays else "cell")
        error = replace(usual.motion_error, way="linear" if self.linear else "rss")
        return replace(usual, model=model, grid=grid, motion_error=error)


FORMS = {
    CORRECTED: Form(CORRECTED),
    PRINTED: Form(CORRECTED, printed=True),
    LINEAR: Form(CORRECTED, linear=True),
    SUM: Form(CORRECTED, rays=True),
    ALL: Form(CORRECTED, printed=True, linear=True, rays=True),
    LOW_CORRECTED: Form(LOW_CORRECTED, prior=LOW_PRIOR),
    LOW_PRINTED: Form(LOW_CORRECTED, printed=True, prior=LOW_PRIOR),
}


def with_prior(model: SensorModel, prior: float) -> SensorModel:
    """The model with another prior, a reading being worth as much as before: its likelihood ratios stay."""
    hit, passed = likelihood_ratios(model)
    p_occupied, p_free = (ratio * odds(prior) / (1 + ratio * odds(prior)) for ratio in (hit, passed))
    return replace(model, p_occupied=p_occupied, p_free=p_free, prior=prior)


@dataclass(frozen=True)
class CutOff:
    """A map whose log-odds are read by Eq. 2 as printed, cut off to 0 and 1, and .5 where it divides by zero."""

    grid: OccupancyGrid

    @property
    def cell_m(self) -> float:
        """Side of its cells [m]."""
        return self.grid.cell_m

    def probability(self, points_m: FloatArray) -> FloatArray:
        """What is left of the print (N,) at points (N, 3) in world [m]; NaN where the map was never updated."""
        printed = as_printed.probability(log_odds(self.grid.probability(points_m)))
        return np.where(np.isinf(printed), 0.5, np.clip(printed, 0.0, 1.0))

    def occupied_centres(self) -> FloatArray:
        """Centres (N, 3) in world [m] of the cells at p > .5: its sign is right."""
        return self.grid.occupied_centres()


def clamp_scores(grid: OccupancyGrid, labels: CellLabels, visible: np.ndarray) -> list[Score]:
    """Shares of the touched cells of V (nx, ny, nz) that stand at the map's clamps; NaN for a map without any."""
    p = grid.probability(labels.centres_m(visible))
    occupied = labels.label[visible][~np.isnan(p)] == OCCUPIED
    known = log_odds(p[~np.isnan(p)])
    low, high = grid.clamp or (np.nan, np.nan)
    half_step = 1 / 512  # log-odds are kept in 1 / 256 nat
    at_low, at_high = known <= low + half_step, known >= high - half_step
    shares = {AT_LOWER: at_low, AT_UPPER: at_high, LOST: at_low[occupied]}
    return [
        Score(name, float(np.mean(which)) if len(which) and grid.clamp else np.nan, DIMENSIONLESS, len(which))
        for name, which in shares.items()
    ]


@dataclass(frozen=True)
class Peaks:
    """Eq. 11's peak as printed, k = cell, over the rays of a drive by range: edges_m (B + 1,) [m].

    rays (B,): how many; above_one (B,): share of them whose peak exceeds 1; median and largest (B,): of the peak.
    """

    edges_m: FloatArray
    rays: FloatArray
    above_one: FloatArray
    median: FloatArray
    largest: FloatArray


def eq11_peaks(camera: StereoCamera, disparities: Iterable[Disparity], *, cell_m: float, edges_m: FloatArray) -> Peaks:
    """What Eq. 11 as printed claims of the cell that is centred on the measured surface, every ray counted."""
    ranges, peaks = [], []
    for each in disparities:
        d, sigma_px = each.disparity_px[each.valid], each.sigma_px[each.valid]
        points = camera.back_project(each.disparity_px)
        range_m, sigma_m = range_and_sigma_m(points, depth_sigma_m(camera, camera.depth_m(d), sigma_px))
        near = range_m < edges_m[-1]
        ranges.append(range_m[near])
        peaks.append(
            as_printed.occupancy_probability(range_m[near], range_m[near], sigma_m[near], k_m=cell_m, p_min=0.25)
        )
    range_m, peak = np.concatenate(ranges), np.concatenate(peaks)
    in_bin = [peak[(range_m >= a) & (range_m < b)] for a, b in pairwise(edges_m)]

    def of_bins(value: Callable[[FloatArray], float]) -> FloatArray:
        return np.array([value(each) if len(each) else np.nan for each in in_bin])

    return Peaks(
        edges_m,
        np.array([len(each) for each in in_bin]),
        of_bins(lambda each: np.mean(each > 1)),
        of_bins(np.median),
        of_bins(np.max),
    )
