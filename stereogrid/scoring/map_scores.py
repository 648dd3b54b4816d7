"""All scores of one map against one mesh. `names.SCORE_NAMES` says what each is."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import FloatArray
from ..intervals import Bounds
from .blocks import UNSAFE_BELOW, BlockBootstrap
from .calibration import ReliabilityTable, calibration_scores, entropy_bit, reliability_table
from .labels import OCCUPIED, CellLabels
from .names import SCORE_NAMES
from .ranking import ranking_scores, ratio
from .score import Score
from .surface import SeenSurface, map_surface_m, scores_of_distances, surface_distances_m
from .visibility import VisibleSet

Mask = NDArray[np.bool_]

SIGMA_PX = 0.5
"""Disparity error of block matching on real pairs, for the tolerance tau when none is measured."""


class ScoredMap(Protocol):
    """Any map that can be scored, of any cell size or make; the labels set the cells it is asked about."""

    @property
    def cell_m(self) -> float:
        """Side of the map's own cells [m]."""
        ...

    def probability(self, points_m: FloatArray) -> FloatArray:
        """Probability of occupancy (N,) at points (N, 3) in world [m], NaN where never updated."""
        ...

    def occupied_centres(self) -> FloatArray:
        """Centres (N, 3) in world [m] of the cells at p > .5."""
        ...


@dataclass(frozen=True)
class CellSample:
    """A map at the N cells of V, in C order of the labels.

    p (N,), NaN where untouched; occupied (N,), the truth; near_surface (N,), FREE within tau of OCCUPIED.
    """

    p: FloatArray
    occupied: Mask
    near_surface: Mask

    @property
    def touched(self) -> Mask:
        """(N,) True where the map has been updated."""
        return ~np.isnan(self.p)

    def known(self, prior: float) -> FloatArray:
        """p (N,) with the prior where the map is unknown."""
        return np.where(self.touched, self.p, prior)


def score_map(
    grid: ScoredMap,
    labels: CellLabels,
    visible: VisibleSet,
    *,
    prior: float = 0.5,
    seen: SeenSurface | None = None,
    camera: StereoCamera | None = None,
    sigma_px: float = SIGMA_PX,
    blocks: BlockBootstrap | None = None,
) -> list[Score]:
    """Every score of SCORE_NAMES in its order; those of the surface only when it is given as seen.

    prior: what an unknown cell counts as. camera and sigma_px [px] set dl of the tolerance (Eq. 8); without
    a camera tau is one cell. blocks: give the scores their intervals. A score that is not defined (an empty class, no
    map) is NaN. Raises InvalidInputError when V and the labels differ in shape, V is empty, or the map answers with
    what is no probability.
    """
    if not 0 < prior < 1:
        raise InvalidInputError(f"prior must lie between 0 and 1, not {prior}")
    cells = sample_cells(grid, labels, visible, camera=camera, sigma_px=sigma_px)
    values = _coverage(cells) | _ranking(cells, prior) | _calibration(cells, prior) | _others(cells, prior)
    bounds: dict[str, Bounds] = {}
    if blocks is not None:
        bounds |= blocks.of_cells(cells, labels.centres_m(visible.mask), prior=prior, values=values)
    if seen is not None:
        map_m = map_surface_m(grid.occupied_centres(), labels, visible)
        distances = surface_distances_m(map_m, seen.surface, seen.samples_m)
        values |= scores_of_distances(*distances, cell_m=labels.cell_m)
        values |= {f"floor_{name}": value for name, value in seen.floor.items()}
        if blocks is not None:
            points_m = map_m, seen.samples_m
            bounds |= blocks.of_surface(points_m, distances, cell_m=labels.cell_m, values=values)
    return [
        Score(name, values[name][0], unit, values[name][1], *bounds.get(name, (None, None)))
        for name, (unit, _) in SCORE_NAMES.items()
        if name in values
    ]


def map_reliability(
    grid: ScoredMap,
    labels: CellLabels,
    visible: VisibleSet,
    *,
    prior: float | None = None,
    equal_count: bool = False,
) -> ReliabilityTable:
    """The reliability diagram of a map in 10 bins of equal width or count: over the touched cells of V, or over all of
    them where the prior is given that an unknown one counts as.
    """
    cells = sample_cells(grid, labels, visible)
    over = cells.touched if prior is None else np.ones_like(cells.touched)
    p = cells.p if prior is None else cells.known(prior)
    return reliability_table(p[over], cells.occupied[over], equal_count=equal_count)


def sample_cells(
    grid: ScoredMap,
    labels: CellLabels,
    visible: VisibleSet,
    *,
    camera: StereoCamera | None = None,
    sigma_px: float = SIGMA_PX,
) -> CellSample:
    """Ask the map about the centres of V, in C order of the labels; camera and sigma_px as in `score_map`."""
    mask = visible.mask
    if mask.shape != labels.label.shape:
        raise InvalidInputError(f"the visible set is {mask.shape}, the labels {labels.label.shape}")
    if not mask.any():
        raise InvalidInputError("nothing is visible: check the poses, the range and the bounds of the labels")
    centres_m = labels.centres_m(mask)
    p = np.asarray(grid.probability(centres_m), dtype=np.float64)
    if p.shape != (len(centres_m),) or ((p < 0) | (p > 1)).any():
        raise InvalidInputError(f"the map must give {len(centres_m)} values in [0, 1] or NaN, not {p.shape}")
    occupied = labels.label[mask] == OCCUPIED
    tau_m = tolerance_m(visible.nearest_m[mask], labels.cell_m, camera=camera, sigma_px=sigma_px)
    near = ~occupied & (labels.distance_to_occupied_m[mask] <= tau_m * (1 + 1e-6))
    return CellSample(p, occupied, near)


def tolerance_m(
    nearest_m: NDArray[np.float32], cell_m: float, *, camera: StereoCamera | None, sigma_px: float
) -> FloatArray:
    """tau = max(cell, 2 dl) [m] at the nearest depths (N,) [m]; dl = z^2 sigma_px / (b f), Eq. 8."""
    z = nearest_m.astype(np.float64)
    dl_m = np.zeros_like(z) if camera is None else z**2 * sigma_px / camera.focal_baseline_px_m
    return np.maximum(cell_m, 2 * dl_m)


Values = dict[str, tuple[float, int]]


def _coverage(cells: CellSample) -> Values:
    classes = {"": np.ones_like(cells.occupied), "_occupied": cells.occupied, "_free": ~cells.occupied}
    counts = {name: (int((cells.touched & of).sum()), int(of.sum())) for name, of in classes.items()}
    return {f"coverage{name}": (ratio(part, whole), whole) for name, (part, whole) in counts.items()}


def _ranking(cells: CellSample, prior: float) -> Values:
    # Sorted once here, each subset is sorted already when it is ranked, which a stable sort does not repeat.
    order = np.argsort(-cells.known(prior), kind="stable")
    p, occupied = cells.known(prior)[order], cells.occupied[order]
    touched, clear = cells.touched[order], ~cells.near_surface[order]
    where = {
        "": touched,
        "_all": np.ones_like(occupied),
        "_tolerant": touched & clear,
        "_all_tolerant": clear,
    }
    return {
        f"{name}{end}": (value, int(over.sum()))
        for end, over in where.items()
        for name, value in ranking_scores(p[over], occupied[over]).items()
    }


def _calibration(cells: CellSample, prior: float) -> Values:
    p = cells.known(prior)
    return {
        f"{name}{end}": (value, int(over.sum()))
        for end, over in {"": cells.touched, "_all": np.ones_like(cells.occupied)}.items()
        for name, value in calibration_scores(p[over], cells.occupied[over]).items()
    }


def _others(cells: CellSample, prior: float) -> Values:
    p = cells.known(prior)
    missed, n = int((p[cells.occupied] < UNSAFE_BELOW).sum()), int(cells.occupied.sum())
    return {"unsafe_occupied": (ratio(missed, n), n), "entropy": (float(entropy_bit(p).mean()), len(p))}
