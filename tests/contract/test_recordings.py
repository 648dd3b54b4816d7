"""What every recording obeys, whatever its format."""

import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stereogrid.calibration import StereoCalibration
from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, as_pose, from_rotation, from_yaw
from stereogrid.observation import Observation, Odometry, Recording, Truth
from stereogrid.recording import (
    McapWriter,
    RawReport,
    RawWriter,
    ShuffledPoses,
    Subset,
    TruePoses,
    open_recording,
    poses,
)

CAMERA = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
N = 6


def mcap(folder: Path) -> Recording:
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


def real_kitti(folder: Path) -> Recording:
    data = os.environ.get("STEREOGRID_DATA")
    if not data:
        pytest.skip("needs the data set sequences/kitti_straight: set STEREOGRID_DATA to shared/data")
    return open_recording(Path(data) / "sequences" / "kitti_straight")


MAKERS: dict[str, Callable[[Path], Recording]] = {
    "mcap": mcap,
    "raw": raw,
    "kitti": kitti,
    "real_kitti": real_kitti,
    "true_poses": lambda folder: TruePoses(mcap(folder)),
    "subset": lambda folder: Subset(mcap(folder), 1, 6, 2),
    "shuffled": lambda folder: ShuffledPoses(mcap(folder), 7),
}


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
