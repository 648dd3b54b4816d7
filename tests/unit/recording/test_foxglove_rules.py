"""What Foxglove and `ros2 bag` ask of a recording: one tree of frames, whole definitions, an index, promised QoS."""

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray, from_quaternion_wxyz, from_yaw, inverse
from stereogrid.recording import RawReport, RawWriter
from stereogrid.recording.ros2_schemas import SCHEMAS

CAMERA = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
IMAGES = {
    "/left/image_rect/compressed": "/left/camera_info",
    "/right/image_rect/compressed": "/right/camera_info",
    "/left/image_raw/compressed": "/left/camera_info",
    "/right/image_raw/compressed": "/right/camera_info",
}


def write_raw(path: Path, synthetic: SimpleNamespace) -> Path:
    """Three reports and two pairs, the motion lost before the last report."""
    left, right = np.zeros((2, 24, 32), np.uint8)
    with RawWriter(path, CAMERA, synthetic.T_base_cam) as writer:
        for k in range(3):
            lost = int(k == 2)
            writer.write_report(
                RawReport(10 + k, from_yaw(0.1 * k), odometry_lost=lost, sonar_m={0: 1.0}, battery_v=12)
            )
            writer.write_pair(left, right, 10.2 + k, 10.3 + k)
    return path


MAKERS: dict[str, Callable[[Path, SimpleNamespace], Path]] = {
    "with truth": lambda path, synthetic: synthetic.write_mcap(path, synthetic.observations(4), truth_mesh_ply=b"ply"),
    "without truth": lambda path, synthetic: synthetic.write_mcap(path, synthetic.observations(4, truth=False)),
    "raw": write_raw,
}


@pytest.fixture(scope="module", params=MAKERS)
def file(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, synthetic: SimpleNamespace) -> Path:
    return MAKERS[request.param](tmp_path_factory.mktemp("rules") / "drive.mcap", synthetic)


def decoded(path: Path) -> list[tuple[str, Any, Any]]:
    """Topic, record and message of all there is, in the order of log times."""
    with path.open("rb") as opened:
        reader = make_reader(opened, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [(channel.topic, record, message) for _, channel, record, message in reader.iter_decoded_messages()]


def frames_of(path: Path) -> tuple[dict[str, set[str]], list[tuple[int, str, FloatArray]]]:
    """Parents of each frame, and the transforms to it in order: log time, child, T_parent_child."""
    parents, poses = defaultdict(set), []
    for _, record, message in decoded(path):
        for each in getattr(message, "transforms", ()):
            t, q = each.transform.translation, each.transform.rotation
            parents[each.child_frame_id].add(each.header.frame_id)
            poses.append(
                (record.log_time, each.child_frame_id, from_quaternion_wxyz([q.w, q.x, q.y, q.z], [t.x, t.y, t.z]))
            )
    return parents, poses


def test_a_frame_has_one_parent_and_none_is_its_own_ancestor(file: Path) -> None:
    parents, _ = frames_of(file)
    for frame, above in parents.items():
        # What comes after the motion was lost is a tree of its own.
        assert len({parent.split("_")[0] if parent.startswith("odom") else parent for parent in above}) == 1, frame
        seen = {frame}
        while frame in parents:
            frame = min(parents[frame])
            assert frame not in seen
            seen.add(frame)


def test_every_frame_that_a_message_names_is_in_the_tree(file: Path) -> None:
    parents, _ = frames_of(file)
    known = set(parents) | set().union(*parents.values())
    named = {m.header.frame_id for _, _, m in decoded(file) if hasattr(m, "header")}
    assert {frame for frame in named if not frame.startswith("sonar_")} <= known


def test_the_tree_of_a_simulated_drive_is_one(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    parents, _ = frames_of(MAKERS["with truth"](tmp_path / "a.mcap", synthetic))
    assert {frame: min(above) for frame, above in parents.items()} == {
        "odom": "world",
        "base_link": "odom",
        "left_camera_optical": "base_link",
        "right_camera_optical": "left_camera_optical",
        "base_link_true": "world",
        "left_camera_optical_true": "base_link_true",
        "walker": "world",
        "trolley": "world",
    }


def test_the_frames_put_the_cameras_where_the_observations_have_them(
    tmp_path: Path, synthetic: SimpleNamespace
) -> None:
    written = synthetic.observations(4)
    _, poses = frames_of(synthetic.write_mcap(tmp_path / "a.mcap", written))
    latest = {child: T for _, child, T in poses}
    claimed = latest["odom"] @ latest["base_link"] @ latest["left_camera_optical"]
    true = latest["base_link_true"] @ latest["left_camera_optical_true"]
    np.testing.assert_allclose(claimed, written[-1].T_world_cam, atol=1e-12)
    np.testing.assert_allclose(true, written[-1].truth.T_world_cam, atol=1e-12)
    # A point on the right camera's axis is a baseline to the right of the left one's.
    np.testing.assert_allclose((latest["right_camera_optical"])[:3, 3], [synthetic.camera.baseline_m, 0, 0])
    np.testing.assert_allclose(inverse(latest["right_camera_optical"])[0, 3], -synthetic.camera.baseline_m)


def test_after_the_motion_was_lost_the_robot_is_in_a_frame_of_its_own(
    tmp_path: Path, synthetic: SimpleNamespace
) -> None:
    messages = [m for topic, _, m in decoded(write_raw(tmp_path / "a.mcap", synthetic)) if topic == "/tf"]
    assert [m.transforms[0].header.frame_id for m in messages] == ["odom", "odom", "odom_1"]
    assert {m.transforms[0].child_frame_id for m in messages} == {"base_link"}


def test_a_picture_and_its_camera_info_name_one_frame_and_one_moment(file: Path) -> None:
    stamps: dict[str, list[Any]] = defaultdict(list)
    for topic, _, message in decoded(file):
        if hasattr(message, "header"):
            stamps[topic].append((message.header.stamp.sec, message.header.stamp.nanosec, message.header.frame_id))
    pictures = stamps.keys() & IMAGES
    assert len(pictures) == 2
    for topic in pictures:
        assert stamps[topic] == stamps[IMAGES[topic]]
        assert {frame for *_, frame in stamps[topic]} == {topic.split("/")[1] + "_camera_optical"}


def test_the_format_of_a_picture_is_a_name_that_foxglove_knows(file: Path) -> None:
    pictures = [message for topic, _, message in decoded(file) if topic in IMAGES]
    assert pictures and {each.format for each in pictures} == {"png"}
    assert all(bytes(each.data[:4]) == b"\x89PNG" for each in pictures)


def test_the_summary_counts_and_indexes_every_message(file: Path) -> None:
    with file.open("rb") as opened:
        reader = make_reader(opened, validate_crcs=True)
        summary, header = reader.get_summary(), reader.get_header()
    assert header.profile == "ros2" and header.library.startswith("stereogrid ")
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == sum(summary.statistics.channel_message_counts.values())
    assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 0
    assert {each.topic for each in summary.channels.values()} == {topic for topic, *_ in decoded(file)}
    indexed = {channel for each in summary.chunk_indexes for channel in each.message_index_offsets}
    assert indexed == set(summary.channels)
    times = [record.log_time for _, record, _ in decoded(file)]
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (min(times), max(times))


def test_tf_static_is_offered_to_who_comes_late_and_all_else_is_not(file: Path) -> None:
    with Reader(file) as bag:
        for connection in bag.connections:
            (qos,) = connection.ext.offered_qos_profiles  # type: ignore[union-attr]
            latched = connection.topic == "/tf_static"
            assert qos.durability == (QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE)
            assert qos.reliability == QosReliability.RELIABLE and qos.depth == 10


@pytest.mark.parametrize("name", SCHEMAS)
@pytest.mark.parametrize("store", [Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY], ids=lambda store: store.value)
def test_our_definitions_are_those_of_ros2(name: str, store: Stores) -> None:
    ours, theirs = get_types_from_msg(SCHEMAS[name], name), get_typestore(store)
    empty = get_typestore(Stores.EMPTY)
    empty.register(ours)
    for each in ours:
        if (each, store) == ("sensor_msgs/msg/Range", Stores.ROS2_HUMBLE):
            # Its last field came later; who does not know it reads up to there.
            assert empty.fielddefs[each][1][:-1] == theirs.fielddefs[each][1]
            continue
        # Later versions have more kinds of batteries.
        assert set(empty.fielddefs[each][0]) <= set(theirs.fielddefs[each][0]), each
        assert empty.fielddefs[each][1] == theirs.fielddefs[each][1], each
        assert empty.hash_rihs01(each) == theirs.hash_rihs01(each), each


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_written_as_rosbag2_writes_it(name: str) -> None:
    """The text of the type, then of all that it needs, each once, after a line of 80 = and its name."""
    first, *others = SCHEMAS[name].split("\n" + "=" * 80 + "\nMSG: ")
    names = [each.split("\n")[0] for each in others]
    assert len(set(names)) == len(names) and all(len(each.split("/")) == 2 for each in names)
    needed = get_types_from_msg(SCHEMAS[name], name).keys() - {name}
    assert {f"{package}/msg/{kind}" for package, kind in (each.split("/") for each in names)} == needed
    theirs, _ = get_typestore(Stores.ROS2_HUMBLE).generate_msgdef(name, ros_version=2)
    assert sorted(names) == sorted(line[5:] for line in theirs.splitlines() if line.startswith("MSG: "))
    assert first and not first.startswith("\n")
