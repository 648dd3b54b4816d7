"""A map file gives back the same map or is refused; nothing else ever happens."""

import hashlib
import json
import zlib
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.grid import OccupancyGrid
from stereogrid.sensor_model import SensorModel

from .scenes import CAMERA, random_disparity, random_pose

laws = settings(
    max_examples=100, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@cache
def drawn_map():
    rng = np.random.default_rng(4)
    model = SensorModel(p_free=0.25, p_occupied=0.85, prior=0.4, max_range_m=1.5, motion="linear")
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
    np.testing.assert_array_equal(back.blocks.indices(), grid.blocks.indices())
    n = len(grid.blocks)
    assert back.blocks.log_odds[:n].tobytes() == grid.blocks.log_odds[:n].tobytes()
    assert back.blocks.n_updates[:n].tobytes() == grid.blocks.n_updates[:n].tobytes()


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
@example(b"SGRID 1\n{}\n")
@example(b"SGRID 2\n{}\n")
@laws
def test_what_is_not_a_map_is_refused(tmp_path, content):
    refused(tmp_path / "other.sgrid", content)
    refused(tmp_path / "other.sgrid", b"SGRID 1\n" + content)


def test_another_version_is_named(tmp_path, sound):
    assert "SGRID 1" in refused(tmp_path / "newer.sgrid", sound.replace(b"SGRID 1", b"SGRID 2", 1))


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
@example("clamp", [4])
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


@given(data=st.data(), value=st.sampled_from([np.nan, np.inf, -np.inf]))
@laws
def test_a_log_odds_that_is_not_finite_is_refused(tmp_path, sound, data, value):
    payload = bytearray(zlib.decompress(sound.split(b"\n", 2)[2][:-32]))
    n = len(drawn_map().blocks)
    at = n * 24 + 4 * data.draw(st.integers(0, n * 4096 - 1))
    payload[at : at + 4] = np.float32(value).tobytes()
    assert "not finite" in refused(tmp_path / "nan.sgrid", rebuilt(sound, payload=bytes(payload)))


def test_a_block_that_occurs_twice_is_refused(tmp_path, sound):
    payload = bytearray(zlib.decompress(sound.split(b"\n", 2)[2][:-32]))
    payload[24:48] = payload[:24]
    assert "twice" in refused(tmp_path / "twice.sgrid", rebuilt(sound, payload=bytes(payload)))


@pytest.mark.parametrize("change", [-1, 1, 4096 * 6 + 24])
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


def test_a_save_that_is_interrupted_leaves_the_old_file_and_nothing_else(tmp_path, sound, monkeypatch):
    path = tmp_path / "map.sgrid"
    path.write_bytes(sound)

    def interrupted(self, content):
        with self.open("wb") as file:
            file.write(content[: len(content) // 2])
        raise KeyboardInterrupt

    monkeypatch.setattr(type(path), "write_bytes", interrupted)
    with pytest.raises(KeyboardInterrupt):
        OccupancyGrid(0.5).save(path)
    assert path.read_bytes() == sound
    assert [each.name for each in tmp_path.iterdir()] == ["map.sgrid"]


def test_a_disk_that_is_full_is_reported_in_one_line_and_leaves_the_old_file(tmp_path, sound, monkeypatch):
    path = tmp_path / "map.sgrid"
    path.write_bytes(sound)

    def full(self, content):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(path), "write_bytes", full)
    with pytest.raises(InvalidInputError, match=r"map\.sgrid: cannot be written \(No space left on device\)"):
        OccupancyGrid(0.5).save(path)
    assert path.read_bytes() == sound
    assert [each.name for each in tmp_path.iterdir()] == ["map.sgrid"]


def test_a_folder_that_does_not_exist_is_named(tmp_path):
    with pytest.raises(InvalidInputError, match="nowhere: no such folder"):
        OccupancyGrid(0.5).save(tmp_path / "nowhere" / "map.sgrid")
    with pytest.raises(InvalidInputError, match=f"{tmp_path.name}: cannot be written"):
        OccupancyGrid(0.5).save(tmp_path)
