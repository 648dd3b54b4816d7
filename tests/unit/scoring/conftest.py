"""Small worlds and maps whose scores are known beforehand."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import trimesh

from stereogrid.camera import StereoCamera
from stereogrid.scoring import CellLabels


def make_box(low_m, high_m) -> trimesh.Trimesh:
    low, high = np.asarray(low_m, float), np.asarray(high_m, float)
    placed = trimesh.transformations.translation_matrix((low + high) / 2)
    return trimesh.creation.box(extents=high - low, transform=placed)


@dataclass
class ArrayMap:
    """A map that knows a probability for each cell of some labels, and nothing outside of them."""

    labels: CellLabels
    p: np.ndarray
    cell_m: float = 0.0

    def __post_init__(self):
        self.cell_m = self.labels.cell_m

    def probability(self, points_m):
        i, j, k = self.labels.index_of(points_m).T
        return self.p[i, j, k]

    def occupied_centres(self):
        return self.labels.centres_m(np.nan_to_num(self.p) > 0.5)


@pytest.fixture(scope="session")
def box() -> Callable[..., trimesh.Trimesh]:
    """box(low_m, high_m): a closed box with its normals out."""
    return make_box


@pytest.fixture(scope="session")
def array_map() -> type[ArrayMap]:
    return ArrayMap


@pytest.fixture(scope="session")
def camera() -> StereoCamera:
    """A small wide camera, 90 degrees across."""
    return StereoCamera(focal_px=80, cx_px=79.5, cy_px=59.5, baseline_m=0.1, width_px=160, height_px=120)
