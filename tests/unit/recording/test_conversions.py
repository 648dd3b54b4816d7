"""A converted recording is the recording: the same observations, and all else that its new kind can hold."""

import os
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mcap_ros2.writer
import numpy as np
import pytest
from crooked_rig import crooked_rig, raw_pair
from rosbags.rosbag2 import Reader

from stereogrid.calibration import Mount, StereoCalibration
from stereogrid.cli import app, run
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw, inverse
from stereogrid.observation import Observation
from stereogrid.recording import (
    CONVERSIONS,
    FileRecording,
    Given,
    McapWriter,
    RawMcapRecording,
    RawReport,
    RawWriter,
    Selection,
    convert,
    open_recording,
)
from stereogrid.recording import ros2_messages as ros2
from stereogrid.recording import ros2_raw as raw
from stereogrid.recording.conversions import ORIGIN
from stereogrid.recording.mcap_file import ClippedFile, Records
from stereogrid.recording.ros2_file import METADATA_NAME
from stereogrid.recording.ros2_messages import stamp_to_ns
from stereogrid.recording.ros2_schemas import SCHEMAS

OUT = {"mcap": "a.mcap", "ros2": "bag", "kitti": "sequence"}
MESHES = {"truth_mesh_ply": b"ply\nworld\xff", "mover_meshes_ply": {"walker": b"ply\nwalker", "trolley": b"ply\n"}}


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory, synthetic: SimpleNamespace) -> Path:
    """Six observations with all the truth that there can be."""
    options = {"metadata": {"world": "corridor", "seed": "3"}, **MESHES}
    path: Path = synthetic.write_mcap(
        tmp_path_factory.mktemp("drive") / "drive.mcap", synthetic.observations(6), **options
    )
    return path


@pytest.fixture(scope="module")
def raw_drive(tmp_path_factory: pytest.TempPathFactory, synthetic: SimpleNamespace) -> Path:
    """Twelve reports with all that a robot tells, and as many pairs."""
    path = tmp_path_factory.mktemp("raw") / "raw.mcap"
    rng = np.random.default_rng(8)
    with RawWriter(path, synthetic.camera, synthetic.T_base_cam, metadata={"command": "record"}) as writer:
        for k in range(12):
            told: dict[str, Any] = {"sonar_m": {1: 1.0 + k, 2: 2.0}, "battery_v": 12.0, "values": {"motors": "on"}}
            writer.write_report(RawReport(50 + 0.1 * k, from_yaw(0.01 * k, [0.05 * k, 0, 0]), 0.5, 0.1, **told))
            writer.write_pair(*rng.integers(0, 256, (2, 24, 32), dtype=np.uint8), 50.03 + 0.1 * k, 50.04 + 0.1 * k)
        writer.write_note("ended early", "the battery is flat")
    return path


def check_same(before: FileRecording, after: FileRecording) -> None:
    assert len(before) == len(after) and vars(after.camera) == pytest.approx(vars(before.camera), abs=1e-12)
    for a, b in zip(before, after, strict=True):
        assert stamp_to_ns(a.stamp_s) == stamp_to_ns(b.stamp_s)
        np.testing.assert_array_equal(a.left, b.left)
        np.testing.assert_array_equal(a.right, b.right)
        np.testing.assert_allclose(b.T_world_cam, a.T_world_cam, atol=1e-12)
        np.testing.assert_allclose(b.odometry.T_odom_base, a.odometry.T_odom_base, atol=1e-12)


def check_same_truth(before: FileRecording, after: FileRecording) -> None:
    for a, b in zip(before, after, strict=True):
        assert a.truth is not None and b.truth is not None
        np.testing.assert_allclose(b.truth.T_world_cam, a.truth.T_world_cam, atol=1e-12)
        np.testing.assert_array_equal(b.truth.depth_m, a.truth.depth_m)
        assert list(a.truth.movers) == list(b.truth.movers)
        for name in a.truth.movers:
            np.testing.assert_allclose(b.truth.movers[name], a.truth.movers[name], atol=1e-12)


@pytest.mark.parametrize("kind", ["mcap", "ros2"])
def test_what_a_simulated_drive_knows_is_kept_whole(drive: Path, tmp_path: Path, kind: str) -> None:
    before, after = open_recording(drive), open_recording(convert(open_recording(drive), tmp_path / OUT[kind], kind))
    check_same(before, after)
    check_same_truth(before, after)
    assert after.truth_mesh_ply() == MESHES["truth_mesh_ply"]
    assert {name: after.mover_mesh_ply(name) for name in after.mover_names()} == MESHES["mover_meshes_ply"]
    ticks, expected = after.ticks(), before.ticks()
    assert ticks is not None and expected is not None
    np.testing.assert_array_equal(ticks.stamp_s, expected.stamp_s)
    np.testing.assert_allclose(ticks.T_world_base, expected.T_world_base, atol=1e-12)
    np.testing.assert_array_equal(ticks.wheels_rad, expected.wheels_rad)
    assert after.metadata == {**before.metadata, ORIGIN: "drive.mcap"}


@pytest.mark.parametrize("kind", CONVERSIONS)
@pytest.mark.parametrize("source", ["drive", "raw_drive", "kitti_folder"])
def test_what_was_converted_is_converted_again_to_the_same(
    request: pytest.FixtureRequest, tmp_path: Path, source: str, kind: str
) -> None:
    once = open_recording(convert(open_recording(request.getfixturevalue(source)), tmp_path / OUT[kind], kind))
    (tmp_path / "again").mkdir()
    check_same(once, open_recording(convert(once, tmp_path / "again" / OUT[kind], kind)))


def test_a_kitti_folder_holds_pictures_and_claimed_poses_from_the_first_camera_on(drive: Path, tmp_path: Path) -> None:
    before, after = open_recording(drive), open_recording(convert(open_recording(drive), tmp_path / "a", "kitti"))
    for a, b in zip(before, after, strict=True):
        np.testing.assert_array_equal(a.left, b.left)
        np.testing.assert_array_equal(a.right, b.right)
        assert a.stamp_s == b.stamp_s
    for poses in (before.poses, after.poses):
        assert poses.shape == (6, 4, 4)
    np.testing.assert_allclose(
        inverse(after.poses[0]) @ after.poses, inverse(before.poses[0]) @ before.poses, atol=1e-12
    )
    assert sorted(each.name for each in after.path.iterdir()) == [
        *("calib.txt", "image_0", "image_1", "poses.txt", "times.txt")
    ]


def test_a_bag_is_one_to_whoever_reads_its_metadata(drive: Path, tmp_path: Path) -> None:
    folder = convert(open_recording(drive), tmp_path / "my bag", "ros2")
    assert sorted(each.name for each in folder.iterdir()) == ["metadata.yaml", "my bag_0.mcap"]
    with Reader(folder) as bag, Reader(folder / "my bag_0.mcap") as alone:
        counts = {topic: (info.msgtype, info.msgcount) for topic, info in bag.topics.items()}
        assert counts == {topic: (info.msgtype, info.msgcount) for topic, info in alone.topics.items()}
        assert counts["/left/image_rect/compressed"] == ("sensor_msgs/msg/CompressedImage", 6)
        assert bag.message_count == sum(count for _, count in counts.values()) == len(list(bag.messages()))
        stamps = [stamp for _, stamp, _ in bag.messages()]
        assert (bag.start_time, bag.end_time) == (min(stamps), max(stamps) + 1)
        assert bag.duration == max(stamps) + 1 - min(stamps)
        (qos,) = next(each for each in bag.connections if each.topic == "/tf_static").ext.offered_qos_profiles
        assert qos.durability.name == "TRANSIENT_LOCAL"


def messages(path: Path) -> list[tuple[str, int, bytes]]:
    """Topic, time and content of all messages but frames, in an order of their own."""
    topics: dict[int, str] = {}
    found = []
    with ClippedFile(path) as file:
        for _, records in Records(file, path):
            for record in records:
                if hasattr(record, "topic"):
                    topics[record.id] = record.topic
                elif hasattr(record, "channel_id") and hasattr(record, "data"):
                    found.append((topics[record.channel_id], record.log_time, record.data))
    return sorted(each for each in found if not each[0].startswith("/tf"))


def test_raw_messages_are_kept_to_the_byte_and_rectified_ones_are_none(raw_drive: Path, tmp_path: Path) -> None:
    before = RawMcapRecording(raw_drive)
    after = open_recording(convert(before, tmp_path / "raw.mcap", raw=True))
    assert isinstance(after, RawMcapRecording) and messages(after.path) == messages(raw_drive)
    assert after.metadata == {**before.metadata, ORIGIN: "raw.mcap"}
    check_same(before, after)
    for a, b in zip(before.raw_pairs(), after.raw_pairs(), strict=True):
        np.testing.assert_array_equal(a, b)
    rectified = open_recording(convert(before, tmp_path / "rectified.mcap"))
    assert not isinstance(rectified, RawMcapRecording)
    check_same(before, rectified)


def test_raw_pairs_of_others_are_kept_with_their_calibration_and_odometry(tmp_path: Path) -> None:
    """A bag of another robot, whose lenses bend, with the motion lost after the second pair of eight."""
    T_base_cam = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
    rig = crooked_rig()
    with RawWriter(tmp_path / "a.mcap", rig, T_base_cam) as writer:
        for k in range(9):
            told = RawReport(50 + 0.1 * k, from_yaw(0.01 * k, [0.05 * k, 0, 0]), odometry_lost=int(k > 2))
            writer.write_report(told)
            writer.write_pair(*raw_pair(rig), 50.03 + 0.1 * k, 50.04 + 0.1 * k)
    before = RawMcapRecording(tmp_path / "a.mcap")
    # As whoever reads other bags: it has no messages of ours.
    before.metadata = {}
    after = open_recording(convert(before, tmp_path / "b.mcap", raw=True))
    assert isinstance(after, RawMcapRecording)
    check_same(before, after)
    for a, b in zip(before.raw_pairs(), after.raw_pairs(), strict=True):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(before, after, strict=True):
        assert b.odometry.travelled_m == pytest.approx(a.odometry.travelled_m, abs=1e-9)
    part = Selection(before, 0.15, 0.35)
    check_same(part, open_recording(convert(part, tmp_path / "c.mcap", raw=True)))


def test_a_part_of_a_raw_recording_has_the_pairs_of_that_part_where_they_were(raw_drive: Path, tmp_path: Path) -> None:
    part = open_recording(raw_drive, start_s=0.25, end_s=0.65)
    assert len(part) == 4
    check_same(part, open_recording(convert(part, tmp_path / "part", "ros2", raw=True)))


def test_a_part_of_a_part_is_kept_raw(raw_drive: Path, tmp_path: Path) -> None:
    part = Selection(Selection(open_recording(raw_drive), 0.25), 0.1, 0.4)
    assert len(part) == 4
    check_same(part, open_recording(convert(part, tmp_path / "part.mcap", raw=True)))
    with pytest.raises(InvalidInputError, match="--raw takes no --stride"):
        convert(Selection(Selection(open_recording(raw_drive), stride=2), 0.1), tmp_path / "thin.mcap", raw=True)


def test_a_report_that_is_none_is_copied_as_it_was_told(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    """The rig stood still, so that the odometry does not matter."""
    lost = np.eye(4)
    lost[0, 3] = np.nan
    with RawWriter(tmp_path / "a.mcap", synthetic.camera, synthetic.T_base_cam) as writer:
        writer.write_report(RawReport(50.0, np.eye(4)))
        writer.write_pair(*np.zeros((2, 24, 32), np.uint8), 50.1, 50.1)
        writer.write_report(RawReport(50.2, lost))
    before = open_recording(tmp_path / "a.mcap", given=Given(standing=True))
    copy = convert(before, tmp_path / "b.mcap", raw=True)
    assert messages(copy) == messages(tmp_path / "a.mcap")
    check_same(before, open_recording(copy, given=Given(standing=True)))


@pytest.mark.parametrize("pitch_deg", [0.0, 10.0])
def test_that_a_kitti_folder_of_a_tilted_camera_loses_the_vertical_is_said(
    tmp_path: Path, synthetic: SimpleNamespace, capsys: pytest.CaptureFixture[str], pitch_deg: float
) -> None:
    mount = Mount(0.1, 0.03, 0.4, pitch_deg).T_base_cam
    with McapWriter(tmp_path / "a.mcap", synthetic.camera, mount) as writer:
        for each in synthetic.observations(2):
            T = each.odometry.T_odom_base
            writer.write(Observation(each.stamp_s, each.left, each.right, each.odometry, T @ mount))
    assert run(app, ["convert", str(tmp_path / "a.mcap"), str(tmp_path / "out"), "--to", "kitti"]) == 0
    warned = "out: the first camera is 10.0 degrees off level, and a KITTI folder's world is that camera"
    assert (warned in capsys.readouterr().err) == (pitch_deg > 0)
    assert run(app, ["convert", str(tmp_path / "a.mcap"), str(tmp_path / "b.mcap")]) == 0
    assert "level" not in capsys.readouterr().err


def as_before(path: Path, source: Path) -> Path:
    """A raw recording as it was once: both cameras in the left one's frame, none of the robot or the right one."""
    with path.open("wb") as file, mcap_ros2.writer.Writer(file) as writer:
        writer._writer.add_metadata(METADATA_NAME, {"format_version": "1", raw.KIND: raw.RAW})
        for topic, stamp_ns, data in messages(source):
            message = ros2.decoder(raw.TOPICS[topic])(data)
            if "camera" in message.header.frame_id:
                message.header.frame_id = ros2.CAMERA_FRAME
            if hasattr(message, "format"):
                message.format = "mono8; png compressed"
            schema = writer.register_msgdef(raw.TOPICS[topic], SCHEMAS[raw.TOPICS[topic]])
            writer.write_message(topic, schema, message, stamp_ns, stamp_ns)
        placed = ros2.static_transform_message(0, RawMcapRecording(source).T_base_cam)
        schema = writer.register_msgdef(raw.TOPICS["/tf_static"], SCHEMAS[raw.TOPICS["/tf_static"]])
        writer.write_message("/tf_static", schema, placed, 0, 0)
    return path


def test_raw_recordings_from_before_they_had_all_frames_get_them(raw_drive: Path, tmp_path: Path) -> None:
    old = open_recording(as_before(tmp_path / "old.mcap", raw_drive))
    assert messages(old.path) != messages(raw_drive)
    new = convert(old, tmp_path / "new.mcap", raw=True)
    assert messages(new) == messages(raw_drive)
    with Reader(new) as bag, Reader(raw_drive) as direct:
        assert {topic: info.msgcount for topic, info in bag.topics.items()} == {
            topic: info.msgcount for topic, info in direct.topics.items()
        }


def test_a_calibration_that_was_given_is_in_the_copy(
    tmp_path: Path, raw_drive: Path, synthetic: SimpleNamespace
) -> None:
    rig = StereoCalibration(
        (synthetic.camera.K, synthetic.camera.K), (np.zeros(5),) * 2, from_rotation(np.eye(3), [-0.1, 0, 0]), (32, 24)
    )
    given = RawMcapRecording(raw_drive, rig=rig)
    assert given.camera.baseline_m == pytest.approx(0.1)
    check_same(given, open_recording(convert(given, tmp_path / "a.mcap", raw=True)))


def test_a_part_keeps_what_is_of_its_time(drive: Path, tmp_path: Path) -> None:
    part = open_recording(drive, start_s=0.2, end_s=0.6, stride=2)
    after = open_recording(convert(part, tmp_path / "a.mcap", origin="drive.mcap, from 0.2 s to 0.6 s"))
    check_same(part, after)
    check_same_truth(part, after)
    ticks = after.ticks()
    assert ticks is not None and part.stamps_s[0] >= ticks.stamp_s[0] > part.stamps_s[0] - 0.2
    assert part.stamps_s[-1] <= ticks.stamp_s[-1] < part.stamps_s[-1] + 0.2
    again = open_recording(convert(after, tmp_path / "b.mcap"))
    assert again.metadata[ORIGIN] == "a.mcap; drive.mcap, from 0.2 s to 0.6 s"


def test_a_real_street_goes_to_mcap_and_back(tmp_path: Path) -> None:
    data = os.environ.get("STEREOGRID_DATA")
    if not data:
        pytest.skip("needs the data set sequences/kitti_straight: set STEREOGRID_DATA to shared/data")
    street = open_recording(Path(data) / "sequences" / "kitti_straight", end_s=0.45)
    there = open_recording(convert(street, tmp_path / "a.mcap"))
    back = open_recording(convert(there, tmp_path / "a", "kitti"))
    for a, b, c in zip(street, there, back, strict=True):
        assert np.array_equal(a.left, b.left) and np.array_equal(b.left, c.left)
        # The benchmark's rotations are so to six digits.
        np.testing.assert_allclose(b.T_world_cam, a.T_world_cam, atol=1e-5)
    np.testing.assert_allclose(back.poses, there.poses, atol=1e-12)


WRONG = {
    "no kind": (["out"], "out: what shall it be"),
    "unknown kind": (
        ["out", "--to", "rosbag"],
        "no conversion named 'rosbag'; did you mean 'ros2'? choose from: kitti, mcap, ros2",
    ),
    "existing": (["there.mcap"], "there.mcap: exists already"),
    "no folder": (["nowhere/a.mcap"], "nowhere: no such folder"),
    "suffix": (["a.bag", "--to", "mcap"], "a.bag: an MCAP file's name must end with .mcap"),
    "raw": (["a.mcap", "--raw"], "is of rectified pictures: --raw needs a recording of raw ones"),
    "range": (["a.mcap", "--start", "100"], "no observation from 100"),
    "stride": (["a.mcap", "--stride", "0"], "--stride must be >= 1, not 0"),
    "truth": (["a.mcap", "--poses", "truth"], "a converted recording claims the poses that it claimed"),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_what_cannot_be_is_one_line_and_leaves_nothing(
    drive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there.mcap").write_bytes(b"mine")
    assert run(app, ["convert", str(drive), *arguments]) == 1
    told = capsys.readouterr().err
    assert message in told and told.startswith("error: ") and told.count("\n") == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "there.mcap"] and Path("there.mcap").read_bytes() == b"mine"


def test_raw_messages_go_into_no_kitti_folder_and_are_not_thinned_out(raw_drive: Path, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="a KITTI folder is of rectified pictures"):
        convert(open_recording(raw_drive), tmp_path / "a", "kitti", raw=True)
    with pytest.raises(InvalidInputError, match="takes no --stride"):
        convert(open_recording(raw_drive, stride=2), tmp_path / "a.mcap", raw=True)
    assert not list(tmp_path.iterdir())


def test_a_recording_is_not_written_into_itself(kitti_folder: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"lies in the recording .* itself"):
        convert(open_recording(kitti_folder), kitti_folder / "image_0" / "a.mcap")
    convert(open_recording(kitti_folder), kitti_folder.parent / "kitti.mcap")


@contextmanager
def room_for(n_bytes: int) -> Iterator[None]:
    """In a file, before a write fails as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)


@pytest.mark.parametrize(("kind", "n_bytes"), [("mcap", 9000), ("ros2", 9000), ("kitti", 500)])
def test_a_full_disk_is_one_line_that_names_the_place_and_leaves_nothing(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, n_bytes: int
) -> None:
    out = tmp_path / OUT[kind]
    with room_for(n_bytes):
        assert run(app, ["convert", str(drive), str(out), "--to", kind]) == 1
    told = capsys.readouterr().err
    assert told.startswith(f"error: {out}") and "File too large" in told and told.count("\n") == 1
    assert ".partial" not in told and not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("kind", ["mcap", "ros2"])
def test_an_interrupt_leaves_nothing(
    drive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    kind: str,
    number: signal.Signals,
) -> None:
    """It comes when the third of six observations is written. Programs that are started in the background are told to
    ignore SIGINT, which they then do: here it is as in a terminal."""
    writes, write = [], McapWriter.write

    def counted(self: McapWriter, observation: Observation) -> None:
        writes.append(observation)
        if len(writes) == 3:
            os.kill(os.getpid(), number)
        write(self, observation)

    monkeypatch.setattr(McapWriter, "write", counted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert run(app, ["convert", str(drive), str(tmp_path / OUT[kind]), "--to", kind]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "interrupted; earlier results are as they were\n"
    assert len(writes) == 3 and not list(tmp_path.iterdir())


def test_of_a_damaged_recording_the_rest_is_converted_and_the_loss_is_said(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = drive.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) * 2 // 3])
    assert run(app, ["convert", str(tmp_path / "cut.mcap"), str(tmp_path / "a.mcap")]) == 0
    told = capsys.readouterr()
    assert f"warning: {tmp_path / 'cut.mcap'}: incomplete: damaged or cut off at byte " in told.err
    whole = open_recording(tmp_path / "a.mcap")
    assert whole.damage is None and 0 < len(whole) < 6
    assert f"{tmp_path / 'a.mcap'}: {len(whole)} observations, " in told.out
    assert not [each for each in tmp_path.iterdir() if each.name.startswith(".")]
    assert raw.KIND not in whole.metadata
