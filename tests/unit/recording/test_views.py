"""Views change what they say they change, and nothing else."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.geometry import from_rotation, inverse, yaw_rad
from stereogrid.observation import Observation, Truth
from stereogrid.recording import KittiRecording, McapRecording, ShuffledPoses, Subset, TruePoses, TrueTilt, poses


def test_true_poses_replace_the_claimed_ones(mcap_file: Path) -> None:
    recording = McapRecording(mcap_file)
    np.testing.assert_array_equal(poses(TruePoses(recording)), recording.true_poses())
    assert not np.allclose(poses(recording), recording.true_poses())


def test_true_poses_need_truth(kitti_folder: Path) -> None:
    with pytest.raises(RecordingError, match=r"observation at 0\.0 s carries no true pose"):
        TruePoses(KittiRecording(kitti_folder))


class Hilly:
    """A recording whose robot truly climbs, leans and veers, and does not know it."""

    def __init__(self, recording: McapRecording) -> None:
        self._recording, self.camera, self.T_base_cam = recording, recording.camera, recording.T_base_cam

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[Observation]:
        for n, each in enumerate(self._recording):
            tilt = from_rotation(Rotation.from_euler("ZYX", [0.3, -0.1 * n, 0.05]).as_matrix(), [0.2, 0.1, 0.1 * n])
            assert each.truth is not None
            yield replace(each, truth=Truth(tilt @ each.truth.T_world_cam))


def test_a_known_tilt_changes_height_roll_and_pitch_and_leaves_the_rest(mcap_file: Path) -> None:
    recording = Hilly(McapRecording(mcap_file))
    tilted = TrueTilt(recording)
    base_cam = inverse(recording.T_base_cam)
    for claimed, found in zip(recording, tilted, strict=True):
        assert claimed.truth is not None
        before, now, truth = (T @ base_cam for T in (claimed.T_world_cam, found.T_world_cam, claimed.truth.T_world_cam))
        np.testing.assert_allclose(now[:2, 3], before[:2, 3], atol=1e-12)
        assert np.isclose(yaw_rad(now), yaw_rad(before))
        # Where z points, seen from the robot's heading, is where it truly points.
        np.testing.assert_allclose(now[2], truth[2], atol=1e-12)
        np.testing.assert_allclose(found.odometry.T_odom_base, now, atol=1e-12)
        np.testing.assert_array_equal(found.left, claimed.left)
    assert not np.allclose(poses(tilted), poses(recording))


def test_a_known_tilt_needs_truth(kitti_folder: Path) -> None:
    with pytest.raises(RecordingError, match=r"observation at 0\.0 s carries no true pose"):
        TrueTilt(KittiRecording(kitti_folder))


@pytest.mark.parametrize(
    ("start", "stop", "stride"), [(0, None, 1), (1, 4, 1), (0, None, 2), (3, 100, 3), (9, None, 1)]
)
def test_a_subset_is_a_slice(mcap_file: Path, start: int, stop: int | None, stride: int) -> None:
    recording = McapRecording(mcap_file)
    subset = Subset(recording, start, stop, stride)
    expected = [each.stamp_s for each in recording][start:stop:stride]
    assert [each.stamp_s for each in subset] == expected
    assert len(subset) == len(expected)
    assert poses(subset).shape == (len(expected), 4, 4)


@pytest.mark.parametrize(("start", "stop", "stride"), [(-1, None, 1), (0, -1, 1), (0, None, 0)])
def test_a_subset_refuses_what_it_cannot_read(mcap_file: Path, start: int, stop: int | None, stride: int) -> None:
    with pytest.raises(InvalidInputError, match="a subset needs"):
        Subset(McapRecording(mcap_file), start, stop, stride)


def test_shuffled_poses_permute_positions_and_turn_headings_by_the_seed(
    tmp_path: Path, synthetic: SimpleNamespace
) -> None:
    recording = McapRecording(synthetic.write_mcap(tmp_path / "a.mcap", synthetic.observations(8)))
    shuffled = poses(ShuffledPoses(recording, 1))
    np.testing.assert_array_equal(shuffled, poses(ShuffledPoses(recording, 1)))
    assert not np.array_equal(shuffled, poses(ShuffledPoses(recording, 2)))
    assert not np.array_equal(shuffled, poses(recording))
    before = poses(recording)
    assert {T[:3, 3].tobytes() for T in shuffled} == {T[:3, 3].tobytes() for T in before}
    # Turned about the vertical only: how far the optical axis points up or down stays with the position.
    tilt = {T[:3, 3].tobytes(): T[2, :3] for T in before}
    for T in shuffled:
        np.testing.assert_allclose(T[2, :3], tilt[T[:3, 3].tobytes()], atol=1e-12)
        assert not any(np.allclose(T[:3, :3], other[:3, :3], atol=1e-3) for other in before)


def test_shuffling_leaves_images_and_truth_together(mcap_file: Path) -> None:
    recording = McapRecording(mcap_file)
    for before, after in zip(recording, ShuffledPoses(recording, 5), strict=True):
        np.testing.assert_array_equal(before.left, after.left)
        assert before.truth is not None and after.truth is not None
        np.testing.assert_array_equal(before.truth.T_world_cam, after.truth.T_world_cam)
