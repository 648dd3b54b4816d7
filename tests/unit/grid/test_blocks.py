"""The store of blocks answers as a plain dictionary of cells would."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.grid.blocks import BLOCK, BlockStore
from stereogrid.grid.cells import LogOddsCells

RULE = LogOddsCells(prior=0.4)
indices = st.tuples(*[st.integers(-3, 3)] * 3)
batches = st.lists(st.lists(indices, min_size=1, max_size=6), min_size=1, max_size=6)


def filled(batches, seed):
    """A store to which batches of blocks were added one after the other, and the same cells as a dictionary."""
    rng = np.random.default_rng(seed)
    store, cells = BlockStore(RULE), {}
    for batch in batches:
        store.rows(np.array(batch))
        for block in dict.fromkeys(batch):
            cell = np.array(block) * BLOCK + rng.integers(0, BLOCK, 3)
            word = int(RULE.pack(rng.normal(), int(rng.integers(0, 4))))
            store.put(cell[None], np.array([word]))
            cells[tuple(cell.tolist())] = word
    return store, cells


@given(batches=batches, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_cell_keeps_its_word_however_the_store_grows(batches, seed):
    store, cells = filled(batches, seed)
    np.testing.assert_array_equal(store.words_at(np.array(list(cells))), list(cells.values()))
    values, counts = store.at(np.array(list(cells)))
    np.testing.assert_array_equal(values, RULE.log_odds(np.array(list(cells.values()))))
    np.testing.assert_array_equal(counts, RULE.n_updates(np.array(list(cells.values()))))


@given(batches=batches, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_all_cells_but_the_written_ones_are_unknown_and_at_the_prior(batches, seed):
    store, cells = filled(batches, seed)
    everywhere = np.stack(np.meshgrid(*[np.arange(-4 * BLOCK, 4 * BLOCK, 5)] * 3, indexing="ij"), -1).reshape(-1, 3)
    others = np.array([cell for cell in everywhere.tolist() if tuple(cell) not in cells])
    values, counts = store.at(others)
    assert (values == np.float32(RULE.prior_log_odds)).all()
    assert (counts == 0).all()
    blocks = {tuple(block) for batch in batches for block in batch}
    assert len(store) == len(blocks)
    assert {tuple(block) for block in store.indices().tolist()} == blocks


@given(batches=batches, seed=st.integers(0, 2**32 - 1), above=st.sampled_from([-np.inf, 0.0, 0.7]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_known_gives_each_updated_cell_above_the_threshold_once(batches, seed, above):
    store, cells = filled(batches, seed)
    found, values = store.known(above)
    words = {cell: np.array(word) for cell, word in cells.items()}
    expected = {c: float(RULE.log_odds(w)) for c, w in words.items() if RULE.n_updates(w) and RULE.log_odds(w) > above}
    assert dict(zip(map(tuple, found.tolist()), values.tolist(), strict=True)) == expected
    assert len(found) == len(expected)


@given(batches=batches, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_the_order_of_known_cells_does_not_depend_on_the_history(batches, seed):
    store, _ = filled(batches, seed)
    again = BlockStore(RULE)
    shuffled = np.random.default_rng(seed).permutation(store.indices())
    rows = again.rows(shuffled)
    again.words[rows] = store.words[store.find(shuffled)]
    for one, other in zip(store.known(), again.known(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_blocks_held_already_get_their_old_rows_and_cost_nothing():
    store = BlockStore(RULE)
    blocks = np.array([[0, 0, 0], [1, 0, -1], [-2, 5, 0]])
    rows = store.rows(blocks)
    assert store.n_bytes == store.bytes_of(3) == store.bytes_with(blocks[::-1])
    np.testing.assert_array_equal(store.rows(blocks[::-1]), rows[::-1])
    assert len(store) == 3
    assert store.bytes_with(np.array([[0, 0, 0], [9, 9, 9]])) == store.bytes_of(4)
    np.testing.assert_array_equal(store.find(np.array([[9, 9, 9], [1, 0, -1]])), [-1, rows[1]])


def test_a_block_that_is_asked_for_twice_at_once_gets_one_row():
    store = BlockStore(RULE)
    rows = store.rows(np.array([[1, 2, 3], [4, 5, 6], [1, 2, 3]]))
    assert rows[0] == rows[2] != rows[1]
    assert len(store) == 2


def test_blocks_may_lie_however_far_apart():
    far = 10**13
    store = BlockStore(RULE)
    blocks = np.array([[0, 0, 0], [far, far, far], [-far, far, -far]])
    cells = np.concatenate([blocks, blocks + 1, -blocks[1:]]) * BLOCK + [1, 2, 3]
    store.put(cells[:3], RULE.pack(np.zeros(3), np.array([1, 2, 3])))
    np.testing.assert_array_equal(store.at(cells)[1], [1, 2, 3, 0, 0, 0, 0, 0])


def test_thousands_of_blocks_in_a_plane_are_found_again():
    # Hashes of neighbours must not pile up: a slow find would show as a test that hangs.
    store = BlockStore(RULE)
    plane = np.stack(np.meshgrid(np.arange(-150, 150), np.arange(-150, 150), [3], indexing="ij"), -1).reshape(-1, 3)
    rows = store.rows(plane)
    np.testing.assert_array_equal(store.find(plane[::-1]), rows[::-1])
    assert (store.find(plane + np.array([0, 0, 1])) == -1).all()


def test_the_bytes_reported_are_at_least_those_of_the_cells_and_little_more():
    store = BlockStore(RULE)
    store.rows(np.array([[0, 0, 0], [1, 0, 0]]))
    assert 2 * BLOCK**3 * 4 <= store.n_bytes <= 2 * BLOCK**3 * 4.1


def test_an_empty_store_knows_nothing():
    store = BlockStore(RULE)
    cells, values = store.known()
    assert (cells.shape, values.shape, store.indices().shape, store.n_bytes) == ((0, 3), (0,), (0, 3), 0)
    assert [len(each) for each in store.at(np.empty((0, 3), dtype=np.int64))] == [0, 0]
    assert store.at(np.array([[5, -5, 0]]))[1] == 0
