"""What every recording obeys, whatever its format."""

import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn_bags import drive as drawn_drive
from drawn_bags import write_bag1, write_bag2
from euroc_folders import write_euroc
from kitti_drives import KittiDrive
from plain_folders import write_folder
from rgbd_folders import write_frames, write_tum
from scipy.spatial.transform import Rotation

from stereogrid.calibration import StereoCalibration
from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, as_pose, from_rotation, from_yaw
from stereogrid.observation import Observation, Odometry, Recording, Truth
from stereogrid.recording import (
    RECORDINGS,
    FileRecording,
    McapWriter,
    RawReport,
    RawWriter,
    RgbdRecording,
    Selection,
    ShuffledPoses,
    Subset,
    TruePoses,
    open_recording,
    poses,
)

CAMERA = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
N = 6


def mcap(folder: Path) -> FileRecording:
    rng = np.random.default_rng(0)
    T_base_cam = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
    with McapWriter(folder / "drive.mcap", CAMERA, T_base_cam) as writer:
        for i in range(N):
            left, right = rng.integers(0, 256, (2, *CAMERA.shape), dtype=np.uint8)
            T_odom_base = from_yaw(0.1 * i, [0.2 * i, 0, 0])
            T_world_cam = T_odom_base @ T_base_cam
            truth = Truth(from_yaw(0.01, [0, 0, 0.1]) @ T_world_cam)
            writer.write(Observation(0.1 * i, left, right, Odometry(T_odom_base), T_world_cam, truth))
    return open_recording(folder / "drive.mcap")


def raw(folder: Path) -> Recording:
    """Each picture and each report of the robot at a time of its own, through lenses that bend and a crooked mount."""
    rng = np.random.default_rng(2)
    turn = Rotation.from_rotvec([0.01, -0.02, 0.015]).as_matrix()
    K, distortion = CAMERA.K, np.array([-0.1, 0.02, 0.001, 0.0])
    rig = StereoCalibration((K, K), (distortion, distortion), from_rotation(turn, [-0.06, 0.001, 0]), (32, 24))
    with RawWriter(folder / "raw.mcap", rig, from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])) as writer:
        for i in range(N):
            writer.write_report(RawReport(0.1 * i, from_yaw(0.1 * i, [0.2 * i, 0, 0])))
            left, right = rng.integers(0, 256, (2, *CAMERA.shape), dtype=np.uint8)
            writer.write_pair(left, right, 0.1 * i + 0.03, 0.1 * i + 0.04)
    return open_recording(folder / "raw.mcap")


def kitti(folder: Path) -> Recording:
    rng = np.random.default_rng(1)
    for name in ("image_0", "image_1"):
        (folder / name).mkdir()
        for i in range(N):
            cv2.imwrite(str(folder / name / f"{i:06d}.png"), rng.integers(0, 256, (24, 32), dtype=np.uint8))
    np.savetxt(folder / "calib.txt", [P.ravel() for P in CAMERA.P])
    np.savetxt(folder / "poses.txt", [from_rotation(np.eye(3), [0, 0, 1.0 * i])[:3].ravel() for i in range(N)])
    return open_recording(folder)


def real(name: str) -> Callable[[Path], Recording]:
    """A maker of real data."""

    def opened(folder: Path) -> Recording:
        data = os.environ.get("STEREOGRID_DATA")
        if not data:
            pytest.skip(f"needs the data set sequences/{name}: set STEREOGRID_DATA to shared/data")
        return open_recording(Path(data) / "sequences" / name)

    return opened


def bag1(folder: Path) -> Recording:
    return open_recording(write_bag1(folder / "a.bag", drawn_drive()))


def bag2(folder: Path) -> Recording:
    return open_recording(write_bag2(folder / "a", drawn_drive()))


def bag2_mcap(folder: Path) -> Recording:
    return open_recording(write_bag2(folder / "a", drawn_drive(), "mcap"))


MAKERS: dict[str, Callable[[Path], Recording]] = {
    "mcap": mcap,
    "raw": raw,
    "kitti": kitti,
    "euroc": lambda folder: open_recording(write_euroc(folder)),
    "folder": lambda folder: open_recording(write_folder(folder)),
    "kitti_raw": lambda folder: open_recording(KittiDrive(n=N).write(folder)),
    "kitti_raw_extract": lambda folder: open_recording(KittiDrive(extract=True, n=N).write(folder)),
    "rgbd_tum": lambda folder: open_recording(write_tum(folder)),
    "rgbd_frames": lambda folder: RgbdRecording(write_frames(folder), noise_px=0.25),
    "real_kitti": real("kitti_straight"),
    "real_euroc": real("euroc_static"),
    "bag1": bag1,
    "bag2": bag2,
    "bag2_mcap": bag2_mcap,
    "true_poses": lambda folder: TruePoses(mcap(folder)),
    "selection": lambda folder: Selection(mcap(folder), 0.1, 0.4, 2),
    "subset": lambda folder: Subset(mcap(folder), 1, 6, 2),
    "shuffled": lambda folder: ShuffledPoses(mcap(folder), 7),
}
VIEWS = {"true_poses", "subset", "shuffled"}
"""Read in order alone."""


@pytest.fixture(scope="module", params=MAKERS)
def recording(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return MAKERS[request.param](tmp_path_factory.mktemp(request.param))


@pytest.fixture(scope="module")
def observations(recording: Recording) -> list[Observation]:
    return list(recording)


def test_it_obeys_the_protocol(recording: Recording) -> None:
    assert isinstance(recording, Recording)


def test_its_length_is_the_number_of_its_observations(recording: Recording, observations: list[Observation]) -> None:
    assert len(recording) == len(observations) > 0


def test_it_reads_the_same_a_second_time(recording: Recording, observations: list[Observation]) -> None:
    for first, second in zip(observations, recording, strict=True):
        assert first.stamp_s == second.stamp_s
        np.testing.assert_array_equal(first.left, second.left)
        np.testing.assert_array_equal(first.right, second.right)
        np.testing.assert_array_equal(first.T_world_cam, second.T_world_cam)


def test_two_readers_at_once_do_not_disturb_each_other(recording: Recording) -> None:
    for first, second in zip(recording, recording, strict=True):
        np.testing.assert_array_equal(first.left, second.left)


def test_stamps_strictly_increase(observations: list[Observation]) -> None:
    assert (np.diff([each.stamp_s for each in observations]) > 0).all()


def test_images_have_the_size_of_the_camera(recording: Recording, observations: list[Observation]) -> None:
    assert {each.left.shape for each in observations} == {recording.camera.shape}
    assert {each.right.shape for each in observations} == {recording.camera.shape}


def test_poses_are_rigid_and_the_odometry_gives_them(recording: Recording, observations: list[Observation]) -> None:
    as_pose(recording.T_base_cam)
    for each in observations:
        expected = as_pose(each.odometry.T_odom_base) @ recording.T_base_cam
        np.testing.assert_allclose(as_pose(each.T_world_cam), expected, atol=1e-6)


def test_the_way_travelled_never_shrinks(observations: list[Observation]) -> None:
    assert (np.diff([each.odometry.travelled_m for each in observations]) >= 0).all()
    assert (np.diff([each.odometry.turned_rad for each in observations]) >= 0).all()


def test_poses_without_images_are_those_of_the_observations(
    recording: Recording, observations: list[Observation]
) -> None:
    np.testing.assert_array_equal(poses(recording), [each.T_world_cam for each in observations])


@pytest.fixture(scope="module", params=[name for name in MAKERS if name not in VIEWS])
def file_recording(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> FileRecording:
    made = MAKERS[request.param](tmp_path_factory.mktemp(request.param))
    assert isinstance(made, FileRecording)
    return made


def test_its_folder_is_of_one_kind_alone(file_recording: FileRecording) -> None:
    assert len([name for name, kind in RECORDINGS.items() if kind.recognises(file_recording.path)]) == 1


def test_observations_can_be_read_by_number_in_any_order(file_recording: FileRecording) -> None:
    observations = list(file_recording)
    numbers = [len(file_recording) - 1, 0, len(file_recording) // 2]
    for number, read in zip(numbers, file_recording.read(numbers), strict=True):
        assert read.stamp_s == observations[number].stamp_s == file_recording.stamps_s[number]
        np.testing.assert_array_equal(read.left, observations[number].left)
        np.testing.assert_array_equal(read.T_world_cam, observations[number].T_world_cam)


def test_observations_carry_disparities_where_the_recording_says_so(file_recording: FileRecording) -> None:
    carried = {each.disparity is not None for each in file_recording}
    assert carried == {file_recording.has_disparity}
    assert Selection(file_recording, stride=2).has_disparity == file_recording.has_disparity


def test_true_poses_are_those_of_the_observations(file_recording: FileRecording) -> None:
    true = file_recording.true_poses()
    expected = [each.truth.T_world_cam for each in file_recording if each.truth is not None]
    assert (true is None) == (not expected)
    if true is not None:
        np.testing.assert_allclose(true[~np.isnan(true).any(axis=(1, 2))], expected, atol=1e-9)


def test_a_part_in_time_holds_what_lies_in_it(file_recording: FileRecording) -> None:
    observations = list(file_recording)
    first_s = observations[0].stamp_s
    middle_s = observations[len(observations) // 2].stamp_s - first_s
    part = Selection(file_recording, middle_s, None, 2)
    expected = [each for each in observations if each.stamp_s - first_s >= middle_s][::2]
    assert [each.stamp_s for each in part] == [each.stamp_s for each in expected]
    np.testing.assert_array_equal(poses(part), [each.T_world_cam for each in expected])
