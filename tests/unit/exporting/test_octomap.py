"""OctoMap's files: its own library and tools read what we write, and we what they write."""

import shutil
import subprocess

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.exporting import export
from stereogrid.grid import OccupancyGrid, morton

from .maps import known, random_map

octomap = pytest.importorskip("octomap", reason="needs octomap-python, of the extra bench")
few = settings(max_examples=20, deadline=None, derandomize=True)

HALF_STEP = 1 / 512 + 1e-6
"""Our log-odds are multiples of 1 / 256."""


def tool(name, *arguments):
    """Run one of OctoMap's own commands; skip, naming it, where it is not installed."""
    if shutil.which(name) is None:
        pytest.skip(f"needs {name}, of Debian's octomap-tools")
    done = subprocess.run([name, *map(str, arguments)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def read_by_octomap(path):
    """The tree of a file as OctoMap's library reads it."""
    if path.suffix == ".ot":
        return octomap.OcTree.read(str(path).encode())
    tree = octomap.OcTree(1.0)
    assert tree.readBinary(str(path).encode())
    return tree


def cells_of(tree):
    """{cell: log-odds} of all leaves, those that OctoMap pruned taken apart."""
    cell_m, found = tree.getResolution(), {}
    for leaf in tree.begin_leafs():
        side = round(leaf.getSize() / cell_m)
        first = np.rint((np.array(leaf.getCoordinate()) - leaf.getSize() / 2) / cell_m).astype(int)
        for cell in np.ndindex(side, side, side):
            found[tuple((first + cell).tolist())] = leaf.getValue()
    return found


def random_tree(seed, cell_m=0.25, n=300):
    """A tree that OctoMap's own updates made, with pruned leaves."""
    rng = np.random.default_rng(seed)
    tree = octomap.OcTree(cell_m)
    corner = rng.integers(-20, 20, 3) // 4 * 4
    for cell in [*(corner + np.argwhere(np.ones((8, 4, 4)))), *rng.integers(-20, 20, (n, 3))]:
        tree.updateNode((cell + 0.5) * cell_m, float(rng.choice([-9.0, -0.4, 0.85, 2.0])))
    tree.updateInnerOccupancy()
    return tree


# What we write


@given(seed=st.integers(0, 2**32 - 1), clamp=st.sampled_from([4.0, None]))
@few
def test_octomap_reads_every_log_odds_that_we_write(tmp_path_factory, seed, clamp):
    grid = random_map(seed, clamp=clamp)
    path = tmp_path_factory.mktemp("ot") / "map.ot"
    tree = read_by_octomap(export(grid, path))
    assert tree.getResolution() == grid.cell_m
    assert cells_of(tree) == known(grid)


@given(seed=st.integers(0, 2**32 - 1))
@few
def test_octomap_reads_what_we_write_as_occupied_and_free(tmp_path_factory, seed):
    grid = random_map(seed)
    path = tmp_path_factory.mktemp("bt") / "map.bt"
    tree = read_by_octomap(export(grid, path))
    occupied = {cell: value > 0 for cell, value in cells_of(tree).items()}
    assert occupied == {cell: value >= 0 for cell, value in known(grid).items()}


@pytest.mark.parametrize("suffix", [".ot", ".bt"])
def test_octomap_writes_what_it_read_of_ours_as_the_same_bytes(tmp_path, suffix):
    path = export(random_map(3), tmp_path / f"map{suffix}")
    tree = read_by_octomap(path)
    again = tmp_path / f"again{suffix}"
    assert (tree.write if suffix == ".ot" else tree.writeBinary)(str(again).encode())
    assert again.read_bytes() == path.read_bytes()


def test_octomap_prunes_nothing_more_and_the_map_is_smaller_than_its_cells(tmp_path):
    grid = OccupancyGrid.from_cells(0.1, np.argwhere(np.ones((16, 16, 16))) - 16, np.full(16**3, -2.0))
    path = export(grid, tmp_path / "box.ot")
    tree = read_by_octomap(path)
    # The root, a node for each of the twelve halvings, and the box itself.
    assert (tree.size(), tree.getNumLeafNodes()) == (13, 1)
    assert b"\nsize 13\n" in path.read_bytes()


def test_inner_nodes_hold_the_largest_log_odds_below_them(tmp_path):
    grid = random_map(5)
    tree = read_by_octomap(export(grid, tmp_path / "map.ot"))
    assert tree.getRoot().getValue() == max(known(grid).values())
    before = tree.write()
    tree.updateInnerOccupancy()
    assert tree.write() == before


def test_a_map_without_cells_is_a_tree_without_nodes(tmp_path):
    for suffix in (".ot", ".bt"):
        path = export(OccupancyGrid(0.1), tmp_path / f"empty{suffix}")
        assert path.read_bytes().endswith(b"size 0\nres 0.1\ndata\n")
        assert read_by_octomap(path).size() == 0
        assert OccupancyGrid.load(path).n_known == 0


@pytest.mark.parametrize("cell", [(32767, 0, 0), (-32768, -32768, -32768), (0, 32767, -32768)])
def test_the_farthest_cells_of_octomap_can_be_written(tmp_path, cell):
    grid = OccupancyGrid.from_cells(0.05, np.array([cell]), [2.0])
    path = export(grid, tmp_path / "far.ot")
    assert cells_of(read_by_octomap(path)) == {cell: 2.0}
    assert known(OccupancyGrid.load(path)) == {cell: 2.0}


@pytest.mark.parametrize("cell", [(32768, 0, 0), (0, -32769, 0), (0, 0, 10**6)])
def test_cells_that_octomap_cannot_reach_are_refused_and_named(tmp_path, cell):
    grid = OccupancyGrid.from_cells(0.05, np.array([cell]), [2.0])
    with pytest.raises(InvalidInputError, match=r"cell \[.*\] is out of OctoMap's reach, .* 32768 cells \(1638.4 m\)"):
        export(grid, tmp_path / "far.ot")
    assert list(tmp_path.iterdir()) == []


# What OctoMap's tools make of it


def test_octomaps_tool_turns_our_ot_into_our_bt(tmp_path):
    grid = random_map(6)
    tool("convert_octree", export(grid, tmp_path / "map.ot"), tmp_path / "theirs.bt")
    assert (tmp_path / "theirs.bt").read_bytes() == export(grid, tmp_path / "ours.bt").read_bytes()


def test_octomaps_tool_finds_no_difference_between_a_map_and_what_we_read_and_wrote_of_it(tmp_path):
    export(random_map(7), tmp_path / "map.ot")
    export(OccupancyGrid.load(tmp_path / "map.ot"), tmp_path / "again.ot")
    assert "KLD: 0\n" in tool("compare_octrees", tmp_path / "map.ot", tmp_path / "again.ot")


def test_octomaps_tool_draws_as_many_boxes_as_there_are_occupied_cells(tmp_path):
    cells = np.array([[0, 0, 0], [1, 0, 0], [5, 5, 5], [-3, 2, 1]])
    grid = OccupancyGrid.from_cells(0.1, cells, [2.0, -1.0, 3.0, 0.5])
    assert "writing 3 voxels" in tool("bt2vrml", export(grid, tmp_path / "map.bt"))


# What we read


@given(seed=st.integers(0, 2**32 - 1))
@few
def test_we_read_every_log_odds_that_octomap_writes(tmp_path_factory, seed):
    tree = random_tree(seed)
    path = tmp_path_factory.mktemp("ot") / "theirs.ot"
    tree.write(str(path).encode())
    grid = OccupancyGrid.load(path)
    ours, theirs = known(grid), cells_of(tree)
    assert (grid.cell_m, set(ours)) == (0.25, set(theirs))
    assert max(abs(ours[cell] - theirs[cell]) for cell in ours) <= HALF_STEP
    for point in np.random.default_rng(seed).uniform(-5, 5, (50, 3)):
        node, p = tree.search(point), grid.probability(point)[0]
        try:
            assert p == pytest.approx(node.getOccupancy(), abs=1e-3)
        except octomap.NullPointerException:
            assert np.isnan(p)


@given(seed=st.integers(0, 2**32 - 1))
@few
def test_we_read_a_bt_file_as_octomap_does(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("bt") / "theirs.bt"
    random_tree(seed).writeBinary(str(path).encode())
    ours, theirs = known(OccupancyGrid.load(path)), cells_of(read_by_octomap(path))
    assert set(ours) == set(theirs)
    assert set(ours.values()) <= {-2.0, 899 / 256}
    assert max(abs(ours[cell] - theirs[cell]) for cell in ours) <= HALF_STEP


@pytest.mark.parametrize("options", [{}, {"clamp": None}, {"clamp": (-30.0, 40.0)}])
def test_a_map_that_went_through_an_ot_file_is_the_same_map(tmp_path, options):
    grid = random_map(8, **options)
    back = OccupancyGrid.load(export(grid, tmp_path / "map.ot"))
    assert back.sha256() == grid.sha256()
    assert back.clamp == (-2.0, 3.511)
    assert export(back, tmp_path / "again.ot").read_bytes() == (tmp_path / "map.ot").read_bytes()


def test_log_odds_beyond_octomaps_clamp_widen_the_clamp(tmp_path):
    grid = OccupancyGrid.from_cells(0.1, np.array([[0, 0, 0], [4, 0, 0]]), [-7.5, 20.0], clamp=None)
    back = OccupancyGrid.load(export(grid, tmp_path / "map.ot"))
    assert (back.clamp, known(back)) == ((-7.5, 20.0), known(grid))


def test_codes_are_keys_with_their_bits_interleaved():
    keys = np.random.default_rng(0).integers(0, 2**16, (1000, 3))
    codes = morton.encode(keys)
    for key, code in zip(keys.tolist(), codes.tolist(), strict=True):
        bits = (f"{key[axis]:016b}" for axis in (2, 1, 0))
        assert int("".join(map("".join, zip(*bits, strict=True))), 2) == code
    np.testing.assert_array_equal(morton.decode(codes), keys)
