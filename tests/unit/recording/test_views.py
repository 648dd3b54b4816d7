"""Views change what they say they change, and nothing else."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.recording import KittiRecording, McapRecording, ShuffledPoses, Subset, TruePoses, poses


def test_true_poses_replace_the_claimed_ones(mcap_file: Path) -> None:
    recording = McapRecording(mcap_file)
    np.testing.assert_array_equal(poses(TruePoses(recording)), recording.true_poses())
    assert not np.allclose(poses(recording), recording.true_poses())


def test_true_poses_need_truth(kitti_folder: Path) -> None:
    with pytest.raises(RecordingError, match=r"observation at 0\.0 s carries no true pose"):
        TruePoses(KittiRecording(kitti_folder))


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
