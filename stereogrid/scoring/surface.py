"""How far the map's surface is from the true one, and the other way round."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..errors import InvalidInputError
from ..geometry import FloatArray
from .kernels import distance_to_candidates
from .labels import OCCUPIED, CellLabels
from .visibility import VisibleSet

if TYPE_CHECKING:
    import trimesh

SAMPLES_PER_CELL_FACE = 4
MOST_SAMPLES = 300_000
CANDIDATES = 8
"""Samples and corners whose triangles are measured exactly for each point."""

TOUCH_M = 1e-9
"""Rounding allowed at the thresholds of F: a distance of exactly one cell counts as within one cell."""


@dataclass(frozen=True)
class Surface:
    """The true mesh: triangles (T, 3, 3) [m], area-uniform samples (N, 3) [m] and their triangle (N,)."""

    triangles: FloatArray
    samples_m: FloatArray
    triangle_of: NDArray[np.int64]

    @classmethod
    def sample(cls, mesh: "trimesh.Trimesh", cell_m: float, rng: np.random.Generator) -> "Surface":
        """Sample about SAMPLES_PER_CELL_FACE points on each cell's face of area, MOST_SAMPLES at most."""
        triangles = np.asarray(mesh.triangles, dtype=np.float64)
        a, b, c = triangles.swapaxes(0, 1)
        area_m2 = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        if not area_m2.sum() > 0:
            raise InvalidInputError("the true mesh has no area to sample")
        count = int(min(MOST_SAMPLES, math.ceil(SAMPLES_PER_CELL_FACE * area_m2.sum() / cell_m**2)))
        chosen = rng.choice(len(triangles), size=count, p=area_m2 / area_m2.sum())
        u, v = rng.random((2, count, 1))
        # Fold the far half of the parallelogram back onto the triangle.
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        samples = a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]
        return cls(triangles, samples, chosen.astype(np.int64))

    @cached_property
    def _tree(self) -> KDTree:
        # With their corners, no triangle is without a point, and none ends between two samples.
        return KDTree(np.vstack([self.samples_m, self.triangles.reshape(-1, 3)]))

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Distance (N,) of points (N, 3) to the mesh [m].

        The exact distance to the triangles of the CANDIDATES nearest samples and corners. Never too small;
        too large only where the nearest triangle owns none of these, and then by less than the samples'
        spacing (among loose triangles 1 point in 10 000, by two fifths of the spacing at most).
        """
        if len(points_m) == 0:
            return np.empty(0)
        k = min(CANDIDATES, self._tree.n)
        _, near = self._tree.query(points_m, k=k)
        owner = np.concatenate([self.triangle_of, np.repeat(np.arange(len(self.triangles)), 3)])
        candidates = owner[near.reshape(len(points_m), k)]
        distance = np.empty(len(points_m))
        distance_to_candidates(points_m, candidates, self.triangles, distance)
        return distance


def map_surface_m(occupied_centres_m: FloatArray, labels: CellLabels, visible: VisibleSet) -> FloatArray:
    """A (N, 3): the map's occupied centres where the cameras looked, occluded or not [m].

    What lies behind a wall in view counts, since only an error can have put it there; what lies beyond the
    range does not. A centre outside the labelled box is judged by the box's nearest cell.
    """
    centres: FloatArray = np.asarray(occupied_centres_m, dtype=np.float64).reshape(-1, 3)
    i, j, k = np.clip(labels.index_of(centres), 0, np.array(labels.label.shape) - 1).T
    kept: FloatArray = centres[visible.in_view[i, j, k]]
    return kept


def visible_samples_m(surface: Surface, labels: CellLabels, visible: VisibleSet) -> FloatArray:
    """B (N, 3): the samples of the mesh that lie in cells of V [m]."""
    index = labels.index_of(surface.samples_m)
    inside = ((index >= 0) & (index < labels.label.shape)).all(axis=1)
    i, j, k = index[inside].T
    kept: FloatArray = surface.samples_m[inside][visible.mask[i, j, k]]
    return kept


def voxelised_mesh_m(labels: CellLabels, visible: VisibleSet) -> FloatArray:
    """The best map that cells of this size can be: centres (N, 3) of the OCCUPIED cells of V [m]."""
    return labels.centres_m((labels.label == OCCUPIED) & visible.mask)


def surface_scores(
    map_m: FloatArray, surface: Surface, truth_m: FloatArray, *, cell_m: float
) -> dict[str, tuple[float, int]]:
    """{name: (value, n)} of A = map_m (N, 3) against the mesh and of B = truth_m (M, 3) against A [m].

    An empty A has no distances (NaN) and F = 0.
    """
    return scores_of_distances(*surface_distances_m(map_m, surface, truth_m), cell_m=cell_m)


def surface_distances_m(map_m: FloatArray, surface: Surface, truth_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances (N,) of A = map_m (N, 3) to the mesh and (M,) of B = truth_m (M, 3) to A, infinite without A [m]."""
    from_truth = np.full(len(truth_m), np.inf)
    if len(map_m):
        from_truth[:] = KDTree(map_m).query(truth_m)[0]
    return surface.distance_m(map_m), from_truth


def scores_of_distances(from_map: FloatArray, from_truth: FloatArray, *, cell_m: float) -> dict[str, tuple[float, int]]:
    """{name: (value, n)} of the distances of surface_distances_m."""
    n_map, n_truth = len(from_map), len(from_truth)
    accuracy_m, accuracy_p95_m = _mean_and_p95(from_map)
    completeness_m, completeness_p95_m = _mean_and_p95(from_truth[np.isfinite(from_truth)])
    scores = {
        "accuracy_m": (accuracy_m, n_map),
        "accuracy_p95_m": (accuracy_p95_m, n_map),
        "completeness_m": (completeness_m, n_truth),
        "completeness_p95_m": (completeness_p95_m, n_truth),
        "chamfer_m": ((accuracy_m + completeness_m) / 2, n_map + n_truth),
    }
    for name, tau_m in thresholds_m(cell_m).items():
        scores[name] = (_f1(from_map, from_truth, tau_m + TOUCH_M), n_map + n_truth)
    return scores


def thresholds_m(cell_m: float) -> dict[str, float]:
    """The name of each F score and its tolerance [m]."""
    return {
        "surface_f1_1_cell": cell_m,
        "surface_f1_2_cells": 2 * cell_m,
        "surface_f1_5_cm": 0.05,
        "surface_f1_10_cm": 0.10,
        "surface_f1_20_cm": 0.20,
    }


def _mean_and_p95(distance_m: FloatArray) -> tuple[float, float]:
    if len(distance_m) == 0:
        return float("nan"), float("nan")
    return float(distance_m.mean()), float(np.percentile(distance_m, 95))


def _f1(from_map: FloatArray, from_truth: FloatArray, tau_m: float) -> float:
    """Harmonic mean of the shares within tau_m; 0 without a map, NaN without a visible surface."""
    if len(from_truth) == 0:
        return float("nan")
    precision = float(np.mean(from_map <= tau_m)) if len(from_map) else 0.0
    recall = float(np.mean(from_truth <= tau_m))
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


@dataclass(frozen=True)
class SeenSurface:
    """What every map of one drive is held against: the mesh, its visible samples (N, 3) [m], and the floor, the scores
    of the voxelised mesh itself.
    """

    surface: Surface
    samples_m: FloatArray
    floor: dict[str, tuple[float, int]]

    @classmethod
    def of(
        cls,
        mesh: "trimesh.Trimesh",
        labels: CellLabels,
        visible: VisibleSet,
        rng: np.random.Generator | None = None,
    ) -> "SeenSurface":
        """rng samples the mesh; by default with one seed: maps that are compared are to meet the same points."""
        surface = Surface.sample(mesh, labels.cell_m, rng or np.random.default_rng(0))
        samples_m = visible_samples_m(surface, labels, visible)
        voxels_m = voxelised_mesh_m(labels, visible)
        return cls(surface, samples_m, surface_scores(voxels_m, surface, samples_m, cell_m=labels.cell_m))
