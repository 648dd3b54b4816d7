"""A raw recording that was cut, killed or corrupted gives its readable part or one RecordingError."""

import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from stereogrid.camera import StereoCamera
from stereogrid.errors import RecordingError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.observation import Observation
from stereogrid.recording import RawReport, RawWriter, open_recording

CAMERA = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
N = 5


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    folder = tmp_path_factory.mktemp("raw_damage")
    rng = np.random.default_rng(5)
    ends = []
    with RawWriter(folder / "whole.mcap", CAMERA, from_rotation(R_BASE_OPTICAL, [0.1, 0, 0.4])) as writer:
        for k in range(N + 1):
            writer.write_report(RawReport(10 + 0.1 * k, from_yaw(0.1 * k, [0.2 * k, 0, 0]), sonar_m={k: 1.0}))
            # A pair counts once the report after it is there too.
            ends.append(writer.n_bytes)
            if k < N:
                left, right = rng.integers(0, 256, (2, *CAMERA.shape), dtype=np.uint8)
                writer.write_pair(left, right, 10.03 + 0.1 * k, 10.04 + 0.1 * k)
    content = (folder / "whole.mcap").read_bytes()
    return SimpleNamespace(
        content=content, ends=ends[1:], observations=list(open_recording(folder / "whole.mcap")), path=folder / "a.mcap"
    )


def read(whole: SimpleNamespace, content: bytes) -> tuple[bool, list[Observation]] | None:
    whole.path.write_bytes(content)
    try:
        recording = open_recording(whole.path)
        return recording.damage is None, list(recording)  # type: ignore[attr-defined]
    except RecordingError as error:
        assert str(whole.path) in str(error) and "\n" not in str(error)
        return None


def same(a: Observation, b: Observation) -> bool:
    images = np.array_equal(a.left, b.left) and np.array_equal(a.right, b.right)
    return images and a.stamp_s == b.stamp_s and np.array_equal(a.T_world_cam, b.T_world_cam)


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_a_file_cut_anywhere_gives_all_that_was_written_before(whole: SimpleNamespace, data: st.DataObject) -> None:
    cut = data.draw(st.integers(0, len(whole.content) - 1))
    outcome = read(whole, whole.content[:cut])
    written = sum(end <= cut for end in whole.ends)
    if outcome is None:
        assert written == 0
        return
    complete, observations = outcome
    # A report counts before its index is there.
    assert not complete and written <= len(observations) <= written + 1
    assert all(same(a, b) for a, b in zip(whole.observations, observations, strict=False))


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_flipped_bytes_give_observations_or_one_error(whole: SimpleNamespace, data: st.DataObject) -> None:
    content = bytearray(whole.content)
    for place in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=4)):
        content[place] ^= data.draw(st.integers(1, 255))
    outcome = read(whole, bytes(content))
    if outcome is not None and outcome[0]:
        assert len(outcome[1]) == N
    if outcome is not None:
        stamps = {each.stamp_s: each for each in whole.observations}
        for each in outcome[1]:
            assert np.array_equal(each.left, stamps[each.stamp_s].left)
            assert np.array_equal(each.right, stamps[each.stamp_s].right)


def test_the_longer_the_file_the_more_is_read(whole: SimpleNamespace) -> None:
    cuts = np.linspace(0, len(whole.content) - 1, 80).astype(int)
    lengths = [len(outcome[1]) if (outcome := read(whole, whole.content[:cut])) else 0 for cut in cuts]
    assert lengths == sorted(lengths) and set(lengths) == set(range(N + 1))


def test_a_file_that_is_no_more_than_begun_says_what_is_missing(tmp_path: Path) -> None:
    with RawWriter(tmp_path / "a.mcap", CAMERA, np.eye(4)) as writer:
        writer.write_report(RawReport(10.0, np.eye(4)))
    with pytest.raises(RecordingError, match=r"a\.mcap: no messages on /left/image_raw/compressed"):
        open_recording(tmp_path / "a.mcap")


@pytest.mark.parametrize("k", range(N))
def test_a_bad_chunk_costs_its_pair_alone(whole: SimpleNamespace, k: int) -> None:
    """The first pair's declares the channels of all."""
    summary = make_reader(io.BytesIO(whole.content)).get_summary()
    assert summary is not None
    topics = {number: channel.topic for number, channel in summary.channels.items()}
    pairs = [
        each
        for each in summary.chunk_indexes
        if "/left/image_raw/compressed" in {topics[number] for number in each.message_index_offsets}
    ]
    content = bytearray(whole.content)
    content[pairs[k].chunk_start_offset + pairs[k].chunk_length - 9] ^= 0x10
    outcome = read(whole, bytes(content))
    assert outcome is not None and not outcome[0]
    expected = [each for number, each in enumerate(whole.observations) if number != k]
    assert all(same(a, b) for a, b in zip(expected, outcome[1], strict=True))
    damage = open_recording(whole.path).damage
    assert damage is not None and f"; 4 of {summary.statistics.message_count} messages are lost" in damage  # type: ignore[union-attr]
