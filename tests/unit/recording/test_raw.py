"""What cameras and robot sent is read back rectified, and each pair where the odometry puts it."""

import errno
from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import mcap_ros2.writer
import numpy as np
import pytest
from crooked_rig import DISPARITY_PX, crooked_rig, ideal_pair, raw_pair
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from stereogrid.camera import StereoCamera
from stereogrid.cli import app, run
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.recording import Given, PairingLimits, RawMcapRecording, RawReport, RawTopics, RawWriter, open_recording
from stereogrid.recording import ros2_messages as ros2
from stereogrid.recording import ros2_raw as raw
from stereogrid.recording.ros2_file import Ros2File
from stereogrid.recording.ros2_images import read_image
from stereogrid.recording.ros2_schemas import SCHEMAS

RIG = crooked_rig()
T_BASE_CAM = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
T0 = 1_700_000_000.0
BOTH = raw_pair(RIG)


def report(k: int, **others: Any) -> RawReport:
    """Half a metre a second and a tenth of a radian a second, ten reports a second."""
    return RawReport(T0 + 0.1 * k, from_yaw(0.01 * k, [0.05 * k, 0, 0]), 0.5, 0.1, **others)


def write(path: Path, n: int = 10, *, first: int = 0, rig: Any = RIG, T_base_cam: Any = T_BASE_CAM) -> Path:
    """n pairs, one in the midst of two reports each."""
    with RawWriter(path, rig, T_base_cam, metadata={"command": "test"}) as writer:
        for k in range(n):
            if k >= first:
                writer.write_report(report(k, battery_v=12.5, sonar_m={2: 1.5, 3: 5.0}, values={"motors": "on"}))
            writer.write_pair(*BOTH, T0 + 0.1 * k + 0.048, T0 + 0.1 * k + 0.052)
        writer.write_report(report(n))
    return path


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("raw") / "drive.mcap")


def test_where_all_pairs_are_smeared_that_is_what_is_said(tmp_path: Path) -> None:
    """Ten radians a second, four milliseconds apart; of the second drive the odometry ends before the others."""
    for name, n_reports, message in (
        ("a", 10, r"a\.mcap: all are pairs taken too far apart for how fast .* by /odom, .* more than 1 px between"),
        ("b", 3, r"b\.mcap: /odom tells of no moment .*; left out before: 2 pairs taken too far apart for how fast"),
    ):
        with RawWriter(tmp_path / f"{name}.mcap", RIG, T_BASE_CAM) as writer:
            for k in range(n_reports):
                writer.write_report(RawReport(T0 + 0.1 * k, from_yaw(1.0 * k)))
            for k in range(n_reports - 1):
                writer.write_pair(*BOTH, T0 + 0.1 * k + 0.048, T0 + 0.1 * k + 0.052)
            if name == "b":
                writer.write_pair(*BOTH, T0 + 9, T0 + 9)
        with pytest.raises(RecordingError, match=message):
            open_recording(tmp_path / f"{name}.mcap")


def test_what_a_bent_and_crooked_rig_sees_comes_back_as_ideal_cameras_see_it(drive: Path) -> None:
    recording = open_recording(drive)
    assert isinstance(recording, RawMcapRecording)
    assert recording.camera == RIG.rectification().camera
    first = next(iter(recording))
    for raw_picture, seen, ideal in zip(BOTH, (first.left, first.right), ideal_pair(), strict=True):
        # Between pixels of a wave of 25 px a straight line is off by half a grey value, and each picture is rounded.
        assert np.abs(seen - ideal).max() < 3.5 and np.abs(seen - ideal).mean() < 0.5
        assert np.abs(raw_picture - ideal).mean() > 15
    disparity = cv2.StereoSGBM.create(0, 16, 9).compute(first.left, first.right)[20:-20, 30:-20] / 16
    assert np.abs(disparity[disparity > 0] - DISPARITY_PX).mean() < 0.1


def test_the_raw_pictures_are_kept_as_they_were(drive: Path) -> None:
    for pair in RawMcapRecording(drive).raw_pairs():
        for picture, taken in zip(pair, BOTH, strict=True):
            np.testing.assert_array_equal(picture, taken)


def test_a_pair_is_where_the_odometry_was_at_the_middle_of_its_two_moments(drive: Path) -> None:
    recording = RawMcapRecording(drive)
    assert len(recording) == 10 and recording.left_out == {} and recording.is_complete
    np.testing.assert_allclose(recording.skew_s, 0.004, atol=1e-6)
    for k, each in enumerate(recording):
        assert each.stamp_s == pytest.approx(T0 + 0.1 * k + 0.05, abs=1e-6)
        expected = from_yaw(0.01 * (k + 0.5), [0.05 * (k + 0.5), 0, 0])
        np.testing.assert_allclose(each.odometry.T_odom_base, expected, atol=1e-6)
        assert each.odometry.travelled_m == pytest.approx(0.05 * (k + 0.5), abs=1e-6)
        assert each.odometry.turned_rad == pytest.approx(0.01 * (k + 0.5), abs=1e-6)
        np.testing.assert_allclose(each.T_world_cam, expected @ T_BASE_CAM, atol=1e-6)


def test_pairs_where_the_odometry_does_not_reach_are_left_out_and_counted(tmp_path: Path) -> None:
    recording = RawMcapRecording(write(tmp_path / "a.mcap", first=3))
    assert len(recording) == 7 == len(list(recording))
    assert recording.left_out == {"pairs where the odometry does not reach": 3}


def test_pairs_whose_pictures_turning_has_moved_apart_are_left_out_and_counted(tmp_path: Path) -> None:
    """A radian a second, from the fifth report on: 5 ms are .9 px, 10 ms 1.9 px."""
    with RawWriter(tmp_path / "a.mcap", RIG, T_BASE_CAM) as writer:
        for k in range(10):
            writer.write_report(RawReport(T0 + 0.1 * k, from_yaw(0.1 * max(k - 4, 0))))
            skew_s = 0.010 if k % 2 else 0.005
            writer.write_pair(*BOTH, T0 + 0.1 * k + 0.05, T0 + 0.1 * k + 0.05 + skew_s)
        writer.write_report(RawReport(T0 + 1.0, from_yaw(0.6)))
    recording = RawMcapRecording(tmp_path / "a.mcap")
    kept = [0, 1, 2, 3, 4, 6, 8]
    assert recording.stamps_s == pytest.approx(T0 + 0.055 + 0.1 * np.array(kept), abs=0.003)
    assert recording.left_out == {"pairs taken too far apart for how fast the robot turned": 3}
    assert len(RawMcapRecording(tmp_path / "a.mcap", limits=PairingLimits(max_smear_px=3.0))) == 10


def test_of_a_drive_whose_odometry_was_lost_the_piece_with_the_most_pairs_counts(tmp_path: Path) -> None:
    with RawWriter(tmp_path / "a.mcap", RIG, T_BASE_CAM) as writer:
        for k in range(10):
            writer.write_report(report(k, odometry_lost=0 if k < 3 else 1))
            writer.write_pair(*BOTH, T0 + 0.1 * k + 0.05, T0 + 0.1 * k + 0.05)
    recording = RawMcapRecording(tmp_path / "a.mcap")
    assert recording.stamps_s == pytest.approx(T0 + 0.05 + 0.1 * np.arange(3, 9), abs=1e-6)
    assert recording.left_out == {
        "pairs where the odometry does not reach": 2,
        "pairs of other pieces of the drive: the odometry was lost": 2,
    }
    assert next(iter(recording)).odometry.travelled_m == pytest.approx(0.025, abs=1e-6)


def test_without_a_robot_it_is_a_recording_only_where_the_rig_is_said_to_stand(tmp_path: Path) -> None:
    with RawWriter(tmp_path / "a.mcap", RIG, T_BASE_CAM) as writer:
        writer.write_pair(*BOTH, T0, T0)
    with pytest.raises(RecordingError, match=r"a\.mcap: no messages on /odom: .* without a robot.*--poses standing"):
        open_recording(tmp_path / "a.mcap")
    (only,) = RawMcapRecording(tmp_path / "a.mcap", standing=True)
    np.testing.assert_allclose(only.T_world_cam, T_BASE_CAM)


def test_a_calibration_can_be_given_in_place_of_the_files(tmp_path: Path, drive: Path) -> None:
    bare = write(tmp_path / "bare.mcap", 2, rig=None, T_base_cam=None)
    with pytest.raises(RecordingError, match="recorded without a calibration"):
        open_recording(bare)
    with pytest.raises(RecordingError, match="no transform base_link -> left_camera_optical"):
        RawMcapRecording(bare, rig=RIG)
    given, own = RawMcapRecording(bare, rig=RIG, T_base_cam=T_BASE_CAM), RawMcapRecording(drive)
    assert given.camera == own.camera
    np.testing.assert_array_equal(next(iter(given)).right, next(iter(own)).right)


def test_pictures_that_are_rectified_already_pass_untouched(tmp_path: Path) -> None:
    camera = StereoCamera(170.5, 79.3, 60.1, 0.06, 160, 120)
    recording = RawMcapRecording(write(tmp_path / "a.mcap", 1, rig=camera))
    assert vars(recording.camera) == pytest.approx(vars(camera))
    (only,) = recording
    np.testing.assert_array_equal(only.left, BOTH[0])
    np.testing.assert_array_equal(only.right, BOTH[1])


def test_rosbags_reads_every_message_and_the_calibration_whole(drive: Path) -> None:
    with AnyReader([drive]) as bag:
        messages = [(c.topic, bag.deserialize(data, c.msgtype), stamp) for c, stamp, data in bag.messages()]
        assert {c.topic: c.msgtype for c in bag.connections} == raw.TOPICS
    counts = Counter(topic for topic, *_ in messages)
    assert counts == dict.fromkeys(raw.TOPICS, 10) | {"/tf_static": 1, "/odom": 11, "/tf": 11, "/sonar": 20}
    first = {topic: message for topic, message, _ in reversed(messages)}
    for side, topic in enumerate(("/left/camera_info", "/right/camera_info")):
        info = first[topic]
        np.testing.assert_array_equal(info.k.reshape(3, 3), RIG.K[side])
        np.testing.assert_array_equal(info.d[: RIG.distortion[side].size], RIG.distortion[side])
        assert info.distortion_model == "plumb_bob" and (info.width, info.height) == (160, 120)
    assert first["/odom"].twist.twist.linear.x == 0.5 and first["/odom"].twist.twist.angular.z == 0.1
    sonars = [m for topic, m, _ in messages if topic == "/sonar"][:2]
    assert [(s.header.frame_id, s.range) for s in sonars] == [("sonar_2", 1.5), ("sonar_3", 5.0)]
    assert first["/battery"].voltage == 12.5
    assert [(v.key, v.value) for v in first["/diagnostics"].status[0].values] == [("motors", "on")]
    pictures = [np.frombuffer(first[topic].data, np.uint8) for topic in (raw.LEFT_IMAGE, raw.RIGHT_IMAGE)]
    for picture, taken in zip(pictures, BOTH, strict=True):
        np.testing.assert_array_equal(cv2.imdecode(picture, cv2.IMREAD_UNCHANGED), taken)
    for topic, message, stamp_ns in messages:
        if topic not in ("/tf", "/tf_static"):
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp_ns


def test_a_finished_file_has_an_index_by_which_others_seek(drive: Path) -> None:
    with drive.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None and summary.statistics is not None
        # One chunk a pair and one a report, not one a message.
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count == 21
        late = list(make_reader(file).iter_messages(starting_at=int((T0 + 0.95) * 1e9)))
    assert {channel.topic for _, channel, _ in late} == {"/odom", "/tf", raw.RIGHT_IMAGE, ros2.RIGHT_INFO}


def foreign(path: Path, topics: RawTopics, image: Any, **changed: Any) -> Path:
    """A bag of another robot: its own topics, uncompressed pictures."""
    left, right = raw_matrices()
    messages = [
        (ros2.TF_STATIC, "tf2_msgs/msg/TFMessage", ros2.static_transform_message(5, T_BASE_CAM)),
        (topics.left_info, "sensor_msgs/msg/CameraInfo", {**raw.camera_info_message(5, left), **changed}),
        (topics.right_info, "sensor_msgs/msg/CameraInfo", raw.camera_info_message(5, right)),
        (topics.odometry, "nav_msgs/msg/Odometry", ros2.odometry_message(5, np.eye(4))),
        (topics.left_image, "sensor_msgs/msg/Image", image(BOTH[0])),
        (topics.right_image, "sensor_msgs/msg/Image", image(BOTH[1])),
    ]
    with path.open("wb") as file, mcap_ros2.writer.Writer(file) as writer:
        for topic, kind, message in messages:
            writer.write_message(topic, writer.register_msgdef(kind, SCHEMAS[kind]), message, 5)
    return path


def raw_matrices() -> tuple[raw.CameraMatrices, raw.CameraMatrices]:
    from stereogrid.recording.raw_writer import camera_matrices

    return camera_matrices(RIG)


def uncompressed(encoding: str, channels: int, pad: int = 0) -> Any:
    def message(picture: np.ndarray) -> dict[str, Any]:
        height, width = picture.shape
        pixels = np.repeat(picture[:, :, None], channels, axis=2).reshape(height, -1)
        rows = np.hstack([pixels, np.full((height, pad), 77, np.uint8)])
        size = {"height": height, "width": width, "encoding": encoding, "step": rows.shape[1]}
        return {"header": ros2.header(5, "cam"), "is_bigendian": 0, **size, "data": rows.tobytes()}

    return message


def logged(path: Path, header_s: Any, n: int = 6, *, all_alike: bool = False) -> Path:
    """n pairs and reports, written ten a second; header_s(k): the header stamp of the k-th picture.

    all_alike: the reports have that stamp too.
    """
    with path.open("wb") as file, mcap_ros2.writer.Writer(file) as writer:
        for k in range(n):
            when_ns, stamp_ns = (ros2.stamp_to_ns(stamp_s) for stamp_s in (T0 + 0.1 * k, header_s(k)))
            messages = {
                ros2.TF_STATIC: ros2.static_transform_message(5, T_BASE_CAM),
                ros2.ODOMETRY: ros2.odometry_message(
                    stamp_ns if all_alike else when_ns, from_yaw(0.0, [0.1 * k, 0, 0])
                ),
            }
            for side, picture in zip(raw_matrices(), BOTH, strict=True):
                name = ("left", "right")[picture is BOTH[1]]
                messages[f"/{name}/camera_info"] = raw.camera_info_message(5, side)
                marked = picture.copy()
                marked[0, 0] = k
                messages[f"/{name}/image_raw/compressed"] = ros2.image_message(stamp_ns, marked)
            for topic, message in messages.items():
                kind = raw.TOPICS[topic]
                schema = writer.register_msgdef(kind, SCHEMAS[kind])
                writer.write_message(topic, schema, message, when_ns, when_ns)
    return path


def test_pictures_that_share_a_stamp_are_counted_as_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As of a driver that stamps a batch, or of a bag that was merged with itself."""
    recording = open_recording(logged(tmp_path / "a.mcap", lambda k: T0 + 0.2 * (k // 2)))
    assert isinstance(recording, RawMcapRecording) and recording.unstamped == ()
    assert len(recording) == 3 and recording.left_out == {"pictures with the stamp of an earlier one": 6}
    assert [left[0, 0] for left, _ in recording.raw_pairs()] == [0, 2, 4]
    assert run(app, ["info", str(tmp_path / "a.mcap")]) == 0
    assert "left out: 6 pictures with the stamp of an earlier one" in capsys.readouterr().out


@pytest.mark.parametrize(("stamp_s", "all_alike"), [(0.0, False), (T0, False), (0.0, True)])
def test_of_a_driver_that_never_sets_a_stamp_the_times_of_recording_are_used_and_it_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], stamp_s: float, all_alike: bool
) -> None:
    recording = open_recording(logged(tmp_path / "a.mcap", lambda _: stamp_s, all_alike=all_alike))
    assert isinstance(recording, RawMcapRecording) and recording.left_out == {}
    assert recording.unstamped == (raw.LEFT_IMAGE, raw.RIGHT_IMAGE, *([ros2.ODOMETRY] if all_alike else []))
    assert recording.stamps_s == pytest.approx(T0 + 0.1 * np.arange(6), abs=1e-6)
    assert [left[0, 0] for left, _ in recording.raw_pairs()] == list(range(6))
    np.testing.assert_allclose([each.odometry.travelled_m for each in recording], 0.1 * np.arange(6), atol=1e-6)
    assert run(app, ["info", str(tmp_path / "a.mcap")]) == 0
    told = capsys.readouterr().out
    assert f"all of {raw.LEFT_IMAGE} has one header stamp: the times at which it was recorded are used" in told


def test_of_five_pairs_of_one_moment_one_counts_and_the_others_are_said_to_be_left_out(tmp_path: Path) -> None:
    """Our own writer's log times are its header stamps: they say no more."""
    with RawWriter(tmp_path / "a.mcap", RIG, T_BASE_CAM) as writer:
        writer.write_report(report(0))
        for _ in range(5):
            writer.write_pair(*BOTH, T0 + 0.05, T0 + 0.05)
            writer.write_report(report(1))
    recording = RawMcapRecording(tmp_path / "a.mcap")
    assert len(recording) == 1 and recording.unstamped == ()
    assert recording.left_out == {
        "pictures with the stamp of an earlier one": 8,
        "reports of the odometry with the stamp of an earlier one": 4,
    }


TOPICS = RawTopics("/cam0/image", "/cam1/image", "/cam0/info", "/cam1/info", "/wheels/odometry")


@pytest.mark.parametrize(
    "image",
    [uncompressed("mono8", 1, pad=32), uncompressed("rgb8", 3), uncompressed("bgra8", 4)],
    ids=["mono8", "rgb8", "bgra8"],
)
def test_bags_of_others_are_read_by_their_own_topics(tmp_path: Path, image: Any) -> None:
    path = foreign(tmp_path / "bag.mcap", TOPICS, image)
    (pair,) = RawMcapRecording(path, TOPICS).raw_pairs()
    np.testing.assert_array_equal(pair[0], BOTH[0])
    np.testing.assert_array_equal(pair[1], BOTH[1])
    with pytest.raises(RecordingError, match=r"lead from base_link to the left camera's frame 'cam'.*--mount"):
        open_recording(path)
    (found,) = open_recording(path, given=Given(T_base_cam=T_BASE_CAM))
    np.testing.assert_array_equal(found.left, next(iter(RawMcapRecording(path, TOPICS))).left)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"distortion_model": "equidistant"}, "no left distortion model named 'equidistant'; choose from: plumb_bob"),
        ({"k": [0.0] * 9}, r"the left camera_info holds no calibration \(its K or P is zero\)"),
        ({"d": [0.1, 0.2, 0.3]}, "holds 3 numbers of distortion"),
        ({"width": 320}, r"of pictures of \(320, 120\) and \(160, 120\) px"),
        ({"r": [0.0, -1, 0, 1, 0, 0, 0, 0, 1]}, "the right camera is not to the right"),
        ({"k": [1700.0, 0, 77, 0, 1710, 61, 0, 0, 1]}, "the left focal length is 1700 px"),
        ({"r": [2.0, 0, 0, 0, 2, 0, 0, 0, 2]}, "the left R is not rigid"),
    ],
)
def test_a_calibration_that_cannot_be_true_is_refused(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    path = foreign(tmp_path / "bag.mcap", TOPICS, uncompressed("mono8", 1), **changed)
    with pytest.raises(RecordingError, match=message):
        RawMcapRecording(path, TOPICS)


def test_an_encoding_that_is_no_picture_is_named_with_the_choices(tmp_path: Path) -> None:
    path = foreign(tmp_path / "bag.mcap", TOPICS, uncompressed("16UC1", 2))
    with pytest.raises(RecordingError, match=r"no encoding of /cam0/image named '16UC1'; did you mean '8UC1'"):
        list(RawMcapRecording(path, TOPICS))


@pytest.mark.parametrize("progressive", [0, 1])
def test_jpeg_pictures_are_read_too(tmp_path: Path, progressive: int) -> None:
    _, jpeg = cv2.imencode(".jpg", BOTH[0], [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive])
    message = raw_message(jpeg.tobytes())
    np.testing.assert_allclose(read_image(message, "/left", (120, 160)).astype(int), BOTH[0], atol=12)
    with pytest.raises(InvalidInputError, match=r"/left is \(120, 160\), the recording's camera \(64, 64\)"):
        read_image(message, "/left", (64, 64))
    with pytest.raises(RecordingError, match="/left: a JPEG image without a size"):
        read_image(raw_message(jpeg.tobytes()[:20]), "/left", (120, 160))


def raw_message(data: bytes) -> Any:
    return type("CompressedImage", (), {"data": data})


class Interrupted:
    """A file of which an interrupt lets half of a piece be written."""

    def __init__(self, file: Any) -> None:
        self.file = file

    def write(self, piece: memoryview) -> int:
        self.file.write(piece[: len(piece) // 2])
        raise KeyboardInterrupt


def test_an_interrupt_amid_a_write_costs_nothing(tmp_path: Path) -> None:
    file = Ros2File(tmp_path / "a.mcap", raw.TOPICS, metadata={}, grouped=True)
    for k in range(3):
        file.write(raw.BATTERY, k, raw.battery_message(k, 12.0 + k))
        if k == 1:
            whole, file._pieces._file = file._pieces._file, Interrupted(file._pieces._file)  # type: ignore[assignment]
            with pytest.raises(KeyboardInterrupt):
                file.flush()
            file._pieces._file = whole
        file.flush()
    file.close()
    with (tmp_path / "a.mcap").open("rb") as written:
        read = list(
            make_reader(written, validate_crcs=True, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        )
    assert [message.voltage for *_, message in read] == [12, 13, 14]


class FullForAMoment:
    """A file on a disk that has room for half of a piece, and later for all."""

    def __init__(self, file: Any) -> None:
        self.file = file
        self.n_writes = 0

    def write(self, piece: memoryview) -> int:
        self.n_writes += 1
        if self.n_writes == 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        return int(self.file.write(piece[: len(piece) // 2] if self.n_writes == 1 else piece))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.file, name)


def test_what_a_full_disk_cut_off_ends_the_file_though_there_is_room_again(tmp_path: Path) -> None:
    with RawWriter(tmp_path / "a.mcap", RIG, T_BASE_CAM) as writer:
        for k in range(3):
            writer.write_report(report(k))
            writer.write_pair(*BOTH, T0 + 0.1 * k + 0.048, T0 + 0.1 * k + 0.052)
        writer.write_report(report(3))
        pieces = writer._file._pieces
        pieces._file = FullForAMoment(pieces._file)  # type: ignore[assignment]
        for again in (lambda: writer.write_pair(*BOTH, T0 + 0.4, T0 + 0.4), lambda: writer.write_note("dropped", "1")):
            with pytest.raises(RecordingError, match=r"a\.mcap: cannot be written: No space left on device"):
                again()
    recording = RawMcapRecording(tmp_path / "a.mcap")
    size = (tmp_path / "a.mcap").stat().st_size
    assert len(list(recording)) == 3 and size == writer.n_bytes
    assert recording.damage is not None and f"byte {size}" in recording.damage, "all of the file is whole messages"


def test_pictures_of_another_size_than_the_calibration_are_not_written(tmp_path: Path) -> None:
    with (
        RawWriter(tmp_path / "a.mcap", RIG, T_BASE_CAM) as writer,
        pytest.raises(InvalidInputError, match=r"pictures are of \(80, 60\) px, the calibration of \(160, 120\)"),
    ):
        writer.write_pair(BOTH[0][::2, ::2], BOTH[1][::2, ::2], T0, T0)
