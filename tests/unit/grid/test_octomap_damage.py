"""An OctoMap file of a stranger's gives a map or one line; nothing else ever happens."""

import struct
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from stereogrid.errors import MapTooLargeError, RecordingError, StereogridError
from stereogrid.grid import OccupancyGrid

laws = settings(
    max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
FIRST = {".ot": b"# Octomap OcTree file", ".bt": b"# Octomap OcTree binary file"}
CHAIN = b"\x01"
"""The child mask of a node of a .ot file that has child 0 alone."""


def octree_file(suffix, data, *, size, res=b"0.1", kind=b"OcTree", first=None):
    return b"%s\n#\nid %s\nsize %d\nres %s\ndata\n" % (first or FIRST[suffix], kind, size, res) + data


def node(log_odds, children=b"\x00"):
    return struct.pack("<f", log_odds) + children


def chain(length, last):
    """length inner nodes with one child each, and what is below."""
    return node(1.0, CHAIN) * length + last


SOUND = {
    # A cell at -2 and one at 3.5 beside it, 16 levels down.
    ".ot": octree_file(".ot", chain(15, node(3.5, b"\x03") + node(-2.0) + node(3.5)), size=18),
    # The same, and a free leaf one level up.
    ".bt": octree_file(".bt", b"\x03\x00" * 14 + b"\x07\x00" + b"\x09\x00", size=19),
}


def refused(path, content, kind=RecordingError):
    path.write_bytes(content)
    with pytest.raises(kind, match=path.name) as caught:
        OccupancyGrid.load(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture(params=SOUND)
def suffix(request):
    return request.param


def test_the_files_that_are_damaged_below_are_sound(tmp_path, suffix):
    (tmp_path / f"sound{suffix}").write_bytes(SOUND[suffix])
    grid = OccupancyGrid.load(tmp_path / f"sound{suffix}")
    cells, log_odds = grid.blocks.known()
    expected = {(-32768, -32768, -32768): -2.0, (-32767, -32768, -32768): 3.5 if suffix == ".ot" else 899 / 256}
    if suffix == ".bt":
        above = np.argwhere(np.ones((2, 2, 2))) + np.array([2 - 32768, -32768, -32768])
        expected |= {tuple(cell): -2.0 for cell in above.tolist()}
    assert dict(zip(map(tuple, cells.tolist()), log_odds.tolist(), strict=True)) == expected


@given(data=st.data())
@laws
def test_a_file_cut_short_anywhere_is_refused(tmp_path, suffix, data):
    refused(tmp_path / f"cut{suffix}", SOUND[suffix][: data.draw(st.integers(0, len(SOUND[suffix]) - 1))])


@given(extra=st.binary(min_size=1, max_size=40))
@laws
def test_a_file_with_something_behind_its_tree_is_refused(tmp_path, suffix, extra):
    refused(tmp_path / f"longer{suffix}", SOUND[suffix] + extra)


@given(data=st.data(), flip=st.integers(1, 255))
@laws
def test_a_file_with_one_byte_changed_is_a_map_or_refused(tmp_path, suffix, data, flip):
    damaged = bytearray(SOUND[suffix])
    damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= flip
    (tmp_path / f"flipped{suffix}").write_bytes(damaged)
    try:
        assert OccupancyGrid.load(tmp_path / f"flipped{suffix}", memory_limit_gb=0.05).n_known > 0
    except StereogridError as error:
        assert "flipped" in str(error)
        assert "\n" not in str(error)


@given(body=st.binary(max_size=200), size=st.integers(-1, 60))
@example(b"", 0)
@example(b"", 1)
@laws
def test_a_tree_of_garbage_is_a_map_or_refused(tmp_path, suffix, body, size):
    (tmp_path / f"garbage{suffix}").write_bytes(octree_file(suffix, body, size=size))
    try:
        OccupancyGrid.load(tmp_path / f"garbage{suffix}", memory_limit_gb=0.05)
    except StereogridError as error:
        assert "garbage" in str(error)


@pytest.mark.parametrize(
    ("changes", "culprit"),
    [
        ({"first": b"# Octomap"}, "expected it to start with '# Octomap OcTree binary file'"),
        ({"first": b"SGRID 2"}, "expected it to start with"),
        ({"kind": b"ColorOcTree"}, "kind 'ColorOcTree'; choose from: OcTree"),
        ({"res": b"0"}, "cell_m must be positive"),
        ({"res": b"-0.1"}, "cell_m must be positive"),
        ({"res": b"nan"}, "cell_m must be positive"),
        ({"res": b"inf"}, "cell_m must be positive"),
        ({"res": b"wide"}, "could not convert"),
        ({"size": 10**30}, "says 1000000000000000000000000000000 nodes"),
        ({"size": -1}, "says -1 nodes"),
        ({"size": 0}, "says 0 nodes"),
    ],
)
def test_a_header_that_makes_no_sense_is_refused(tmp_path, suffix, changes, culprit):
    body = SOUND[suffix].split(b"data\n")[1]
    right = {"size": {".ot": 18, ".bt": 19}[suffix]}
    assert culprit in refused(tmp_path / f"header{suffix}", octree_file(suffix, body, **{**right, **changes}))


@pytest.mark.parametrize("line", [b"id OcTree\n", b"res 0.1\n", b"data\n"])
def test_a_header_that_lacks_a_line_is_refused(tmp_path, suffix, line):
    key = line.split()[0].decode()
    assert f"no line '{key}'" in refused(tmp_path / f"header{suffix}", SOUND[suffix].replace(line, b"", 1))


def test_a_header_without_an_end_is_refused_at_once(tmp_path, suffix):
    refused(tmp_path / f"endless{suffix}", FIRST[suffix] + b"\n" + b"#" * 10**7)
    refused(tmp_path / f"endless{suffix}", FIRST[suffix] + b"\n" * 10**7)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
def test_a_log_odds_that_is_no_number_is_refused(tmp_path, value):
    body = chain(15, node(1.0, b"\x03") + node(-2.0) + node(value))
    assert "log-odds must be finite" in refused(tmp_path / "nan.ot", octree_file(".ot", body, size=18))


def test_a_tree_of_more_than_16_levels_is_refused(tmp_path):
    deep = {".ot": chain(17, node(1.0)), ".bt": b"\x03\x00" * 16 + b"\x01\x00"}
    for suffix, body in deep.items():
        size = 18
        assert "deeper than 16 levels" in refused(tmp_path / f"deep{suffix}", octree_file(suffix, body, size=size))
    deepest = {".ot": chain(10**6, node(1.0)), ".bt": b"\x03\x00" * 10**6}
    for suffix, body in deepest.items():
        size = 10**6 + 1
        assert "deeper than 16 levels" in refused(tmp_path / f"deep{suffix}", octree_file(suffix, body, size=size))


def test_an_inner_node_without_children_is_refused(tmp_path):
    assert "has no children" in refused(tmp_path / "bare.bt", octree_file(".bt", b"\x03\x00\x00\x00", size=2))


def test_a_few_bytes_that_claim_the_whole_space_are_refused_at_once_and_without_the_memory(tmp_path):
    whole = {".ot": node(1.0), ".bt": b"\xaa\xaa"}
    OccupancyGrid.load(_write(tmp_path / "warm.ot", SOUND[".ot"]))
    for suffix, body in whole.items():
        tracemalloc.start()
        start = time.perf_counter()
        size = 1 if suffix == ".ot" else 9
        message = refused(tmp_path / f"huge{suffix}", octree_file(suffix, body, size=size), MapTooLargeError)
        assert "the limit is 4 GB" in message
        assert time.perf_counter() - start < 1
        assert tracemalloc.get_traced_memory()[1] < 5e6
        tracemalloc.stop()


def _write(path, content):
    path.write_bytes(content)
    return path


def test_large_leaves_that_fit_are_taken_apart_into_their_cells(tmp_path):
    # The leaf of level 7 (128^3 cells) at the lowest corner, beside nothing.
    path = _write(tmp_path / "box.ot", octree_file(".ot", chain(9, node(2.0)), size=10))
    grid = OccupancyGrid.load(path)
    cells, log_odds = grid.blocks.known()
    assert grid.n_known == 128**3
    assert (cells.min(axis=0) == -32768).all()
    assert (cells.max(axis=0) == -32768 + 127).all()
    assert set(log_odds.tolist()) == {2.0}
    with pytest.raises(MapTooLargeError, match=r"the limit is 0\.005 GB"):
        OccupancyGrid.load(path, memory_limit_gb=0.005)


def test_a_file_that_is_larger_than_the_limit_is_refused_before_it_is_read(tmp_path, suffix):
    path = _write(tmp_path / f"long{suffix}", octree_file(suffix, bytes(3_000_000), size=1))
    with pytest.raises(MapTooLargeError, match=r"the limit is 0\.002 GB"):
        OccupancyGrid.load(path, memory_limit_gb=0.002)


def test_comments_unknown_keys_and_the_first_files_name_of_the_tree_are_read(tmp_path, suffix):
    header, body = SOUND[suffix].split(b"data\n")
    changed = header.replace(b"OcTree\nsize", b"1\n# a comment\nauthor someone\n\nsize") + b"data\n" + body
    assert OccupancyGrid.load(_write(tmp_path / f"other{suffix}", changed)).n_known > 0


def test_a_missing_file_and_a_folder_are_refused_by_name(tmp_path, suffix):
    with pytest.raises(RecordingError, match=rf"nowhere\{suffix}: cannot be read"):
        OccupancyGrid.load(tmp_path / f"nowhere{suffix}")
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(RecordingError, match=rf"folder\{suffix}: cannot be read"):
        OccupancyGrid.load(tmp_path / f"folder{suffix}")
