"""An MCAP recording gives back what was written, and other readers can read it."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.recording.mcap import McapRecording, McapWriter
from stereogrid.recording.ros2_messages import TOPICS, stamp_to_ns


def test_what_is_written_is_read_back_exactly(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    written = synthetic.observations(5)
    recording = McapRecording(synthetic.write_mcap(tmp_path / "a.mcap", written))
    assert recording.camera == synthetic.camera
    np.testing.assert_allclose(recording.T_base_cam, synthetic.T_base_cam, atol=1e-12)
    for before, after in zip(written, recording, strict=True):
        np.testing.assert_array_equal(before.left, after.left)
        np.testing.assert_array_equal(before.right, after.right)
        assert before.truth.depth_m.tobytes() == after.truth.depth_m.tobytes()
        np.testing.assert_allclose(before.T_world_cam, after.T_world_cam, atol=1e-12)
        np.testing.assert_allclose(before.truth.T_world_cam, after.truth.T_world_cam, atol=1e-12)
        assert stamp_to_ns(before.stamp_s) == stamp_to_ns(after.stamp_s)
        assert before.stamp_s == after.stamp_s


def test_what_moves_is_read_back_with_its_name_and_mesh(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    written = synthetic.observations(3)
    recording = McapRecording(
        synthetic.write_mcap(tmp_path / "a.mcap", written, mover_meshes_ply={"walker": b"ply\n\x00"})
    )
    for before, after in zip(written, recording, strict=True):
        assert list(after.truth.movers) == ["walker", "trolley"]
        for name, T_world_mover in before.truth.movers.items():
            np.testing.assert_allclose(after.truth.movers[name], T_world_mover, atol=1e-12)
    assert recording.mover_mesh_ply("walker") == b"ply\n\x00" and recording.mover_mesh_ply("trolley") is None


def test_ticks_are_read_back_and_are_no_observations(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    written = synthetic.observations(4)
    recording = McapRecording(synthetic.write_mcap(tmp_path / "a.mcap", written))
    expected = [tick for each in written for tick in synthetic.ticks_of(each)]
    ticks = recording.ticks()
    assert len(recording) == 4 and ticks is not None and len(ticks) == len(expected)
    for k, (stamp_s, T_world_base, wheels_rad) in enumerate(expected):
        assert ticks.stamp_s[k] == pytest.approx(stamp_s, abs=1e-9)
        np.testing.assert_allclose(ticks.T_world_base[k], T_world_base, atol=1e-12)
        np.testing.assert_array_equal(ticks.wheels_rad[k], wheels_rad)


def test_a_recording_without_ticks_says_so(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    assert (
        McapRecording(synthetic.write_mcap(tmp_path / "a.mcap", synthetic.observations(2, truth=False))).ticks() is None
    )


def test_ticks_must_come_in_order(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    with (
        pytest.raises(InvalidInputError, match="ticks' stamps must increase"),
        McapWriter(tmp_path / "a.mcap", synthetic.camera, synthetic.T_base_cam) as writer,
    ):
        for stamp_s in (1.0, 0.5):
            writer.write_tick(stamp_s, np.eye(4), np.zeros(2))


def test_the_same_observations_give_the_same_bytes(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    files = [synthetic.write_mcap(tmp_path / name, synthetic.observations(3), metadata={"k": "v"}) for name in "ab"]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_metadata_and_the_true_mesh_are_kept(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    options = {"metadata": {"world": "corridor"}, "truth_mesh_ply": b"ply\n\x00\xff"}
    recording = McapRecording(synthetic.write_mcap(tmp_path / "a.mcap", synthetic.observations(1), **options))
    assert recording.metadata["world"] == "corridor"
    assert recording.metadata["format_version"] == "1"
    assert recording.truth_mesh_ply() == b"ply\n\x00\xff"
    assert recording.is_complete


def test_without_truth_none_is_invented(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    recording = McapRecording(synthetic.write_mcap(tmp_path / "a.mcap", synthetic.observations(2, truth=False)))
    assert [each.truth for each in recording] == [None, None]
    assert recording.true_poses() is None
    assert recording.truth_mesh_ply() is None


def test_true_poses_are_nan_where_an_observation_has_none(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    observations = [*synthetic.observations(1), synthetic.observations(2, truth=False)[1]]
    true_poses = McapRecording(synthetic.write_mcap(tmp_path / "a.mcap", observations)).true_poses()
    assert true_poses is not None
    np.testing.assert_allclose(true_poses[0], observations[0].truth.T_world_cam, atol=1e-12)
    assert np.isnan(true_poses[1]).all()


def test_the_way_travelled_is_summed_over_the_odometry(mcap_file: Path, synthetic: SimpleNamespace) -> None:
    places = np.array([each.odometry.T_odom_base[:3, 3] for each in synthetic.observations(5)])
    last = list(McapRecording(mcap_file))[-1].odometry
    assert last.travelled_m == pytest.approx(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    assert last.turned_rad == pytest.approx(0.4)


def test_rosbags_reads_every_message(mcap_file: Path, synthetic: SimpleNamespace) -> None:
    with AnyReader([mcap_file]) as bag:
        messages = [(c.topic, bag.deserialize(raw, c.msgtype)) for c, _, raw in bag.messages()]
        assert {c.topic: c.msgtype for c in bag.connections} == TOPICS
    assert len(messages) == 5 * (9 + 3 * 2) + 1
    P_right = next(m for topic, m in messages if topic == "/right/camera_info").p
    assert P_right[3] == pytest.approx(-40 * 0.06)
    depth = next(m for topic, m in messages if topic == "/truth/depth")
    assert depth.data.tobytes() == synthetic.observations(1)[0].truth.depth_m.tobytes()


def test_the_ros2_reader_of_mcap_reads_every_message(mcap_file: Path) -> None:
    with mcap_file.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        messages = [(channel.topic, record, message) for _, channel, record, message in reader.iter_decoded_messages()]
    assert {topic for topic, _, _ in messages} == set(TOPICS)
    movers = next(message for topic, _, message in messages if topic == "/truth/movers").transforms
    assert [(each.header.frame_id, each.child_frame_id) for each in movers] == [
        ("world", "walker"),
        ("world", "trolley"),
    ]
    (tf,) = [message for topic, _, message in messages if topic == "/tf_static"]
    frames = tf.transforms[0].header.frame_id, tf.transforms[0].child_frame_id
    assert frames == ("base_link", "left_camera_optical")
    assert len([topic for topic, _, _ in messages if topic == "/tf"]) == 5
    for topic, record, message in messages:
        assert record.log_time == record.publish_time
        if topic not in ("/tf", "/tf_static", "/truth/movers"):
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == record.log_time


def test_an_existing_file_is_kept_unless_told_otherwise(mcap_file: Path, synthetic: SimpleNamespace) -> None:
    before = mcap_file.read_bytes()
    with pytest.raises(RecordingError, match=r"drive\.mcap: exists already; .*overwrite=True"):
        synthetic.write_mcap(mcap_file, [])
    assert mcap_file.read_bytes() == before
    synthetic.write_mcap(mcap_file, synthetic.observations(2), overwrite=True)
    assert len(McapRecording(mcap_file)) == 2


def test_an_error_in_the_run_leaves_a_finished_file(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    with (
        pytest.raises(KeyError),
        McapWriter(tmp_path / "a.mcap", synthetic.camera, synthetic.T_base_cam) as writer,
    ):
        writer.write(synthetic.observations(1)[0])
        raise KeyError
    recording = McapRecording(tmp_path / "a.mcap")
    assert recording.is_complete and len(recording) == 1


def test_a_folder_that_does_not_exist_is_named(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    with pytest.raises(RecordingError, match=r"nowhere/a\.mcap: cannot be written: No such file"):
        synthetic.write_mcap(tmp_path / "nowhere" / "a.mcap", [])


def test_stamps_must_increase(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    first, second = synthetic.observations(2)
    with pytest.raises(InvalidInputError, match="stamps must increase"):
        synthetic.write_mcap(tmp_path / "a.mcap", [second, first])


def test_a_stamp_before_the_epoch_is_refused(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    with pytest.raises(InvalidInputError, match="between 0 and"):
        synthetic.write_mcap(tmp_path / "a.mcap", synthetic.observations(1, start_s=-1.0))


def test_images_of_another_size_are_refused(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    (observation,) = synthetic.observations(1)
    small = type(observation)(
        0, observation.left[:8], observation.right[:8], observation.odometry, observation.T_world_cam
    )
    with pytest.raises(InvalidInputError, match=r"image is \(8, 32\), the recording's camera \(24, 32\)"):
        synthetic.write_mcap(tmp_path / "a.mcap", [small])


@pytest.mark.parametrize("metadata", [{"world": 3}, {"format_version": "2"}])
def test_metadata_must_be_text_and_not_ours(
    tmp_path: Path, synthetic: SimpleNamespace, metadata: dict[str, object]
) -> None:
    with pytest.raises(InvalidInputError, match="metadata"):
        synthetic.write_mcap(tmp_path / "a.mcap", [], metadata=metadata)
    assert not (tmp_path / "a.mcap").exists()


def test_a_note_made_while_recording_is_in_the_metadata(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    with McapWriter(tmp_path / "a.mcap", synthetic.camera, synthetic.T_base_cam, metadata={"world": "x"}) as writer:
        writer.write(synthetic.observations(1)[0])
        writer.write_note("ended early", "the robot is stuck")
    metadata = McapRecording(tmp_path / "a.mcap").metadata
    assert metadata["world"] == "x" and metadata["ended early"] == "the robot is stuck"
