"""Laws of projections and sections."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_rotation, transform
from stereogrid.grid import State

from .maps import filled, known, random_map

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=7, deadline=None, derandomize=True)


@given(seed=seeds, low=st.integers(-20, 14), height=st.integers(1, 12), p_free=st.sampled_from([None, 0.3]))
@few
def test_a_column_is_occupied_if_any_cell_is_and_free_if_all_its_known_ones_are(seed, low, height, p_free):
    grid = random_map(seed, share_known=0.1)
    columns = {}
    for (i, j, k), p in known(grid).items():
        if low <= k < low + height:
            columns.setdefault((i, j), []).append(p)
    if not columns:
        with pytest.raises(InvalidInputError, match="knows no cell at z"):
            grid.project(low * 0.25, (low + height) * 0.25)
        return
    # The band ends just inside its last cell: a band meets each cell that it enters.
    flat = grid.project(low * 0.25, (low + height) * 0.25 - 0.01, p_free=p_free)
    first = np.round(flat.origin_m / flat.cell_m).astype(int)
    assert (np.array(list(columns)) - first).min(axis=0).tolist() == [0, 0]
    np.testing.assert_array_equal(np.array(list(columns)).max(axis=0) + 1 - first, flat.state.shape)
    for (i, j), p in np.ndenumerate(flat.probability):
        ps = np.array(columns.get((i + first[0], j + first[1]), []))
        if not len(ps):
            expected = State.UNKNOWN
            assert np.isnan(p)
        else:
            assert p == ps.max()
            free = 0.5 if p_free is None else p_free
            expected = State.OCCUPIED if (ps > 0.5).any() else State.FREE if (ps <= free).all() else State.UNKNOWN
        assert flat.state[i, j] == expected


def test_an_infinite_band_is_the_whole_map_and_an_inverted_one_is_refused():
    grid = random_map(1)
    whole, all_of_it = grid.project(-np.inf, np.inf), grid.project(-5, 5)
    np.testing.assert_array_equal(whole.probability, all_of_it.probability)
    for band in ((1, 1), (2, 1), (np.nan, 1)):
        with pytest.raises(InvalidInputError, match="band of heights"):
            grid.project(*band)


@given(seed=seeds)
@few
def test_a_section_is_the_maps_answer_at_its_points(seed):
    grid, rng = random_map(seed), np.random.default_rng(seed)
    pose = from_rotation(Rotation.random(random_state=rng).as_matrix(), rng.uniform(-1, 1, 3))
    section = grid.section(pose, (-2.0, 3.0), (-1.0, 0.5), step_m=0.1)
    assert section.probability.shape == (len(section.u_m), len(section.v_m)) == (50, 15)
    for i, j in [(0, 0), (49, 14), (20, 3)]:
        np.testing.assert_allclose([section.u_m[i], section.v_m[j]], [-2 + 0.1 * (i + 0.5), -1 + 0.1 * (j + 0.5)])
    points = [transform(pose, [u, v, 0]) for u in section.u_m for v in section.v_m]
    np.testing.assert_allclose(section.probability.ravel(), grid.probability(points), rtol=1e-6)


def test_a_level_section_in_steps_of_a_cell_is_the_layer_of_the_map():
    grid = random_map(2)
    section = grid.section(from_rotation(np.eye(3), (0, 0, 0.3)), (-4, 4), (-4, 4))
    i, j = np.nonzero(np.isfinite(section.probability))
    layer = grid.known_layer(0.3)
    np.testing.assert_array_equal(np.stack([i, j], axis=1) - 16, layer[np.lexsort(layer.T[::-1])])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.eye(3), (0, 1), (0, 1)), "T_world_plane"),
        ((2 * np.eye(4), (0, 1), (0, 1)), "T_world_plane"),
        ((np.eye(4), (1, 0), (0, 1)), "u_m"),
        ((np.eye(4), (0, 1), (0, np.inf)), "v_m"),
    ],
)
def test_planes_that_cannot_be_meant_are_refused(arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        filled([[0, 0, 0]], 1.0).section(*arguments)


@pytest.mark.parametrize("step_m", [0, -1, np.nan])
def test_a_step_that_is_none_is_refused(step_m):
    with pytest.raises(InvalidInputError, match="step_m"):
        filled([[0, 0, 0]], 1.0).section(np.eye(4), (0, 1), (0, 1), step_m=step_m)
