"""Distance fields against a search tree over the obstacles' centres."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from stereogrid.errors import InvalidInputError
from stereogrid.grid import State

from .maps import every_cell, filled, random_map

few = settings(max_examples=7, deadline=None, derandomize=True)


@given(seed=st.integers(0, 2**32 - 1), unknown_is_obstacle=st.booleans(), signed=st.booleans())
@few
def test_distances_are_those_to_the_nearest_obstacle_of_the_box(seed, unknown_is_obstacle, signed):
    grid = random_map(seed, share_known=0.5)
    low, high = np.array([-3.0, -2.5, -1.0]), np.array([2.0, 3.5, 3.0])
    field = grid.distance_field(low, high, unknown_is_obstacle=unknown_is_obstacle, signed=signed)
    shape = field.distance_m.shape
    centres = (field.origin + np.stack(np.indices(shape), axis=-1).reshape(-1, 3) + 0.5) * grid.cell_m
    np.testing.assert_array_equal(shape, (high - low) / grid.cell_m)
    states = grid.state(centres)
    obstacle = (states == State.OCCUPIED) | (unknown_is_obstacle & (states == State.UNKNOWN))
    expected = KDTree(centres[obstacle]).query(centres)[0]
    if signed:
        expected -= KDTree(centres[~obstacle]).query(centres)[0]
    np.testing.assert_allclose(field.distance_m.ravel(), expected, rtol=1e-6)
    np.testing.assert_allclose(field.at(centres), expected, rtol=1e-6)


def test_without_corners_the_field_covers_what_the_map_knows():
    grid = filled([[0, 0, 0], [9, 4, 2]], [2.0, -2.0])
    field = grid.distance_field()
    assert field.distance_m.shape == (10, 5, 3)
    np.testing.assert_allclose(field.distance_m[9, 4, 2], 0.25 * np.sqrt(81 + 16 + 4), rtol=1e-6)
    with pytest.raises(InvalidInputError, match="both low_m and high_m"):
        grid.distance_field([0, 0, 0])


def test_between_centres_the_field_of_a_wall_is_linear_and_signed_zero_lies_on_its_face():
    grid = filled(every_cell([4, -8, -8], [8, 8, 8]), 2.0)
    field = grid.distance_field([-2, -2, -2], [2, 2, 2], signed=True)
    x = np.linspace(-1.8, 1.8, 101)
    points = np.stack([x, np.full(101, 0.3), np.full(101, -0.2)], axis=1)
    # 1 m is the face; half a cell on either side the step from one centre's distance to the other's is 2 cells.
    away = np.abs(x - 1) >= 0.125
    beyond = x - 1 + 0.125 * np.sign(x - 1)
    np.testing.assert_allclose(field.at(points)[away], -beyond[away], atol=1e-6)
    np.testing.assert_allclose(field.at([[1.0, 0.1, 0.1]]), 0, atol=1e-6)


def test_a_box_without_obstacles_is_infinitely_far_and_outside_it_nothing_is_known():
    grid = filled(every_cell([0, 0, 0], [4, 4, 4]), -2.0)
    field = grid.distance_field(signed=True)
    assert np.isposinf(field.distance_m).all()
    np.testing.assert_array_equal(
        field.at([[0.5, 0.5, 0.5], [1.1, 0.5, 0.5], [np.nan, 0, 0]]), [np.inf, np.nan, np.nan]
    )
    solid = filled(every_cell([0, 0, 0], [4, 4, 4]), 2.0).distance_field(signed=True)
    assert np.isneginf(solid.distance_m).all()
    with pytest.raises(InvalidInputError, match=r"\(N, 3\)"):
        field.at([0, 0, 0])
