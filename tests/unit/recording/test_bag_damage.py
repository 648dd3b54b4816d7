"""Bags that are wrong: what is readable is read and the rest counted, or one line says what is wrong."""

import sqlite3
from pathlib import Path
from typing import Any

import drawn_bags as drawn
import numpy as np
import pytest
import zstandard
from drawn_bags import Sent, write_bag1, write_bag2
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode

from stereogrid.cli import app, run
from stereogrid.errors import RecordingError
from stereogrid.recording import MissingTopicsError, bag, bag_bounds, open_recording
from stereogrid.recording import ros2_messages as ros2
from stereogrid.recording.bag_bounds import unpack_file, unpack_message

LEFT, RIGHT = "/stereo/left/image_rect", "/stereo/right/image_rect"


def changed(sent: list[Sent], topic: str, number: int, change: Any) -> list[Sent]:
    """With the number-th message of a topic as `change` makes it; None: without it."""
    of_topic = [each for each in sent if each.topic == topic]
    made = change(of_topic[number])
    return [made if each is of_topic[number] else each for each in sent if made or each is not of_topic[number]]


def test_a_bag_without_pictures_lists_what_it_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_bag2(tmp_path / "a", [each for each in drawn.drive() if each.topic not in (LEFT, RIGHT)])
    with pytest.raises(
        MissingTopicsError, match=r"a: no topics are pictures .*--left-topic and --right-topic"
    ) as error:
        open_recording(path)
    assert error.value.topics["/odom"] == ("nav_msgs/msg/Odometry", 7)
    assert "\n" not in str(error.value) and "/whirl (odd_msgs/msg/Whirl, 1)" in str(error.value)
    assert run(app, ["info", str(path)]) == 1
    said = capsys.readouterr()
    assert "/whirl: odd_msgs/msg/Whirl, 1 messages\n" in said.out and said.err.startswith("error: ")
    assert said.err.count("\n") == 1 and (said.out + said.err).count("odd_msgs") == 1


def test_a_bag_of_nothing_says_so(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="its topics: none at all"):
        open_recording(write_bag1(tmp_path / "a.bag", []))


def test_pictures_without_a_partner_are_counted_and_skipped(tmp_path: Path) -> None:
    sent = changed(drawn.drive(), RIGHT, 2, lambda _: None)
    recording = open_recording(write_bag1(tmp_path / "a.bag", sent))
    assert len(recording) == 5 and recording.left_out == {"pictures without one of the other camera": 1}


def test_stamps_that_go_back_are_sorted_and_repeats_counted(tmp_path: Path) -> None:
    """As of a bag that was recorded in disorder: message 4 arrives before message 2."""
    sent = drawn.drive()
    sent = changed(sent, LEFT, 4, lambda each: each._replace(log_ns=each.log_ns - 250_000_000))
    sent += [each for each in sent if each.topic == RIGHT][:2]
    recording = open_recording(write_bag2(tmp_path / "a", sent))
    assert (np.diff(recording.stamps_s) > 0).all() and len(recording) == 6
    assert recording.left_out == {"pictures with the stamp of an earlier one": 2}
    assert [each.left[0, 0] for each in recording] == list(range(6))


def test_messages_of_one_moment_of_recording_are_told_apart(tmp_path: Path) -> None:
    log_ns = ros2.stamp_to_ns(drawn.T0_S + 5)
    sent = [each._replace(log_ns=log_ns) if each.topic in (LEFT, RIGHT) else each for each in drawn.drive()]
    for path in (write_bag1(tmp_path / "a.bag", sent), write_bag2(tmp_path / "b", sent)):
        assert [each.right[0, 0] for each in open_recording(path)] == list(range(6))


def test_of_drivers_that_set_no_stamp_the_times_of_recording_are_used_and_it_is_said(tmp_path: Path) -> None:
    sent = []
    for each in drawn.drive():
        if each.topic in (LEFT, RIGHT):
            each.message["header"] = ros2.header(0, drawn.LENS)
        sent.append(each)
    recording = open_recording(write_bag1(tmp_path / "a.bag", sent))
    assert recording.unstamped == (LEFT, RIGHT)  # type: ignore[attr-defined]
    assert recording.stamps_s == pytest.approx(drawn.T0_S + 0.1 * np.arange(6) + 0.052, abs=1e-6)
    assert any(f"all of {LEFT} has one header stamp" in note for note in recording.notes())


def broken(each: Sent, name: str, value: float) -> Sent:
    position = each.message["pose"]["pose"][name]
    position.update(dict.fromkeys(position, value))
    return each


@pytest.mark.parametrize(("name", "value"), [("position", np.nan), ("orientation", 0.0)])
def test_poses_that_are_none_are_counted_and_left_out(tmp_path: Path, name: str, value: float) -> None:
    sent = changed(drawn.drive(), "/odom", 3, lambda each: broken(each, name, value))
    recording = open_recording(write_bag2(tmp_path / "a", sent))
    assert len(recording) == 6 and np.isfinite(recording.poses).all()
    assert recording.left_out == {"reports of the odometry that are NaN or no rotation": 1}
    for each in sent:
        if each.topic == "/odom":
            broken(each, name, value)
    with pytest.raises(RecordingError, match=r"b: /odom at 1700000000\.0+ s (contains NaN|has no unit quaternion)"):
        open_recording(write_bag2(tmp_path / "b", sent))


def test_transforms_that_are_none_are_counted(tmp_path: Path) -> None:
    T = np.eye(4)
    T[0, 3] = np.nan
    wrong = Sent("/tf", "tf2_msgs/msg/TFMessage", drawn.transform(5, "base_link", "arm", T), 5)
    recording = open_recording(write_bag2(tmp_path / "a", [*drawn.drive(), wrong]))
    assert recording.left_out == {"transforms that are NaN or no rotation": 1}


def test_a_message_that_cannot_be_decoded_is_counted_and_ends_nothing(tmp_path: Path) -> None:
    sent = changed(drawn.drive(), "/odom", 2, lambda each: each._replace(raw=b"\x00\x01\x00\x00abc"))
    for path in (write_bag1(tmp_path / "a.bag", sent), write_bag2(tmp_path / "b", sent)):
        recording = open_recording(path)
        assert len(recording) == 6 and recording.left_out == {"messages that cannot be decoded": 1}


def test_a_first_picture_that_is_broken_does_not_hide_the_others(tmp_path: Path) -> None:
    """The frame that the pictures name stands in its header."""
    sent = changed(drawn.drive(), LEFT, 0, lambda each: each._replace(raw=drawn.cdr(each)[:60]))
    recording = open_recording(write_bag2(tmp_path / "a", sent))
    assert len(recording) == 6 and recording.left_out == {}
    assert [each.left[0, 0] for each in recording.read(range(1, 6))] == [1, 2, 3, 4, 5]
    with pytest.raises(RecordingError, match=r"a: the observation at 1700000000\.03\d* s: cannot be decoded"):
        next(iter(recording))


def test_what_is_wrong_with_a_bag_names_it_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one that is written over while it is opened."""
    path = write_bag1(tmp_path / "a.bag", drawn.drive())
    find = bag.find_topics

    def changing(*of: Any, **more: Any) -> Any:
        path.write_bytes(b"hello")
        return find(*of, **more)

    monkeypatch.setattr(bag, "find_topics", changing)
    with pytest.raises(RecordingError, match="cannot be read") as caught:
        open_recording(path)
    assert str(caught.value).count(str(path)) == 1


def test_a_turn_of_rectified_pictures_that_is_none_is_refused(tmp_path: Path) -> None:
    for n, wrong in enumerate((3.0 * np.eye(3), np.diag([1.0, 1, -1]), np.full((3, 3), np.nan))):
        sent = drawn.drive()
        for each in sent:
            if each.kind == "sensor_msgs/msg/CameraInfo":
                each.message["r"] = wrong.ravel().tolist()
        with pytest.raises(RecordingError, match=r"\d: R of the left CameraInfo (is no rotation|must be a finite)"):
            open_recording(write_bag2(tmp_path / str(n), sent))


def test_a_bag_of_ros_1_that_was_cut_off_tells_how_to_mend_it(tmp_path: Path) -> None:
    path = write_bag1(tmp_path / "a.bag", drawn.drive())
    whole = path.read_bytes()
    for share in (0.3, 0.9, 0.999):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(RecordingError, match=r"a\.bag: cannot be read \(.*`rosbag reindex a\.bag`"):
            open_recording(path)
    with Writer1(tmp_path / "b.bag.active") as writer:
        # As its recorder leaves it that is killed: the header still says that there is no index.
        assert writer.bio is not None
        writer.bio.flush()
        begun = (tmp_path / "b.bag.active").read_bytes()
    (tmp_path / "b.bag.active").write_bytes(begun + whole[len(begun) :])
    with pytest.raises(RecordingError, match=r"Bag is not indexed.*rosbag reindex"):
        open_recording(tmp_path / "b.bag.active")


def test_of_a_damaged_bag_of_ros_1_all_before_the_damage_is_used(tmp_path: Path) -> None:
    path = write_bag1(tmp_path / "a.bag", drawn.drive(30), Writer1.CompressionFormat.BZ2)
    content = path.read_bytes()
    at = content.index(b"BZh", len(content) * 2 // 3)
    path.write_bytes(content[: at + 8] + b"\xff" * 40 + content[at + 48 :])
    recording = open_recording(path)
    assert 10 < len(recording) < 30 and "a.bag is damaged or cut off: " in (recording.damage or "")
    assert [each.left[0, 0] for each in recording] == list(range(len(recording)))


def test_of_a_damaged_database_all_before_the_damage_is_used_or_one_line_says_why_not(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "a", drawn.drive(60))
    path = folder / "a.db3"
    content = path.read_bytes()
    for share in (0.01, 0.5, 0.9):
        path.write_bytes(content[: int(share * len(content))])
        try:
            recording = open_recording(folder)
        except RecordingError as error:
            assert str(error).count("\n") == 0
        else:
            assert recording.damage is not None and len(list(recording)) < 60
    path.write_bytes(b"hello")
    with pytest.raises(RecordingError, match=r"a\.db3: cannot be read: "):
        open_recording(folder)
    sqlite3.connect(tmp_path / "empty.db3").execute("CREATE TABLE messages(id)")
    with pytest.raises(RecordingError, match=r"empty\.db3: cannot be read: .*missing tables"):
        open_recording(tmp_path / "empty.db3")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rosbag2_bagfile_information: [", r"metadata\.yaml: no YAML of plain values"),
        ("rosbag2_bagfile_information: &a {a: &b {c: 1}, d: {<<: *b}}", r"metadata\.yaml: has aliases"),
        ("rosbag2_bagfile_information: " + 40 * "[", r"metadata\.yaml: is nested deeper"),
        (
            f"rosbag2_bagfile_information: {{relative_file_paths: [{5000 * 'x'}.db3]}}",
            r"none of its files is here: x{80}$",
        ),
        ('rosbag2_bagfile_information: {relative_file_paths: ["a\\0b"]}', r"none of its files is here: "),
        ("rosbag2_bagfile_information: 3", r"metadata\.yaml: cannot be read"),
        ("rosbag2_bagfile_information: {}", "says nothing of the bag's files"),
        ("rosbag2_bagfile_information: {relative_file_paths: 3}", "says nothing of the bag's files"),
        ("rosbag2_bagfile_information: {relative_file_paths: []}", "none of its files is here: it names none"),
        ("rosbag2_bagfile_information: {relative_file_paths: [../../x.db3]}", r"none of its files is here: x\.db3"),
        (
            "rosbag2_bagfile_information: {relative_file_paths: [x], compression_mode: FILE, compression_format: z}",
            "compressed by 'z'; only zstd is known",
        ),
    ],
)
def test_metadata_that_make_no_sense_are_named(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "x.db3").write_bytes(b"outside")
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    (folder / "metadata.yaml").write_text(text)
    with pytest.raises(RecordingError, match=message):
        open_recording(folder)


@pytest.mark.parametrize("compression", [Writer1.CompressionFormat.BZ2, Writer1.CompressionFormat.LZ4])
def test_chunks_that_unpack_to_more_than_a_chunk_may_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: Any
) -> None:
    path = write_bag1(tmp_path / "a.bag", drawn.drive(), compression, chunk_bytes=2**20)
    assert len(open_recording(path)) == 6
    monkeypatch.setattr(bag_bounds, "MAX_CHUNK_BYTES", 2000)
    with pytest.raises(RecordingError, match=r"its topics: .*a chunk unpacks to more than 2000 bytes"):
        open_recording(path)


def test_messages_and_files_that_unpack_to_too_much_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bomb = zstandard.ZstdCompressor().compress(bytes(2**26))
    assert len(bomb) < 2**13
    packed = tmp_path / "a.db3.zstd"
    packed.write_bytes(bomb)
    with pytest.raises(RecordingError, match=r"a\.db3\.zstd: unpacks to more than"):
        unpack_file(packed, tmp_path / "a.db3")
    packed.write_bytes(b"hello")
    with pytest.raises(RecordingError, match=r"a\.db3\.zstd: cannot be unpacked"):
        unpack_file(packed, tmp_path / "a.db3")
    monkeypatch.setattr(bag_bounds, "MAX_CHUNK_BYTES", 2**20)
    with pytest.raises(ValueError, match="a message unpacks to more than 1048576 bytes"):
        unpack_message(bomb)
    sent = drawn.drive()
    path = write_bag2(tmp_path / "a", sent, compression=CompressionMode.MESSAGE)
    monkeypatch.setattr(bag_bounds, "MAX_CHUNK_BYTES", 600)
    with pytest.raises(MissingTopicsError, match="no topics are pictures"):
        open_recording(path)


def test_pictures_larger_than_any_cameras_are_refused_before_they_are_rectified(tmp_path: Path) -> None:
    topics = ("/cam0/image_raw", "/cam1/image_raw")
    infos = drawn.infos(("/cam0/camera_info", "/cam1/camera_info"))
    for each in infos:
        each.message.update(width=2**31, height=2**31)
    path = write_bag2(tmp_path / "a", [*drawn.fixed_frames(), *infos, *drawn.pictures(2, topics), *drawn.odometry(3)])
    with pytest.raises(RecordingError, match=r"a: pictures of 2147483648 x 2147483648 px; 1 to 8192 px a side"):
        open_recording(path)


def test_an_uncalibrated_camera_and_a_calibration_of_one_side_are_named(tmp_path: Path) -> None:
    sent = drawn.drive()
    for each in sent:
        if each.kind == "sensor_msgs/msg/CameraInfo":
            each.message.update(k=[0.0] * 9, p=[0.0] * 12)
    with pytest.raises(RecordingError, match=r"a: .*(calibration|focal|P)"):
        open_recording(write_bag2(tmp_path / "a", sent))
    sent = [each for each in drawn.drive() if each.topic != "/stereo/right/camera_info"]
    with pytest.raises(RecordingError, match="b: no messages on /stereo/right/camera_info"):
        open_recording(write_bag2(tmp_path / "b", sent))


def test_what_no_one_can_follow_is_told_with_the_frames_that_are_known(tmp_path: Path) -> None:
    sent = [each for each in drawn.drive() if each.topic not in ("/odom", "/tf_static")]
    for k in range(5):
        T = drawn.pose_at(drawn.T0_S + k)
        sent.append(Sent("/tf", "tf2_msgs/msg/TFMessage", drawn.transform(k, "odom", "chassis", T), k))
    with pytest.raises(RecordingError, match=r"camera's frame 'left_optical_frame'; they know chassis, odom"):
        open_recording(write_bag2(tmp_path / "a", sent))
