"""A map file gives back the same map or is refused; nothing else ever happens."""

import hashlib
import json
import tracemalloc
import zlib
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError, MapTooLargeError, RecordingError
from stereogrid.grid import OccupancyGrid, mapfile
from stereogrid.sensor_model import SensorModel

from .scenes import CAMERA, random_disparity, random_pose

laws = settings(
    max_examples=100, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@cache
def drawn_map():
    rng = np.random.default_rng(4)
    model = SensorModel(p_free=0.25, p_occupied=0.85, prior=0.4, max_range_m=1.5)
    grid = OccupancyGrid(0.1, model=model, clamp=3.0)
    for _ in range(2):
        grid.integrate(CAMERA, random_disparity(rng), random_pose(rng))
    return grid


@pytest.fixture
def map_file(tmp_path):
    return drawn_map().save(tmp_path / "map.sgrid")


@cache
def map_bytes(folder):
    return drawn_map().save(folder / "original.sgrid").read_bytes()


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return map_bytes(tmp_path_factory.mktemp("maps"))


def rebuilt(content, *, header=None, payload=None, more=b"", line=None):
    """A map file with another header or payload, and a checksum that says that all is well."""
    magic, old_line, rest = content.split(b"\n", 2)
    old_payload = zlib.decompress(rest[:-32])
    if line is None:
        line = json.dumps({**json.loads(old_line), **(header or {})}).encode()
    body = zlib.compress(old_payload if payload is None else payload, 1) + more
    made = magic + b"\n" + line + b"\n" + body
    return made + hashlib.sha256(made).digest()


def refused(path, content):
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=path.name) as caught:
        OccupancyGrid.load(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# What is saved comes back


@pytest.mark.parametrize("clamp", [3.0, None])
@pytest.mark.parametrize("fusion", ["cell", "sum_of_rays"])
def test_a_map_comes_back_bit_by_bit_with_all_that_it_was_made_with(tmp_path, clamp, fusion):
    rng = np.random.default_rng(6)
    grid = OccupancyGrid(0.1, model=SensorModel(prior=0.35, max_range_m=1.5), clamp=clamp, fusion=fusion)
    grid.integrate(CAMERA, random_disparity(rng), random_pose(rng))
    back = OccupancyGrid.load(grid.save(tmp_path / "map.sgrid"))
    assert (back.cell_m, back.model, back.fusion, back.clamp) == (grid.cell_m, grid.model, grid.fusion, grid.clamp)
    assert back.sha256() == grid.sha256()
    np.testing.assert_array_equal(back.blocks.indices(), grid.blocks.indices()[grid.blocks.in_order()])
    words = grid.blocks.words[: len(grid.blocks)]
    assert back.blocks.words[: len(back.blocks)].tobytes() == words[grid.blocks.in_order()].tobytes()


def test_a_map_that_came_back_goes_on_like_the_one_that_stayed(map_file):
    rng = np.random.default_rng(9)
    pose, disparity = random_pose(rng), random_disparity(rng)
    stayed, back = OccupancyGrid.load(map_file), OccupancyGrid.load(map_file)
    again = OccupancyGrid.load(back.save(map_file))
    for grid in (stayed, again):
        grid.integrate(CAMERA, disparity, pose)
    assert stayed.sha256() == again.sha256() != drawn_map().sha256()


def test_an_empty_map_comes_back_empty(tmp_path):
    back = OccupancyGrid.load(OccupancyGrid(0.2).save(tmp_path / "empty.sgrid"))
    assert (back.n_known, back.cell_m) == (0, 0.2)


def test_the_same_map_is_saved_as_the_same_bytes(tmp_path, sound):
    assert drawn_map().save(tmp_path / "again.sgrid").read_bytes() == sound
    assert OccupancyGrid.load(tmp_path / "again.sgrid").save(tmp_path / "third.sgrid").read_bytes() == sound


@given(seed=st.integers(0, 2**32 - 1))
@laws
def test_the_same_cells_in_another_order_are_saved_as_the_same_bytes(tmp_path, seed):
    rng = np.random.default_rng(seed)
    cells = np.unique(rng.integers(-40, 40, (200, 3)), axis=0)
    log_odds, counts = rng.uniform(-5, 5, len(cells)), rng.integers(1, 5000, len(cells))
    other = rng.permutation(len(cells))
    first = OccupancyGrid.from_cells(0.1, cells, log_odds, counts).save(tmp_path / "first.sgrid")
    second = OccupancyGrid.from_cells(0.1, cells[other], log_odds[other], counts[other])
    second.blocks.rows(np.array([[7, 7, -9], [0, 99, 0]]))  # blocks that know nothing leave no trace
    assert second.save(tmp_path / "second.sgrid").read_bytes() == first.read_bytes()


@pytest.mark.parametrize("clamp", [4.0, None])
def test_saving_and_loading_take_little_more_memory_than_the_map(tmp_path, clamp):
    grid = OccupancyGrid(0.1, clamp=clamp)
    rows, rule = grid.blocks.rows(np.argwhere(np.ones((25, 25, 25)))), grid.blocks.rule
    values = np.random.default_rng(3).integers(-1000, 1000, (len(rows), 512), dtype=rule.dtype)
    grid.blocks.words[rows] = values << rule.count_bits | 1
    assert grid.n_bytes > 30e6
    del values
    tracemalloc.start()
    path = grid.save(tmp_path / "large.sgrid")
    saving = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    back = OccupancyGrid.load(path)
    loading = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert saving < 10e6
    assert loading < 1.1 * grid.n_bytes + 15e6
    np.testing.assert_array_equal(back.blocks.words, grid.blocks.words[grid.blocks.in_order()])


# Damage


@given(data=st.data())
@laws
def test_a_map_cut_short_anywhere_is_refused(tmp_path, sound, data):
    end = data.draw(st.one_of(st.integers(0, 400), st.integers(0, len(sound) - 1)))
    refused(tmp_path / "cut.sgrid", sound[:end])


@given(data=st.data(), flip=st.integers(1, 255))
@laws
def test_a_map_with_one_byte_changed_anywhere_is_refused(tmp_path, sound, data, flip):
    at = data.draw(st.one_of(st.integers(0, 300), st.integers(0, len(sound) - 1)))
    damaged = bytearray(sound)
    damaged[at] ^= flip
    refused(tmp_path / "flipped.sgrid", bytes(damaged))


@given(extra=st.binary(min_size=1, max_size=50))
@laws
def test_a_map_with_something_behind_it_is_refused(tmp_path, sound, extra):
    refused(tmp_path / "longer.sgrid", sound + extra)


@given(content=st.binary(max_size=300))
@example(b"")
@example(b"SGRID 1\n")
@example(b"SGRID 2\n")
@example(b"SGRID 2\n{}\n")
@example(b"SGRID 3\n{}\n")
@laws
def test_what_is_not_a_map_is_refused(tmp_path, content):
    refused(tmp_path / "other.sgrid", content)
    refused(tmp_path / "other.sgrid", b"SGRID 2\n" + content)


def test_another_version_is_named(tmp_path, sound):
    for version in (b"SGRID 1", b"SGRID 3"):
        message = refused(tmp_path / "other.sgrid", sound.replace(b"SGRID 2", version, 1))
        assert f"start with 'SGRID 2', not '{version.decode()}'" in message


# Lies under a checksum that is right

anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)


@given(key=st.sampled_from(["cell_m", "model", "fusion", "clamp", "n_blocks"]), value=anything)
@example("n_blocks", 10**15)
@example("n_blocks", float("inf"))
@example("n_blocks", float("nan"))
@example("n_blocks", -1)
@example("n_blocks", 0)
@example("cell_m", 10**400)
@example("cell_m", 0)
@example("cell_m", True)
@example("n_blocks", 1.0)
@example("clamp", [4])
@example("clamp", ["-4", "4"])
@example("clamp", [4, -4])
@example("clamp", [-(10**400), 10**400])
@example("clamp", [-3.0, 3.5])
@example("clamp", None)
@example("clamp", 3.0)
@example("model", {"p_free": "0.3"})
@example("model", {"p_free": 0.3, "surprise": 1})
@example("fusion", ["cell"])
@laws
def test_a_header_that_lies_is_refused_or_says_what_a_map_may_say(tmp_path, sound, key, value):
    path = tmp_path / "lie.sgrid"
    path.write_bytes(rebuilt(sound, header={key: value}))
    try:
        grid = OccupancyGrid.load(path)
    except RecordingError as error:
        assert path.name in str(error)
    else:
        assert grid.cell_m > 0
        assert grid.n_known == drawn_map().n_known
        assert key != "n_blocks" or int(value) == len(grid.blocks)


@pytest.mark.parametrize("key", ["cell_m", "model", "fusion", "clamp", "n_blocks"])
def test_a_header_that_lacks_a_key_is_refused(tmp_path, sound, key):
    header = json.loads(sound.split(b"\n", 2)[1])
    del header[key]
    assert key in refused(tmp_path / "lacking.sgrid", rebuilt(sound, line=json.dumps(header).encode()))


@given(
    line=st.binary(max_size=60).filter(lambda line: b"\n" not in line) | anything.map(lambda v: json.dumps(v).encode())
)
@example(b"[" * 9000)
@example(b'{"n_blocks":' * 700)
@example(b"{" + b"9" * 9000)
@example(b"9" * 9000)
@example(b"{" + b" " * 20000 + b"}")
@laws
def test_a_header_of_garbage_is_refused(tmp_path, sound, line):
    refused(tmp_path / "garbage.sgrid", rebuilt(sound, line=line))


def test_a_map_that_claims_a_huge_number_of_blocks_is_refused_before_they_are_made_room_for(tmp_path, sound):
    message = refused(tmp_path / "huge.sgrid", rebuilt(sound, header={"n_blocks": 10**9}))
    assert "1000000000 blocks cannot be in" in message


def test_a_map_that_is_larger_than_it_may_be_is_refused_before_room_is_made_for_it(tmp_path):
    zeros = {"payload": bytes(20_000 * (24 + 2048)), "header": {"n_blocks": 20_000}}
    path = tmp_path / "large.sgrid"
    path.write_bytes(rebuilt(map_bytes(tmp_path), **zeros))
    tracemalloc.start()
    with pytest.raises(
        MapTooLargeError, match=r"large\.sgrid: the map needs 0\.04 GB, the limit is 0\.02 GB"
    ) as caught:
        OccupancyGrid.load(path, memory_limit_gb=0.02)
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()
    assert "\n" not in str(caught.value)


def words_changed(sound, change):
    """A map file whose words change(words (B, 512)) alters, with a checksum that is right."""
    payload = bytearray(zlib.decompress(sound.split(b"\n", 2)[2][:-32]))
    n = json.loads(sound.split(b"\n", 2)[1])["n_blocks"]
    words = np.frombuffer(payload, "<i4", offset=24 * n).reshape(n, 512)
    change(words)
    return rebuilt(sound, payload=bytes(payload))


@given(data=st.data(), past=st.sampled_from([1, 2, 1000]), side=st.sampled_from([-1, 1]))
@laws
def test_a_cell_beyond_the_clamp_is_refused(tmp_path, sound, data, past, side):
    rule = drawn_map().blocks.rule
    limit = round((side * 3.0 - rule.prior_log_odds) * 256)

    def change(words):
        n, word = np.prod(words.shape), ((limit + side * past) << 12) + 1
        words.flat[data.draw(st.integers(0, n - 1))] = word

    assert "beyond the clamp" in refused(tmp_path / "clamp.sgrid", words_changed(sound, change))


@given(data=st.data(), value=st.integers(-700, 700).filter(bool))
@laws
def test_a_value_without_an_update_is_refused(tmp_path, sound, data, value):
    def change(words):
        words.flat[data.draw(st.integers(0, words.size - 1))] = value << 12

    assert "never updated has a value" in refused(tmp_path / "valued.sgrid", words_changed(sound, change))


def with_indices(sound, change):
    payload = bytearray(zlib.decompress(sound.split(b"\n", 2)[2][:-32]))
    n = json.loads(sound.split(b"\n", 2)[1])["n_blocks"]
    change(np.frombuffer(payload, "<i8", count=3 * n).reshape(n, 3))
    return rebuilt(sound, payload=bytes(payload))


def test_blocks_that_occur_twice_or_out_of_order_are_refused(tmp_path, sound):
    def twice(indices):
        indices[1] = indices[0]

    def swapped(indices):
        indices[[0, 1]] = indices[[1, 0]]

    for change in (twice, swapped):
        assert "out of order, or one occurs twice" in refused(tmp_path / "o.sgrid", with_indices(sound, change))


@pytest.mark.parametrize("index", [2**63 - 1, -(2**63), 2**49 + 1, -(2**49) - 1])
def test_a_block_beyond_all_places_is_refused(tmp_path, sound, index):
    def change(indices):
        indices[-1 if index > 0 else 0] = index

    assert "beyond all places" in refused(tmp_path / "far.sgrid", with_indices(sound, change))


@pytest.mark.parametrize("change", [-1, 1, 512 * 4 + 24])
def test_a_payload_of_another_length_is_refused(tmp_path, sound, change):
    payload = zlib.decompress(sound.split(b"\n", 2)[2][:-32])
    payload = payload[:change] if change < 0 else payload + bytes(change)
    refused(tmp_path / "length.sgrid", rebuilt(sound, payload=payload))


def test_bytes_between_the_blocks_and_the_checksum_are_refused(tmp_path, sound):
    refused(tmp_path / "stuffed.sgrid", rebuilt(sound, more=b"stuffing"))


# The file system


def test_a_missing_map_and_a_folder_are_refused_by_name(tmp_path):
    with pytest.raises(RecordingError, match=r"nowhere\.sgrid: cannot be read"):
        OccupancyGrid.load(tmp_path / "nowhere.sgrid")
    with pytest.raises(RecordingError, match=f"{tmp_path.name}: cannot be read"):
        OccupancyGrid.load(tmp_path)


def breaking_off(error):
    """What writes half a file and then raises."""

    def content(grid):
        yield b"SGRID 2\n"
        raise error

    return content


def test_a_save_that_is_interrupted_leaves_the_old_file_and_nothing_else(tmp_path, sound, monkeypatch):
    path = tmp_path / "map.sgrid"
    path.write_bytes(sound)

    monkeypatch.setattr(mapfile, "_content", breaking_off(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        OccupancyGrid(0.5).save(path)
    assert path.read_bytes() == sound
    assert [each.name for each in tmp_path.iterdir()] == ["map.sgrid"]


def test_a_disk_that_is_full_is_reported_in_one_line_and_leaves_the_old_file(tmp_path, sound, monkeypatch):
    path = tmp_path / "map.sgrid"
    path.write_bytes(sound)
    monkeypatch.setattr(mapfile, "_content", breaking_off(OSError(28, "No space left on device")))
    with pytest.raises(InvalidInputError, match=r"map\.sgrid: cannot be written \(No space left on device\)"):
        OccupancyGrid(0.5).save(path)
    assert path.read_bytes() == sound
    assert [each.name for each in tmp_path.iterdir()] == ["map.sgrid"]


def test_a_folder_that_does_not_exist_is_named(tmp_path):
    with pytest.raises(InvalidInputError, match="nowhere: no such folder"):
        OccupancyGrid(0.5).save(tmp_path / "nowhere" / "map.sgrid")
    with pytest.raises(InvalidInputError, match=f"{tmp_path.name}: cannot be written"):
        OccupancyGrid(0.5).save(tmp_path)
