"""A killed, cut or corrupted recording gives its readable part or one RecordingError, and never anything else."""

import io
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import mcap_ros2.writer
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Message
from mcap.writer import CompressionType, Writer

from stereogrid.cli import app, run
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.observation import Observation
from stereogrid.recording import ros2_messages as ros2
from stereogrid.recording.mcap import McapRecording
from stereogrid.recording.mcap_file import ClippedFile, Records
from stereogrid.recording.ros2_schemas import SCHEMAS

N = 4


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, synthetic: SimpleNamespace) -> SimpleNamespace:
    folder = tmp_path_factory.mktemp("damage")
    observations = synthetic.observations(N)
    options = {"metadata": {"world": "corridor"}, "truth_mesh_ply": bytes(200)}
    content = synthetic.write_mcap(folder / "whole.mcap", observations, **options).read_bytes()
    return SimpleNamespace(observations=observations, content=content, path=folder / "damaged.mcap")


def read(whole: SimpleNamespace, content: bytes) -> tuple[McapRecording, list[Observation]] | None:
    whole.path.write_bytes(content)
    try:
        recording = McapRecording(whole.path)
        recording.truth_mesh_ply()
        return recording, list(recording)
    except RecordingError as error:
        assert str(whole.path) in str(error) and "\n" not in str(error)
        return None


def same(a: Observation, b: Observation) -> bool:
    return (
        a.stamp_s == b.stamp_s
        and np.array_equal(a.left, b.left)
        and np.array_equal(a.right, b.right)
        and np.allclose(a.T_world_cam, b.T_world_cam)
    )


def same_truth(a: Observation, b: Observation) -> bool:
    assert a.truth is not None and a.truth.depth_m is not None
    return (
        b.truth is not None
        and b.truth.depth_m is not None
        and np.allclose(a.truth.T_world_cam, b.truth.T_world_cam)
        and np.array_equal(a.truth.depth_m, b.truth.depth_m, equal_nan=True)
    )


def check_prefix(whole: SimpleNamespace, n_bytes: int) -> int:
    outcome = read(whole, whole.content[:n_bytes])
    if outcome is None:
        return 0
    recording, observations = outcome
    assert not recording.is_complete and recording.damage is not None
    assert len(recording) == len(observations) <= N
    pairs = list(zip(whole.observations, observations, strict=False))
    assert all(same(a, b) and same_truth(a, b) for a, b in pairs)
    return len(observations)


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_a_file_cut_anywhere_gives_a_prefix(whole: SimpleNamespace, data: st.DataObject) -> None:
    check_prefix(whole, data.draw(st.integers(0, len(whole.content) - 1)))


def test_the_longer_the_file_the_more_is_read(whole: SimpleNamespace) -> None:
    cuts = np.linspace(0, len(whole.content) - 1, 100).astype(int)
    lengths = [check_prefix(whole, int(cut)) for cut in cuts]
    assert lengths == sorted(lengths)
    assert set(lengths) == set(range(N + 1))


@pytest.mark.parametrize("n_lost", [1, 8, 9, 40])
def test_a_cut_in_the_index_loses_no_observation(whole: SimpleNamespace, n_lost: int) -> None:
    assert check_prefix(whole, len(whole.content) - n_lost) == N


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_flipped_bytes_give_observations_or_one_error(whole: SimpleNamespace, data: st.DataObject) -> None:
    content = bytearray(whole.content)
    places = st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=4)
    for place in data.draw(places):
        content[place] ^= data.draw(st.integers(1, 255))
    outcome = read(whole, bytes(content))
    if outcome is not None:
        recording, observations = outcome
        assert len(recording) == len(observations) <= N
        stamps = {each.stamp_s: each for each in whole.observations}
        assert all(same(stamps[each.stamp_s], each) for each in observations)
        if recording.is_complete:
            assert len(observations) == N
            assert all(same_truth(stamps[each.stamp_s], each) for each in observations)


@settings(max_examples=100, deadline=None)
@given(junk=st.binary(max_size=400), with_magic=st.booleans())
def test_junk_is_one_error(whole: SimpleNamespace, junk: bytes, with_magic: bool) -> None:
    assert read(whole, (b"\x89MCAP0\r\n" if with_magic else b"") + junk) is None


def test_a_run_killed_while_it_writes_leaves_its_observations(tmp_path: Path) -> None:
    script = """
import itertools, sys
import numpy as np
from stereogrid.camera import StereoCamera
from stereogrid.observation import Observation, Odometry
from stereogrid.recording.mcap import McapWriter
image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
with McapWriter(sys.argv[1], StereoCamera(100, 80, 60, 0.06, 160, 120), np.eye(4)) as writer:
    for i in itertools.count():
        writer.write(Observation(0.1 * i, image, image, Odometry(np.eye(4)), np.eye(4)))
        print(i, flush=True)
"""
    path = tmp_path / "killed.mcap"
    command = [sys.executable, "-c", script, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        while run.stdout.readline() != "4\n":
            assert run.poll() is None
        os.kill(run.pid, signal.SIGKILL)
        told = [4, *map(int, run.stdout.read().split())][-1]
    recording = McapRecording(path)
    assert not recording.is_complete
    assert len(recording) == len(list(recording)) >= told + 1


def write_messages(path: Path, messages: Iterator[tuple[str, int, Any]]) -> Path:
    with path.open("wb") as file, mcap_ros2.writer.Writer(file) as writer:
        schemas = {name: writer.register_msgdef(name, SCHEMAS[name]) for name in set(ros2.TOPICS.values())}
        for topic, stamp_ns, message in messages:
            writer.write_message(topic, schemas[ros2.TOPICS[topic]], message, stamp_ns)
    return path


def messages(synthetic: SimpleNamespace, **changed: Any) -> Iterator[tuple[str, int, Any]]:
    (observation,) = synthetic.observations(1)
    made = {
        ros2.TF_STATIC: ros2.static_transform_message(5, synthetic.T_base_cam),
        ros2.LEFT_INFO: ros2.camera_info_message(5, synthetic.camera, right=False),
        ros2.RIGHT_INFO: ros2.camera_info_message(5, synthetic.camera, right=True),
        ros2.ODOMETRY: ros2.odometry_message(5, np.eye(4)),
        ros2.LEFT_IMAGE: ros2.image_message(5, observation.left),
        ros2.RIGHT_IMAGE: ros2.image_message(5, observation.right),
        **changed,
    }
    return ((topic, 5, message) for topic, message in made.items() if message is not None)


def odometry_with(**pose: Any) -> dict[str, Any]:
    message = ros2.odometry_message(5, np.eye(4))
    return {**message, "pose": {"pose": {**message["pose"]["pose"], **pose}}}


def picture(encoded: bytes) -> dict[str, Any]:
    return {"header": ros2.header(5, "cam"), "format": "png", "data": encoded}


def png(image: Any) -> bytes:
    encoded: bytes = cv2.imencode(".png", image)[1].tobytes()
    return encoded


HUGE_PNG = b"\x89PNG\r\n\x1a\n\x00\x00\x00\x0dIHDR\x7f\xff\xff\xff\x7f\xff\xff\xff\x08\x00\x00\x00\x00"

WRONG = {
    "nan in a pose": ({ros2.ODOMETRY: odometry_with(position={"x": np.nan, "y": 0, "z": 0})}, r"/odom at .*NaN"),
    "no quaternion": (
        {ros2.ODOMETRY: odometry_with(orientation={"w": 0.0, "x": 0.0, "y": 0.0, "z": 0.0})},
        "/odom at .*no unit quaternion",
    ),
    "no odometry": ({ros2.ODOMETRY: None}, "no messages on /odom"),
    "no camera": ({ros2.LEFT_INFO: None}, "no messages on /left/camera_info"),
    "no transform": ({ros2.TF_STATIC: None}, "no transform base_link -> left_camera_optical"),
    "another stamp": ({ros2.ODOMETRY: ros2.odometry_message(6, np.eye(4))}, "stamps .* never agree"),
    "no png": ({ros2.LEFT_IMAGE: picture(b"GIF89a")}, "/left/.*not a PNG"),
    "half a png": ({ros2.LEFT_IMAGE: picture(png(np.zeros((24, 32), np.uint8))[:40])}, "/left/.*cut short"),
    "another size": (
        {ros2.RIGHT_IMAGE: picture(png(np.zeros((9, 9), np.uint8)))},
        r"/right/.* is \(9, 9\), the recording's camera \(24, 32\)",
    ),
    "a huge image": ({ros2.LEFT_IMAGE: picture(HUGE_PNG)}, r"/left/.* is \(2147483647, 2147483647\)"),
    "16 bits": ({ros2.LEFT_IMAGE: picture(png(np.zeros((24, 32), np.uint16)))}, "/left/.*16-bit, expected 8-bit"),
    "depth in millimetres": (
        {
            ros2.TRUE_POSE: ros2.true_pose_message(5, np.eye(4)),
            ros2.TRUE_DEPTH: {**ros2.depth_message(5, np.ones((24, 32), np.float32)), "encoding": "16UC1"},
        },
        "depth must be 32FC1",
    ),
}


@pytest.mark.parametrize(("changed", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_message_is_named(
    tmp_path: Path, synthetic: SimpleNamespace, changed: dict[str, Any], message: str
) -> None:
    path = write_messages(tmp_path / "wrong.mcap", messages(synthetic, **changed))
    with pytest.raises(RecordingError, match=message) as caught:
        list(McapRecording(path))
    assert str(path) in str(caught.value)


def test_many_messages_in_one_chunk_read_as_well(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    recording = McapRecording(write_messages(tmp_path / "other.mcap", messages(synthetic)))
    (observation,) = recording
    np.testing.assert_array_equal(observation.left, synthetic.observations(1)[0].left)
    assert recording.is_complete and recording.metadata == {}


def test_an_unknown_format_version_is_named(tmp_path: Path, mcap_file: Path) -> None:
    newer = tmp_path / "newer.mcap"
    newer.write_bytes(
        mcap_file.read_bytes().replace(b"format_version\x01\x00\x00\x001", b"format_version\x01\x00\x00\x009")
    )
    with pytest.raises(RecordingError, match="format '9' is not known, only '1'"):
        McapRecording(newer)


def test_a_recording_without_observations_says_so(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    with pytest.raises(RecordingError, match=r"empty\.mcap: no messages on /left/image_rect"):
        McapRecording(synthetic.write_mcap(tmp_path / "empty.mcap", []))


def chunks_of(content: bytes) -> list[tuple[int, int, str]]:
    """Where each chunk begins and ends, and the topic of its message: ours have one each."""
    reader = make_reader(io.BytesIO(content))
    summary = reader.get_summary()
    assert summary is not None
    return [
        (
            each.chunk_start_offset,
            each.chunk_start_offset + each.chunk_length,
            summary.channels[next(iter(each.message_index_offsets))].topic,
        )
        for each in summary.chunk_indexes
    ]


def with_damage(content: bytes, place: int) -> bytes:
    return content[:place] + bytes([content[place] ^ 0x55]) + content[place + 1 :]


@pytest.mark.parametrize("topic", ["/left/image_rect/compressed", "/right/image_rect/compressed", "/odom"])
@pytest.mark.parametrize("k", [0, 1, N - 1])
@pytest.mark.parametrize("where", ["data", "length", "opcode"])
def test_a_bad_chunk_costs_its_own_observation_alone(whole: SimpleNamespace, topic: str, k: int, where: str) -> None:
    """Its checksum wrong, where it ends unknown, or not even known for a chunk; the first one declares its channel."""
    start, end, _ = [each for each in chunks_of(whole.content) if each[2] == topic][k]
    outcome = read(whole, with_damage(whole.content, {"data": end - 5, "length": start + 3, "opcode": start}[where]))
    assert outcome is not None
    recording, observations = outcome
    expected = [each for number, each in enumerate(whole.observations) if number != k]
    assert all(same(a, b) and same_truth(a, b) for a, b in zip(expected, observations, strict=True))
    assert recording.damage is not None
    n_messages = len(chunks_of(whole.content))
    assert f"byte {start}: " in recording.damage and f"; 1 of {n_messages} messages are lost" in recording.damage
    assert recording.left_out == {"moments without both images and odometry": 1}


def test_what_follows_a_hole_in_a_file_without_an_index_is_read_too(whole: SimpleNamespace) -> None:
    chunks = [each for each in chunks_of(whole.content) if each[2] == "/right/image_rect/compressed"]
    # From amid the second observation's image to amid the third's: no record in between is whole.
    hole = slice(chunks[1][0] + 100, chunks[2][0] + 100)
    content = bytearray(whole.content[: chunks[3][1]])
    content[hole] = bytes(len(content[hole]))
    outcome = read(whole, bytes(content))
    assert outcome is not None
    recording, observations = outcome
    assert [each.stamp_s for each in observations] == [whole.observations[k].stamp_s for k in (0, 3)]
    assert recording.damage is not None and "more places" in recording.damage


def test_a_chunk_that_would_unpack_to_terabytes_is_passed_over(whole: SimpleNamespace) -> None:
    (start, _, _), *_ = [each for each in chunks_of(whole.content) if each[2] == "/truth/depth"]
    name_at = start + 9 + 8 + 8 + 8 + 4 + 4
    assert whole.content[name_at : name_at + 4] == b"zstd"
    frame = bytes([0x28, 0xB5, 0x2F, 0xFD, 0xE0]) + (2**45).to_bytes(8, "little")
    place = name_at + 4 + 8
    outcome = read(whole, whole.content[:place] + frame + whole.content[place + len(frame) :])
    assert outcome is not None and len(outcome[1]) == N
    assert outcome[0].damage is not None and "a chunk claims to unpack to 35184372088832 bytes" in outcome[0].damage
    assert outcome[1][0].truth is not None and outcome[1][0].truth.depth_m is None


def test_a_chunk_of_lz4_unpacks_to_no_more_than_it_claims(tmp_path: Path) -> None:
    path, sent = tmp_path / "a.mcap", bytes(2**22)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start()
        channel = writer.register_channel("/zeros", "raw", writer.register_schema("zeros", "raw", b""))
        writer.add_message(channel, 0, sent, 0)
        writer.finish()
    content = path.read_bytes()
    start = next(offset for offset, found in records_of(path) if any(isinstance(each, Message) for each in found))
    assert content[start] == 6 and len(content) < 2**15
    with ClippedFile(path) as opened:
        (message,) = (each for each in opened.records_at(start) if isinstance(each, Message))
        assert message.data == sent
    size_at = start + 9 + 8 + 8
    path.write_bytes(content[:size_at] + (1000).to_bytes(8, "little") + content[size_at + 8 :])
    with ClippedFile(path) as opened, pytest.raises(InvalidInputError, match="a chunk unpacks to more than 1000 bytes"):
        opened.records_at(start)


def records_of(path: Path) -> list[tuple[int, list[Any]]]:
    with ClippedFile(path) as file:
        return list(Records(file, path))


def test_a_file_damaged_everywhere_is_given_up(whole: SimpleNamespace) -> None:
    """A hostile one could otherwise keep a reader busy for ever."""
    record = bytes([0x06]) + (3).to_bytes(8, "little") + b"abc"
    path = whole.path
    path.write_bytes(whole.content[:8] + record * 100_000)
    with pytest.raises(RecordingError, match="not an MCAP file"):
        McapRecording(path)


def test_stamps_that_go_back_are_sorted_and_repeats_are_counted(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    """As of a clock that was set, or of a bag that was played into another."""

    def of(each: Observation) -> Iterator[tuple[str, int, Any]]:
        stamp_ns = ros2.stamp_to_ns(each.stamp_s)
        yield ros2.TF_STATIC, stamp_ns, ros2.static_transform_message(stamp_ns, synthetic.T_base_cam)
        for topic, right in ((ros2.LEFT_INFO, False), (ros2.RIGHT_INFO, True)):
            yield topic, stamp_ns, ros2.camera_info_message(stamp_ns, synthetic.camera, right=right)
        yield ros2.ODOMETRY, stamp_ns, ros2.odometry_message(stamp_ns, each.odometry.T_odom_base)
        yield ros2.LEFT_IMAGE, stamp_ns, ros2.image_message(stamp_ns, each.left)
        yield ros2.RIGHT_IMAGE, stamp_ns, ros2.image_message(stamp_ns, each.right)

    written = synthetic.observations(4)
    order = [2, 0, 3, 1, 2]
    path = write_messages(tmp_path / "a.mcap", (each for k in order for each in of(written[k])))
    recording = McapRecording(path)
    assert all(same(a, b) for a, b in zip(written, recording, strict=True))
    assert recording.left_out == {"images and odometry with the stamp of an earlier one": 3}
    assert run(app, ["info", str(path)]) == 0
