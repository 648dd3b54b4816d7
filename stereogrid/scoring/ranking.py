"""Does the map put the occupied cells before the free ones? Scores of p (N,) against occupied (N,) bool."""

import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray

Truth = NDArray[np.bool_]

OCCUPIED_ABOVE = 0.5
"""A cell is called occupied when its probability exceeds this."""


def ratio(part: float, whole: float) -> float:
    """part / whole, NaN when there is nothing to divide by."""
    return part / whole if whole else float("nan")


def _by_threshold(p: FloatArray, occupied: Truth) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(occupied, free) cells at or above each distinct p, the highest p first. Ties share one threshold."""
    order = np.argsort(-p, kind="stable")
    last_of_tie = np.append(np.flatnonzero(np.diff(p[order])), len(p) - 1)
    true_hits = np.cumsum(occupied[order], dtype=np.int64)[last_of_tie]
    return true_hits, last_of_tie + 1 - true_hits


def auc(p: FloatArray, occupied: Truth) -> float:
    """Chance that a random occupied cell has a higher p than a random free one, ties counted half.

    NaN when either class is empty.
    """
    if occupied.all() or not occupied.any():
        return float("nan")
    hits, alarms = _by_threshold(p, occupied)
    height = np.concatenate([[0], hits]).astype(np.float64)
    area = np.sum(np.diff(alarms, prepend=0) * (height[1:] + height[:-1]) / 2)
    return float(area / (float(hits[-1]) * float(alarms[-1])))


def average_precision(p: FloatArray, occupied: Truth) -> float:
    """Precision averaged over the recall gained at each distinct p, uninterpolated; NaN without OCCUPIED."""
    if not occupied.any():
        return float("nan")
    hits, alarms = _by_threshold(p, occupied)
    return float(np.sum(np.diff(hits, prepend=0) * (hits / (hits + alarms))) / hits[-1])


def ranking_scores(p: FloatArray, occupied: Truth) -> dict[str, float]:
    """Every ranking score by name; p (N,) without NaN. A cell at p > OCCUPIED_ABOVE is called occupied."""
    called = p > OCCUPIED_ABOVE
    hits = int(np.count_nonzero(called & occupied))
    n_called, n_occupied = int(np.count_nonzero(called)), int(np.count_nonzero(occupied))
    wrong = n_called + n_occupied - 2 * hits
    return {
        "auc": auc(p, occupied),
        "average_precision": average_precision(p, occupied),
        "occupied_precision": ratio(hits, n_called),
        "occupied_recall": ratio(hits, n_occupied),
        "occupied_f1": ratio(2 * hits, n_called + n_occupied),
        "occupied_iou": ratio(hits, n_called + n_occupied - hits),
        "cell_accuracy": ratio(len(p) - wrong, len(p)),
    }
