"""The camera's height over the map is read from the cells under its path."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.grid import OccupancyGrid
from stereogrid.scoring.ground import camera_height


@dataclass
class Cells:
    """A map of occupied cells (N, 3)."""

    cells: np.ndarray
    cell_m: float = 0.1
    asked: list = field(default_factory=list)

    def occupied_centres(self):
        return (np.asarray(self.cells).reshape(-1, 3) + 0.5) * self.cell_m


def floor(z_index, n=60):
    i, j = np.meshgrid(np.arange(-n, n), np.arange(-n, n))
    return np.stack([i.ravel(), j.ravel(), np.full(i.size, z_index)], axis=1)


PATH = np.array([[0.3 * n, 0.1, 1.0] for n in range(-5, 6)])


@pytest.mark.parametrize("z_index", [-5, 0, 3])
def test_the_height_over_a_flat_floor_is_that_over_its_cells_centres(z_index):
    height = camera_height(Cells(floor(z_index)), PATH)
    assert (height.name, height.unit) == ("camera_height_m", "m")
    assert height.value == pytest.approx(1.0 - (z_index + 0.5) * 0.1)
    # Columns within 2 m: a circle of 400 pi cells of 0.1 m, an observation.
    assert height.n == pytest.approx(len(PATH) * 400 * np.pi, rel=0.02)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 50), quarters=st.integers(0, 3))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_the_height_does_not_depend_on_the_order_of_cells_nor_on_where_the_world_begins(seed, n, quarters):
    rng = np.random.default_rng(seed)
    cells = np.unique(rng.integers(-30, 30, (40 * n, 3)), axis=0)
    path = rng.uniform(-1, 1, (5, 3))
    expected = camera_height(Cells(cells), path)
    assert camera_height(Cells(rng.permutation(cells)), rng.permutation(path)) == expected
    shift = rng.integers(-500, 500, 3)
    a = quarters * np.pi / 2
    R = np.round([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    moved = np.round((cells + 0.5) @ R.T - 0.5).astype(int) + shift
    there = camera_height(Cells(moved), path @ R.T + 0.1 * shift)
    assert there.n == expected.n
    assert there.value == pytest.approx(expected.value, abs=1e-9, nan_ok=True)


def test_the_highest_cell_of_a_column_counts():
    two_floors = np.concatenate([floor(0), floor(-8)])
    assert camera_height(Cells(two_floors), PATH).value == pytest.approx(0.95)
    assert camera_height(Cells(two_floors), PATH).n == camera_height(Cells(floor(0)), PATH).n


def test_what_is_beside_the_camera_above_it_or_far_below_is_not_ground():
    near = np.concatenate([floor(0), floor(9), floor(12), floor(-25)])
    assert camera_height(Cells(near), PATH) == camera_height(Cells(floor(0)), PATH)
    deep = camera_height(Cells(floor(-25)), PATH)
    assert np.isnan(deep.value)
    assert deep.n == 0


def test_cells_far_from_the_path_do_not_count():
    ground, kerb = floor(0), floor(4)
    kerb = kerb[np.abs(kerb[:, 1]) > 25]
    assert camera_height(Cells(np.concatenate([ground, kerb])), PATH) == camera_height(Cells(ground), PATH)


def test_a_sloping_road_keeps_its_height_when_the_camera_climbs_with_it():
    i, j = np.meshgrid(np.arange(-60, 60), np.arange(-15, 15))
    cells = np.stack([i.ravel(), j.ravel(), np.floor(i.ravel() * 0.1 + 1e-9)], axis=1).astype(int)
    path = np.array([[x, 0.0, 1.2 + 0.1 * x] for x in np.arange(-3, 3, 0.5)])
    assert camera_height(Cells(cells), path).value == pytest.approx(1.2, abs=0.05)


def test_an_empty_map_has_no_height():
    for empty in (Cells(np.empty((0, 3))), OccupancyGrid(0.1)):
        height = camera_height(empty, PATH)
        assert np.isnan(height.value)
        assert height.n == 0
