"""How sure is a score of one map? Its interval from blocks of the map that are drawn again.

Cells of one map err together: a bad match spoils a patch, and a hundred thousand cells are far from that many looks at
the world. Columns of the world, BLOCK_CELLS cells wide and long and as high as the map, are closer to it. They are
drawn with replacement, and the score is taken anew (the block bootstrap: Davison and Hinkley, Bootstrap Methods and
their Application, 1997, section 8.3). What errs in the whole map alike, as a calibration does or a drift, is the same
in every block: an interval says how much the scores hang on where one looked, not how another drive would have gone.

Scores that only cells have in common are taken from histograms of p, block by block, so that a thousand maps cost no
more than one. Calibration errors (ECE) and percentiles get no interval: resampling makes them larger by itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from ..geometry import FloatArray
from ..intervals import Bounds, mean_bounds
from .calibration import brier, entropy_bit, log_loss
from .ranking import OCCUPIED_ABOVE
from .surface import TOUCH_M, thresholds_m

if TYPE_CHECKING:
    from .map_scores import CellSample

BLOCK_CELLS = 20
FEWEST_BLOCKS = 10
"""Of fewer, no interval is worth its name."""
RESAMPLES = 1000
P_BINS = 256
UNSAFE_BELOW = 0.2
"""An occupied cell below this probability looks free to a planner."""
MOST_UNDEFINED = 0.01
"""Share of the resamples in which a score may be undefined (a class without a cell) and have an interval still."""

Values = Mapping[str, tuple[float, int]]
Counts = NDArray[np.float64]


@dataclass(frozen=True)
class BlockBootstrap:
    """Blocks of block_m [m] in x and y of world, drawn anew `resamples` times by seed."""

    block_m: float
    seed: int = 0
    resamples: int = RESAMPLES

    def __post_init__(self) -> None:
        if not (np.isfinite(self.block_m) and self.block_m > 0):
            raise InvalidInputError(f"block_m must be positive and finite, not {self.block_m}")

    def block_of(self, points_m: FloatArray) -> tuple[NDArray[np.int64], int]:
        """The number (N,) of the block of each point (N, 3) [m], and how many blocks hold one."""
        index = np.floor(points_m[:, :2] / self.block_m).astype(np.int64)
        index -= index.min(axis=0, initial=0)
        # One key a block is many times faster to sort than pairs.
        held, block = np.unique(index[:, 0] * (index[:, 1].max(initial=0) + 1) + index[:, 1], return_inverse=True)
        return block.ravel(), len(held)

    def of_cells(
        self, cells: "CellSample", centres_m: FloatArray, *, prior: float, values: Values
    ) -> dict[str, Bounds]:
        """Bounds of the scores of cells (N,) with these centres (N, 3) [m], by name; values: of the map itself."""
        block, n = self.block_of(centres_m)
        if n < FEWEST_BLOCKS:
            return {}
        weights = self._weights(n)
        return self._bounds(cell_scores(cells, block, weights, prior), n, values)

    def of_surface(
        self,
        points_m: tuple[FloatArray, FloatArray],
        distances_m: tuple[FloatArray, FloatArray],
        *,
        cell_m: float,
        values: Values,
    ) -> dict[str, Bounds]:
        """Bounds of the scores of the surface, by name.

        points_m: the map's centres (N, 3) and the samples of the mesh (M, 3); distances_m: (N,) and (M,) of each to the
        other, as in surface_distances_m.
        """
        block, n = self.block_of(np.concatenate(points_m))
        if n < FEWEST_BLOCKS or not len(points_m[0]):
            return {}
        parts = block[: len(points_m[0])], block[len(points_m[0]) :]
        return self._bounds(surface_scores_of(distances_m, parts, self._weights(n), cell_m), n, values)

    def _weights(self, n: int) -> Counts:
        """How often each of n blocks is drawn (1 + R, n): first once each, which is the map itself."""
        drawn = np.random.default_rng(self.seed).multinomial(n, np.full(n, 1 / n), size=self.resamples)
        return np.concatenate([np.ones((1, n)), drawn])

    def _bounds(self, resampled: Mapping[str, FloatArray], n: int, values: Values) -> dict[str, Bounds]:
        """Bounds of each score from what it is (1 + R,) of the map itself and of the resamples."""
        bounds = {}
        for name, each in resampled.items():
            known = each[1:][~np.isnan(each[1:])]
            if np.isnan(each[0]) or len(known) < (1 - MOST_UNDEFINED) * self.resamples:
                continue
            # Histograms are a little coarse: the exact value says where the interval stands.
            moved = known + (values[name][0] - each[0])
            low, high = mean_bounds(moved, n)
            bounds[name] = min(low, values[name][0]), max(high, values[name][0])
        return bounds


def cell_scores(cells: "CellSample", block: NDArray[np.int64], weights: Counts, prior: float) -> dict[str, FloatArray]:
    """Each score (W,) of the cells (N,) in blocks (N,), for W choices of how often each of n blocks counts (W, n)."""
    p, touched = cells.known(prior), cells.touched
    unsafe = np.nextafter(UNSAFE_BELOW, 0)
    edges = np.unique([*np.quantile(p, np.linspace(0, 1, P_BINS + 1)), unsafe, OCCUPIED_ABOVE])
    bin_of = np.searchsorted(edges, p, side="left")
    key = block * (len(edges) + 1) + bin_of
    size = weights.shape[1] * (len(edges) + 1)

    def histogram(which: NDArray[np.bool_]) -> Counts:
        counts = np.bincount(key[which], minlength=size).reshape(weights.shape[1], -1)
        counted: Counts = weights @ counts
        return counted

    clear = ~cells.near_surface
    over = {"": touched, "_all": np.ones_like(touched), "_tolerant": touched & clear, "_all_tolerant": clear}
    split = {
        end: (histogram(which & cells.occupied), histogram(which & ~cells.occupied)) for end, which in over.items()
    }
    first = int(np.searchsorted(edges, OCCUPIED_ABOVE, side="left")) + 1
    scores = {f"{k}{end}": v for end, both in split.items() for k, v in _ranking(*both, first).items()}
    for end in ("", "_all"):
        which = over[end]
        scores |= {f"{k}{end}": v for k, v in _losses(p, cells.occupied, which, block, weights).items()}
    occupied = split["_all"][0]
    missed = occupied[:, : int(np.searchsorted(edges, unsafe, side="left")) + 1].sum(1)
    others = {
        "unsafe_occupied": _ratio(missed, occupied.sum(1)),
        "entropy": _mean_over(entropy_bit(p), block, weights),
    }
    return scores | _coverage(split) | others


def _ranking(occupied: Counts, free: Counts, first: int) -> dict[str, FloatArray]:
    """Scores (W,) from counts (W, K) by rising p; bins from `first` on are called occupied."""
    n_occupied, n_free = occupied.sum(1), free.sum(1)
    hits = np.cumsum(occupied[:, ::-1], axis=1)[:, ::-1]
    alarms = np.cumsum(free[:, ::-1], axis=1)[:, ::-1]
    called = hits[:, first] + alarms[:, first] if first < hits.shape[1] else np.zeros(len(hits))
    right = hits[:, first] if first < hits.shape[1] else np.zeros(len(hits))
    wrong = called + n_occupied - 2 * right
    precision_at = np.divide(hits, hits + alarms, out=np.zeros_like(hits), where=hits + alarms > 0)
    return {
        "auc": _ratio((free * (hits - occupied / 2)).sum(1), n_occupied * n_free),
        "average_precision": _ratio((occupied * precision_at).sum(1), n_occupied),
        "occupied_precision": _ratio(right, called),
        "occupied_recall": _ratio(right, n_occupied),
        "occupied_f1": _ratio(2 * right, called + n_occupied),
        "occupied_iou": _ratio(right, called + n_occupied - right),
        "cell_accuracy": 1 - _ratio(wrong, n_occupied + n_free),
    }


def _coverage(split: Mapping[str, tuple[Counts, Counts]]) -> dict[str, FloatArray]:
    (occupied, free), (all_occupied, all_free) = ([c.sum(1) for c in split[end]] for end in ("", "_all"))
    return {
        "coverage": _ratio(occupied + free, all_occupied + all_free),
        "coverage_occupied": _ratio(occupied, all_occupied),
        "coverage_free": _ratio(free, all_free),
    }


def _losses(
    p: FloatArray, occupied: NDArray[np.bool_], which: NDArray[np.bool_], block: NDArray[np.int64], weights: Counts
) -> dict[str, FloatArray]:
    scores = {}
    for name, loss in (("brier", brier(p, occupied)), ("log_loss", log_loss(p, occupied))):
        scores[name] = _mean_over(loss[which], block[which], weights)
        classes = [_mean_over(loss[which & of], block[which & of], weights) for of in (occupied, ~occupied)]
        scores[f"{name}_balanced"] = (classes[0] + classes[1]) / 2
    return scores


def surface_scores_of(
    distances_m: tuple[FloatArray, FloatArray],
    parts: tuple[NDArray[np.int64], NDArray[np.int64]],
    weights: Counts,
    cell_m: float,
) -> dict[str, FloatArray]:
    """Each score (W,) of the distances (N,) and (M,) in blocks (N,) and (M,), for W choices of weights (W, n)."""
    accuracy_m, completeness_m = (_mean_over(*each, weights) for each in zip(distances_m, parts, strict=True))
    scores = {
        "accuracy_m": accuracy_m,
        "completeness_m": completeness_m,
        "chamfer_m": (accuracy_m + completeness_m) / 2,
    }
    for name, tau_m in thresholds_m(cell_m).items():
        precision, recall = (
            _mean_over((distance_m <= tau_m + TOUCH_M).astype(float), block, weights)
            for distance_m, block in zip(distances_m, parts, strict=True)
        )
        scores[name] = _ratio(2 * precision * recall, precision + recall)
    return scores


def _mean_over(values: FloatArray, block: NDArray[np.int64], weights: Counts) -> FloatArray:
    """Weighted means (W,) of values (N,) in blocks (N,)."""
    n = weights.shape[1]
    sums, counts = np.bincount(block, weights=values, minlength=n), np.bincount(block, minlength=n)
    return _ratio(weights @ sums, weights @ counts)


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    quotient: FloatArray = np.divide(part, whole, out=np.full(len(part), np.nan), where=whole > 0)
    return quotient
