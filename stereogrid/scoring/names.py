"""Every name that `score_map` and `BoundTest` give, with its unit and meaning: one table for reports and readers.

Cells: all but INTERIOR ones, which nothing can see. A name without a suffix is taken over the cells that are
visible and that the map has touched; `_all` over all of V, an unknown cell counting as the prior, so that
abstaining does not win; `_tolerant` leaves out FREE cells within tau = max(cell, 2 dl at the nearest view) of
an OCCUPIED one, dl from Eq. 8. `floor_` is the same score of the voxelised mesh itself: no map can do better.
"""

from .score import DIMENSIONLESS

COVERAGE = {
    "coverage": (DIMENSIONLESS, "share of V that the map has touched"),
    "coverage_occupied": (DIMENSIONLESS, "share of the OCCUPIED cells of V that the map has touched"),
    "coverage_free": (DIMENSIONLESS, "share of the FREE cells of V that the map has touched"),
}
RANKING = {
    "auc": (DIMENSIONLESS, "chance that an OCCUPIED cell has a higher p than a FREE one, ties counted half"),
    "average_precision": (DIMENSIONLESS, "precision averaged over recall"),
    "occupied_precision": (DIMENSIONLESS, "share OCCUPIED among the cells at p > .5"),
    "occupied_recall": (DIMENSIONLESS, "share at p > .5 among the OCCUPIED cells"),
    "occupied_f1": (DIMENSIONLESS, "harmonic mean of occupied precision and recall"),
    "occupied_iou": (DIMENSIONLESS, "cells both OCCUPIED and at p > .5, over cells either"),
    "cell_accuracy": (DIMENSIONLESS, "share of right cells; a footnote: most are free, so it misranks maps"),
}
CALIBRATION = {
    "brier": (DIMENSIONLESS, "mean squared error of p"),
    "brier_balanced": (DIMENSIONLESS, "mean squared error of p, mean of the two classes; .25 for p = .5"),
    "log_loss": ("nat", "mean negative log-likelihood, p clipped to [1e-6, 1 - 1e-6]"),
    "log_loss_balanced": ("nat", "mean negative log-likelihood, mean of the two classes"),
    "ece_width": (DIMENSIONLESS, "expected calibration error in 10 bins of equal width"),
    "ece_count": (DIMENSIONLESS, "expected calibration error in 10 bins of equal count, fewer where p ties"),
}
OTHERS = {
    "unsafe_occupied": (DIMENSIONLESS, "share of the OCCUPIED cells of V at p < .2; unknown is the prior"),
    "entropy": ("bit", "mean entropy of a cell of V; never alone: an overconfident wrong map scores best"),
}
SURFACE = {
    "accuracy_m": ("m", "mean distance of the map's occupied centres to the mesh"),
    "accuracy_p95_m": ("m", "its 95th percentile"),
    "completeness_m": ("m", "mean distance of the visible mesh to the map's occupied centres"),
    "completeness_p95_m": ("m", "its 95th percentile"),
    "chamfer_m": ("m", "half the sum of accuracy_m and completeness_m"),
    "surface_f1_1_cell": (DIMENSIONLESS, "F of both shares within one cell side"),
    "surface_f1_2_cells": (DIMENSIONLESS, "F within two cell sides"),
    "surface_f1_5_cm": (DIMENSIONLESS, "F within 5 cm"),
    "surface_f1_10_cm": (DIMENSIONLESS, "F within 10 cm"),
    "surface_f1_20_cm": (DIMENSIONLESS, "F within 20 cm"),
}
WHERE = {
    "": "touched cells of V",
    "_all": "all of V, unknown = prior",
    "_tolerant": "touched cells of V, FREE ones near the surface left out",
    "_all_tolerant": "all of V, unknown = prior, FREE cells near the surface left out",
}

SCORE_NAMES: dict[str, tuple[str, str]] = {
    **COVERAGE,
    **{f"{n}{end}": (u, f"{m} ({where})") for end, where in WHERE.items() for n, (u, m) in RANKING.items()},
    **{f"{n}{end}": (u, f"{m} ({WHERE[end]})") for end in ("", "_all") for n, (u, m) in CALIBRATION.items()},
    **OTHERS,
    **SURFACE,
    **{f"floor_{n}": (u, f"{m}, of the voxelised mesh") for n, (u, m) in SURFACE.items()},
}
"""name -> (unit, meaning)."""

ERRORS_OF_HITS = {
    "along": "hits, error of the point along the ray",
    "along_inliers": "hits without mismatches, error of the point along the ray",
    "across": "hits, error of the point across the ray, where the pose's covariance is largest",
    "surface": "hits, distance along the claimed ray from the hit to the first surface of the true mesh",
    "surface_inliers": "hits without mismatches, the same distance",
    "slant": "hits, the same distance; sigma of the pose's whole covariance on the slant of that surface",
    "slant_inliers": "hits without mismatches, the same",
}
BOUND_NAMES: dict[str, tuple[str, str]] = {
    "bound_mismatches": (DIMENSIONLESS, "share of hits whose disparity errs by more than 3 px"),
    **{
        f"bound_coverage_{kind}": (DIMENSIONLESS, f"share within 1.96 of the claimed sigma, nominal .95 ({meaning})")
        for kind, meaning in ERRORS_OF_HITS.items()
    },
    **{
        f"bound_stretch_{kind}": (DIMENSIONLESS, f"sigma times this would cover .95; 1 = as claimed ({meaning})")
        for kind, meaning in ERRORS_OF_HITS.items()
    },
}
"""name -> (unit, meaning) of what `BoundTest` gives. No name of these is one of a map's."""

PLAIN_NAMES: dict[str, tuple[str, str]] = {
    "camera_height_m": ("m", "height of the camera over the map's ground along its path: compare with a tape measure"),
    "disparity_density": (DIMENSIONLESS, "share of the left image's pixels that the matcher gave a disparity"),
    "known_cells": ("cell", "cells that the map has touched, free or occupied"),
}
"""name -> (unit, meaning) of what any map has, without a truth."""
