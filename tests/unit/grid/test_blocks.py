"""The store of blocks answers as a plain dictionary of cells would."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.grid.blocks import BYTES_PER_CELL, BlockStore
from stereogrid.grid.kernels import BLOCK

indices = st.tuples(*[st.integers(-3, 3)] * 3)
batches = st.lists(st.lists(indices, min_size=1, max_size=6), min_size=1, max_size=6)


def filled(batches, seed):
    """A store to which batches of blocks were added one after the other, and the same cells as a dictionary."""
    rng = np.random.default_rng(seed)
    store, cells = BlockStore(-0.25), {}
    for batch in batches:
        rows = store.rows(np.array(batch))
        for block, row in zip(batch, rows, strict=True):
            place = tuple(rng.integers(0, BLOCK, 3))
            value, count = np.float32(rng.normal()), int(rng.integers(0, 4))
            store.log_odds[(row, *place)], store.n_updates[(row, *place)] = value, count
            cells[tuple(np.array(block) * BLOCK + place)] = (value, count)
    return store, cells


@given(batches=batches, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_cell_keeps_its_value_however_the_store_grows(batches, seed):
    store, cells = filled(batches, seed)
    values, counts = store.at(np.array(list(cells)))
    np.testing.assert_array_equal(values, [value for value, _ in cells.values()])
    np.testing.assert_array_equal(counts, [count for _, count in cells.values()])


@given(batches=batches, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_all_cells_but_the_written_ones_are_unknown_and_at_the_prior(batches, seed):
    store, cells = filled(batches, seed)
    everywhere = np.stack(np.meshgrid(*[np.arange(-4 * BLOCK, 4 * BLOCK, 5)] * 3, indexing="ij"), -1).reshape(-1, 3)
    others = np.array([cell for cell in everywhere.tolist() if tuple(cell) not in cells])
    values, counts = store.at(others)
    assert (values == np.float32(-0.25)).all()
    assert (counts == 0).all()
    blocks = {tuple(block) for batch in batches for block in batch}
    assert len(store) == len(blocks)
    assert {tuple(block) for block in store.indices().tolist()} == blocks


@given(batches=batches, seed=st.integers(0, 2**32 - 1), above=st.sampled_from([-np.inf, 0.0, 0.7]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_known_gives_each_updated_cell_above_the_threshold_once(batches, seed, above):
    store, cells = filled(batches, seed)
    found, values = store.known(above)
    expected = {cell: value for cell, (value, count) in cells.items() if count and value > above}
    assert dict(zip(map(tuple, found.tolist()), values.tolist(), strict=True)) == expected
    assert len(found) == len(expected)


@given(batches=batches, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_the_order_of_known_cells_does_not_depend_on_the_history(batches, seed):
    store, _ = filled(batches, seed)
    again = BlockStore(-0.25)
    shuffled = np.random.default_rng(seed).permutation(store.indices())
    rows = again.rows(shuffled)
    mine = store.rows(shuffled)
    again.log_odds[rows], again.n_updates[rows] = store.log_odds[mine], store.n_updates[mine]
    for one, other in zip(store.known(), again.known(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_blocks_held_already_get_their_old_rows_and_cost_nothing():
    store = BlockStore(0.0)
    blocks = np.array([[0, 0, 0], [1, 0, -1], [-2, 5, 0]])
    rows = store.rows(blocks)
    assert store.n_bytes == 3 * BLOCK**3 * BYTES_PER_CELL == store.bytes_with(blocks[::-1])
    np.testing.assert_array_equal(store.rows(blocks[::-1]), rows[::-1])
    assert len(store) == 3
    assert store.bytes_with(np.array([[0, 0, 0], [9, 9, 9]])) == 4 * BLOCK**3 * BYTES_PER_CELL


def test_blocks_may_lie_however_far_apart():
    far = 10**13
    store = BlockStore(0.0)
    blocks = np.array([[0, 0, 0], [far, far, far], [-far, far, -far]])
    rows = store.rows(blocks)
    store.n_updates[rows, 1, 2, 3] = [1, 2, 3]
    cells = np.concatenate([blocks, blocks + 1, -blocks[1:]]) * BLOCK + [1, 2, 3]
    np.testing.assert_array_equal(store.at(cells)[1], [1, 2, 3, 0, 0, 0, 0, 0])


def test_the_bytes_reported_are_those_of_the_arrays():
    store = BlockStore(0.0)
    store.rows(np.array([[0, 0, 0], [1, 0, 0]]))
    assert store.n_bytes == store.log_odds.nbytes + store.n_updates.nbytes


def test_an_empty_store_knows_nothing():
    store = BlockStore(0.3)
    cells, values = store.known()
    assert (cells.shape, values.shape, store.indices().shape, store.n_bytes) == ((0, 3), (0,), (0, 3), 0)
    assert [len(each) for each in store.at(np.empty((0, 3), dtype=np.int64))] == [0, 0]
    assert store.at(np.array([[5, -5, 0]]))[1] == 0
