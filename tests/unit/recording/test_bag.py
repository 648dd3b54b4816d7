"""ROS bags of either ROS, in every storage and compression, are read as what was sent."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import drawn_bags as drawn
import numpy as np
import pytest
from drawn_bags import LENS, T_FOOTPRINT_LENS, Sent, transform, write_bag1, write_bag2
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode

from stereogrid.calibration import Mount, StereoCalibration
from stereogrid.errors import RecordingError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.observation import Observation, Odometry, Truth
from stereogrid.recording import BagRecording, Given, McapRecording, McapWriter, open_recording
from stereogrid.recording import ros2_messages as ros2
from stereogrid.recording import ros2_raw as raw
from stereogrid.recording.raw_writer import camera_matrices
from stereogrid.recording.ros2_file import Ros2File

TF = "tf2_msgs/msg/TFMessage"
STORAGES: dict[str, Any] = {
    "ROS 1": lambda path: write_bag1(path / "a.bag", drawn.drive()),
    "ROS 1, bz2": lambda path: write_bag1(path / "a.bag", drawn.drive(), Writer1.CompressionFormat.BZ2),
    "ROS 1, lz4": lambda path: write_bag1(path / "a.bag", drawn.drive(), Writer1.CompressionFormat.LZ4),
    "db3": lambda path: write_bag2(path / "a", drawn.drive()),
    "db3, messages": lambda path: write_bag2(path / "a", drawn.drive(), compression=CompressionMode.MESSAGE),
    "db3, file": lambda path: write_bag2(path / "a", drawn.drive(), compression=CompressionMode.FILE),
    "db3 alone": lambda path: write_bag2(path / "a", drawn.drive()) / "a.db3",
    "mcap": lambda path: write_bag2(path / "a", drawn.drive(), "mcap"),
    "mcap, chunks": lambda path: write_bag2(path / "a", drawn.drive(), "mcap", CompressionMode.STORAGE),
    "mcap, messages": lambda path: write_bag2(path / "a", drawn.drive(), "mcap", CompressionMode.MESSAGE),
    "mcap, file": lambda path: write_bag2(path / "a", drawn.drive(), "mcap", CompressionMode.FILE),
    "mcap alone": lambda path: write_bag2(path / "a", drawn.drive(), "mcap") / "a.mcap",
}


def without(sent: list[Sent], *topics: str) -> list[Sent]:
    return [each for each in sent if each.topic not in topics]


def moved(n: int, parent: str, child: str, pose_at: Any, topic: str = "/tf") -> list[Sent]:
    stamps_s = [drawn.T0_S + drawn.PERIOD_S * k for k in range(n)]
    return [
        Sent(topic, TF, transform(ros2.stamp_to_ns(t), parent, child, pose_at(t)), ros2.stamp_to_ns(t))
        for t in stamps_s
    ]


def check_drive(recording: Any, T_base_cam: np.ndarray = T_FOOTPRINT_LENS) -> None:
    """The pictures, and the poses of the left lens, of drawn.drive."""
    np.testing.assert_allclose(recording.T_base_cam, T_base_cam, atol=1e-12)
    observations = list(recording)
    assert len(observations) == 6
    for k, each in enumerate(observations):
        np.testing.assert_array_equal(each.left, drawn.picture(k, 0))
        np.testing.assert_array_equal(each.right, drawn.picture(k, 1))
        assert each.stamp_s == pytest.approx(drawn.T0_S + 0.1 * k + 0.032, abs=1e-6)
        # The odometry turns by .01 rad between reports; straight lines between them are off by less than a millimetre.
        np.testing.assert_allclose(each.T_world_cam, drawn.pose_at(each.stamp_s) @ T_FOOTPRINT_LENS, atol=1e-3)
        np.testing.assert_allclose(each.odometry.T_odom_base @ T_base_cam, each.T_world_cam, atol=1e-9)


@pytest.mark.parametrize("storage", STORAGES)
def test_a_drive_is_read_as_it_was_sent_from_every_storage(tmp_path: Path, storage: str) -> None:
    recording = open_recording(STORAGES[storage](tmp_path))
    assert isinstance(recording, BagRecording)
    assert recording.left_out == {} and recording.damage is None
    assert recording.camera == drawn.CAMERA
    check_drive(recording)
    (last,) = recording.read([5])
    np.testing.assert_array_equal(last.right, drawn.picture(5, 1))


def test_a_picture_is_found_without_a_walk_through_its_topic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = open_recording(write_bag1(tmp_path / "a.bag", drawn.drive()))
    walked, messages = [], Reader1.messages

    def counted(self: Reader1, connections: Any, **of: Any) -> Any:
        walked.append(sum(len(self.indexes[each.id]) for each in connections))
        return messages(self, connections, **of)

    monkeypatch.setattr(Reader1, "messages", counted)
    check_drive(recording)
    assert walked == 12 * [1]


def test_a_bag_in_several_files_is_read_in_their_order_and_a_missing_one_is_said(tmp_path: Path) -> None:
    sent = drawn.drive(6)
    half_ns = ros2.stamp_to_ns(drawn.T0_S + 0.3)
    parts = [[each for each in sent if (each.log_ns < half_ns) == first] for first in (True, False)]
    folder = write_bag2(tmp_path / "a", parts[0])
    shutil.move(write_bag2(tmp_path / "a_1", parts[1]) / "a_1.db3", folder / "a_1.db3")
    about = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(about.replace("- a.db3", "- a.db3\n  - a_1.db3", 1))
    check_drive(open_recording(folder))
    (folder / "a_1.db3").unlink()
    recording = open_recording(folder)
    assert recording.damage == "a_1.db3 is missing" and len(recording) < 6


def test_a_folder_whose_recorder_was_cut_off_before_it_wrote_metadata_opens(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "a", drawn.drive())
    (folder / "metadata.yaml").unlink()
    check_drive(open_recording(folder))


def test_a_file_of_ours_in_a_folder_of_ros_2_is_what_it_is_alone(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "a", drawn.drive(), "mcap")
    (folder / "a.mcap").unlink()
    with McapWriter(folder / "a.mcap", drawn.CAMERA, T_FOOTPRINT_LENS) as writer:
        T = drawn.pose_at(drawn.T0_S)
        truth = Truth(T @ T_FOOTPRINT_LENS)
        pair = drawn.picture(0, 0), drawn.picture(0, 1)
        writer.write(Observation(drawn.T0_S, *pair, Odometry(T), T @ T_FOOTPRINT_LENS, truth))
    recording = open_recording(folder)
    assert isinstance(recording, McapRecording) and recording.true_poses() is not None


def test_transforms_alone_place_the_camera(tmp_path: Path) -> None:
    """map -> odom moves slowly and seldom, odom -> base_footprint often: the smoother is used."""
    sent = [
        *without(drawn.drive(), "/odom"),
        *moved(7, "odom", "base_footprint", drawn.pose_at),
        *moved(2, "map", "odom", lambda t: from_yaw(0.3, [t - drawn.T0_S, 0, 0])),
    ]
    recording = open_recording(write_bag1(tmp_path / "a.bag", sent))
    assert "poses: /tf" in list(recording.notes())
    check_drive(recording)


def test_transforms_are_composed_over_all_that_moves(tmp_path: Path) -> None:
    """The robot in the world, and the camera on a mast that sinks: what moves against the base carries no camera."""
    sent = [
        *without(drawn.drive(), "/odom", "/tf_static"),
        *moved(7, "world", "chassis", drawn.pose_at),
        *moved(7, "chassis", "head", lambda t: from_rotation(np.eye(3), [0.1, 0, 0.5 - 0.1 * (t - drawn.T0_S)])),
        Sent("/tf_static", TF, transform(0, "head", LENS, drawn.T_MAST_LENS), ros2.stamp_to_ns(drawn.T0_S)),
    ]
    recording = open_recording(write_bag2(tmp_path / "a", sent))
    np.testing.assert_allclose(recording.T_base_cam, drawn.T_MAST_LENS, atol=1e-12)
    for stamp_s, pose in zip(recording.stamps_s, recording.poses, strict=True):
        head = from_rotation(np.eye(3), [0.1, 0, 0.5 - 0.1 * (stamp_s - drawn.T0_S)])
        np.testing.assert_allclose(pose, drawn.pose_at(stamp_s) @ head @ drawn.T_MAST_LENS, atol=1e-3)


def test_fixed_frames_that_ros_1_tells_again_and_again_are_fixed(tmp_path: Path) -> None:
    sent = [*without(drawn.drive(), "/tf_static")]
    for each in drawn.fixed_frames():
        (stamped,) = each.message["transforms"]
        for k in range(3):
            header = ros2.header(each.log_ns + k, "/" + stamped["header"]["frame_id"])
            message = {"transforms": [{**stamped, "header": header}]}
            sent.append(each._replace(topic="/tf", message=message, log_ns=each.log_ns + k))
    check_drive(open_recording(write_bag1(tmp_path / "a.bag", sent)))


@pytest.mark.parametrize("kind", ["PoseStamped", "PoseWithCovarianceStamped", "TransformStamped"])
def test_poses_of_the_base_place_the_camera_where_there_is_no_odometry(tmp_path: Path, kind: str) -> None:
    sent = without(drawn.drive(), "/odom")
    for each in drawn.odometry():
        header, pose = each.message["header"], each.message["pose"]["pose"]
        message: dict[str, Any] = {"header": header, "pose": pose}
        if kind == "PoseWithCovarianceStamped":
            message = {"header": header, "pose": {"pose": pose}}
        elif kind == "TransformStamped":
            T = {"translation": pose["position"], "rotation": pose["orientation"]}
            message = {"header": header, "child_frame_id": "base_footprint", "transform": T}
        sent.append(Sent("/vicon/pose", f"geometry_msgs/msg/{kind}", message, each.log_ns))
    recording = open_recording(write_bag2(tmp_path / "a", sent))
    assert "poses: /vicon/pose" in list(recording.notes())
    check_drive(recording)


def test_an_odometry_of_the_camera_itself_is_turned_into_one_of_the_base(tmp_path: Path) -> None:
    sent = without(drawn.drive(), "/odom")
    for each in drawn.odometry(child=LENS):
        stamp_s = each.log_ns / 1e9
        message = ros2.odometry_message(each.log_ns, drawn.pose_at(stamp_s) @ T_FOOTPRINT_LENS)
        sent.append(each._replace(message={**message, "child_frame_id": LENS}))
    check_drive(open_recording(write_bag2(tmp_path / "tree", sent)))

    alone = open_recording(write_bag2(tmp_path / "alone", without(sent, "/tf_static")))
    assert any("the base is at the camera" in note for note in alone.notes())
    check_drive(alone, from_rotation(R_BASE_OPTICAL))

    mount = Mount(0.2, 0.0, 0.5, 10.0).T_base_cam
    given = open_recording(tmp_path / "alone", given=Given(T_base_cam=mount))
    check_drive(given, mount)


def test_a_frame_of_x_forward_in_the_pictures_is_not_taken_for_an_optical_one(tmp_path: Path) -> None:
    sent = without(drawn.drive(), "/tf_static")
    T_base_body = from_yaw(0.1, [0.2, 0, 0.5])
    sent.append(Sent("/tf_static", TF, transform(0, "base_footprint", LENS.replace("optical_", ""), T_base_body), 0))
    for each in sent:
        if each.kind == "sensor_msgs/msg/Image":
            each.message["header"]["frame_id"] = LENS.replace("optical_", "")
    recording = open_recording(write_bag2(tmp_path / "a", sent))
    np.testing.assert_allclose(recording.T_base_cam, T_base_body @ from_rotation(R_BASE_OPTICAL), atol=1e-12)
    assert any("x is taken to be forward" in note for note in recording.notes())


def turned_rig() -> StereoCalibration:
    """Whose lenses bend, and whose right camera is turned, so that rectifying turns the left one, too."""
    turned = from_rotation(from_yaw(0.02)[:3, :3], [-0.06, 0.001, 0])
    return StereoCalibration((drawn.CAMERA.K,) * 2, (np.array([-0.1, 0.02, 0, 0, 0]),) * 2, turned, (32, 24))


@pytest.mark.parametrize(("child", "tree"), [(LENS, "none"), (LENS, "of the mast"), ("mast", "of the mast")])
def test_an_odometry_of_what_carries_raw_cameras_places_the_rectified_one_whatever_its_mount(
    tmp_path: Path, child: str, tree: str
) -> None:
    """Where a mount is given, it says where the base is, and not where the cameras were."""
    T_footprint_child = T_FOOTPRINT_LENS if child == LENS else drawn.T_FOOTPRINT_BASE @ drawn.T_BASE_MAST
    told = []
    for each in drawn.odometry(child=child):
        message = ros2.odometry_message(each.log_ns, drawn.pose_at(each.log_ns / 1e9) @ T_footprint_child)
        told.append(each._replace(message={**message, "child_frame_id": child}))
    frames = [] if tree == "none" else drawn.fixed_frames()[2:]
    path = write_bag2(tmp_path / "a", [*frames, *drawn.pictures(6, ("/cam0/image_raw", "/cam1/image_raw")), *told])
    rig, mount = turned_rig(), Mount(0.2, 0.0, 0.5, 10.0).T_base_cam
    recording = open_recording(path, given=Given(calibration=rig, T_base_cam=mount))
    T_lens_cam = from_rotation(rig.rectification().R_rect_left.T)
    assert abs(T_lens_cam - np.eye(4)).max() > 0.005
    np.testing.assert_array_equal(recording.T_base_cam, mount)
    for stamp_s, pose in zip(recording.stamps_s, recording.poses, strict=True):
        np.testing.assert_allclose(pose, drawn.pose_at(stamp_s) @ T_FOOTPRINT_LENS @ T_lens_cam, atol=1e-3)


def test_raw_pictures_are_rectified_and_the_mount_is_of_the_rectified_camera(tmp_path: Path) -> None:
    rig = turned_rig()
    messages = [raw.camera_info_message(5, each) for each in camera_matrices(rig)]
    topics = ("/cam0/image_raw", "/cam1/image_raw")
    infos = [
        Sent(f"/cam{side}/camera_info", "sensor_msgs/msg/CameraInfo", message, ros2.stamp_to_ns(drawn.T0_S))
        for side, message in enumerate(messages)
    ]
    sent = [*drawn.fixed_frames(), *infos, *drawn.pictures(2, topics), *drawn.odometry(3)]
    recording = open_recording(write_bag1(tmp_path / "a.bag", sent))
    rectification = rig.rectification()
    (first, _) = recording
    np.testing.assert_array_equal(first.left, rectification.rectify(drawn.picture(0, 0), drawn.picture(0, 1))[0])
    T_lens_rectified = from_rotation(rectification.R_rect_left.T)
    np.testing.assert_allclose(recording.T_base_cam, T_FOOTPRINT_LENS @ T_lens_rectified, atol=1e-12)

    # The same rig given, for a bag that has no calibration and no transforms.
    bare = [*drawn.pictures(2, topics), *drawn.odometry(3)]
    path = write_bag1(tmp_path / "bare.bag", bare)
    with pytest.raises(RecordingError, match="recorded without a calibration; give one"):
        open_recording(path)
    with pytest.raises(RecordingError, match=r"from base_footprint to the left camera's frame .*--mount x,y,z"):
        open_recording(path, given=Given(calibration=rig))
    given = open_recording(path, given=Given(calibration=rig, T_base_cam=recording.T_base_cam))
    np.testing.assert_allclose(given.poses, recording.poses, atol=1e-9)
    np.testing.assert_array_equal(next(iter(given)).left, first.left)


def test_a_rig_that_stood_still_needs_no_poses(tmp_path: Path) -> None:
    path = write_bag2(tmp_path / "a", without(drawn.drive(), "/odom"))
    with pytest.raises(RecordingError, match=r"nothing tells where the robot was.*--poses standing.*/whirl \(odd_msgs"):
        open_recording(path)
    recording = open_recording(path, given=Given(standing=True))
    np.testing.assert_allclose(recording.poses, [T_FOOTPRINT_LENS] * 6, atol=1e-12)


def test_the_base_travels_its_own_way_and_not_that_of_the_frame_that_is_told(tmp_path: Path) -> None:
    """A robot that turns on the spot: its mast swings, its base does not move."""
    turning = without(drawn.drive(), "/odom")
    for each in drawn.odometry(child="mast"):
        T = from_yaw(each.log_ns / 1e9 - drawn.T0_S) @ drawn.T_FOOTPRINT_BASE @ drawn.T_BASE_MAST
        turning.append(each._replace(message={**ros2.odometry_message(each.log_ns, T), "child_frame_id": "mast"}))
    recording = open_recording(write_bag2(tmp_path / "a", turning))
    odometry = [each.odometry for each in recording]
    assert odometry[-1].travelled_m == pytest.approx(0.0, abs=1e-9)
    assert odometry[-1].turned_rad == pytest.approx(recording.stamps_s[-1] - drawn.T0_S, abs=1e-3)


def test_opening_decodes_no_picture(tmp_path: Path) -> None:
    """Pictures that cannot be decoded are found when they are read."""
    sent = drawn.drive()
    for each in sent:
        if each.topic == "/stereo/left/image_rect":
            each.message["encoding"] = "32FC1"
    recording = open_recording(write_bag1(tmp_path / "a.bag", sent))
    assert len(recording) == 6
    with pytest.raises(RecordingError, match=r"a\.bag: the observation at .*no encoding of /stereo/left/image_rect"):
        list(recording)


def test_a_bag_in_its_given_topics_is_read_by_them(tmp_path: Path) -> None:
    sent = [*drawn.drive(), *drawn.pictures(6, ("/other/first", "/other/last")), *drawn.odometry(7, "/elsewhere")]
    path = write_bag2(tmp_path / "a", sent)
    given = Given(
        left_image="/other/first",
        right_image="/other/last",
        left_info="/stereo/left/camera_info",
        right_info="/stereo/right/camera_info",
        odometry="/elsewhere",
    )
    recording = open_recording(path, given=given)
    assert list(recording.notes())[:2] == ["pictures: /other/first, /other/last", "poses: /elsewhere"]
    # Not named as rectified: rectified by numbers that change nothing but the last bit.
    np.testing.assert_allclose(recording.poses, open_recording(path).poses, atol=1e-12)
    with pytest.raises(RecordingError, match="there is no topic /nowhere; its topics: "):
        open_recording(path, given=replace(given, odometry="/nowhere"))
    with pytest.raises(RecordingError, match=r"/odom holds nav_msgs/msg/Odometry, not sensor_msgs/msg/CompressedImage"):
        open_recording(path, given=replace(given, left_image="/odom"))


def test_foreign_mcap_files_open_by_the_same_finder_and_ours_as_before(tmp_path: Path) -> None:
    path = write_bag2(tmp_path / "a", drawn.drive(), "mcap") / "a.mcap"
    assert isinstance(open_recording(path), BagRecording)
    # By chance on topics of ours, with stamps and frames of their own.
    names = {}
    for side in ("left", "right"):
        names[f"/stereo/{side}/image_rect"] = f"/{side}/image_rect/compressed"
        names[f"/stereo/{side}/camera_info"] = f"/{side}/camera_info"
    sent = [each._replace(topic=names.get(each.topic, each.topic)) for each in drawn.drive()]
    check_drive(open_recording(write_bag2(tmp_path / "b", sent, "mcap") / "b.mcap"))
    ours = tmp_path / "ours.mcap"
    Ros2File(ours, raw.TOPICS, metadata={raw.KIND: raw.RAW}).close()
    with pytest.raises(RecordingError, match="no messages on /left/image_raw/compressed"):
        open_recording(ours)


def test_a_damaged_foreign_mcap_gives_what_is_readable(tmp_path: Path) -> None:
    path = write_bag2(tmp_path / "a", drawn.drive(60), "mcap") / "a.mcap"
    whole = len(open_recording(path))
    path.write_bytes(path.read_bytes()[:-40])
    recording = open_recording(path)
    assert recording.damage is not None and len(recording) == whole


def test_a_recording_of_a_kind_that_takes_nothing_says_so(tmp_path: Path, kitti_folder: Path) -> None:
    with McapWriter(tmp_path / "a.mcap", drawn.CAMERA, T_FOOTPRINT_LENS) as writer:
        pair = drawn.picture(0, 0), drawn.picture(0, 1)
        writer.write(Observation(0.0, *pair, Odometry(np.eye(4)), T_FOOTPRINT_LENS))
    with pytest.raises(RecordingError, match="has rectified pictures, calibration and poses of its own"):
        open_recording(tmp_path / "a.mcap", given=Given(standing=True))
    with pytest.raises(RecordingError, match="of the kind kitti takes no odometry from outside; these do: mcap, bag"):
        open_recording(kitti_folder, given=Given(odometry="/odom"))
