"""Small synthetic drives, as observations, as MCAP files and as KITTI folders."""

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.observation import Observation, Odometry, Truth
from stereogrid.recording.mcap import McapWriter

CAMERA = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
T_BASE_CAM = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])


def make_observations(n: int, *, truth: bool = True, start_s: float = 1_700_000_000.123456789) -> list[Observation]:
    rng = np.random.default_rng(3)
    made = []
    for i in range(n):
        left, right = rng.integers(0, 256, (2, *CAMERA.shape), dtype=np.uint8)
        T_odom_base = from_yaw(0.1 * i, [0.2 * i, 0.01 * i * i, 0])
        T_world_cam = T_odom_base @ T_BASE_CAM
        true_pose = from_yaw(0.02, [0, 0.1, 0]) @ T_world_cam
        depth_m = rng.uniform(0.5, 9, CAMERA.shape).astype(np.float32)
        depth_m[:4] = np.nan
        movers = {"walker": from_yaw(0.3 * i, [i, 1, 0]), "trolley": from_yaw(0.0, [0, i, 0])}
        known = Truth(true_pose, depth_m, movers) if truth else None
        made.append(Observation(start_s + i / 7, left, right, Odometry(T_odom_base), T_world_cam, known))
    return made


def write_mcap(path: Path, observations: list[Observation], **options: object) -> Path:
    with McapWriter(path, CAMERA, T_BASE_CAM, **options) as writer:  # type: ignore[arg-type]
        for each in observations:
            for tick in ticks_of(each):
                writer.write_tick(*tick)
            writer.write(each)
    return path


def ticks_of(observation: Observation) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Three ticks up to an observation with a truth: as a simulator has them."""
    if observation.truth is None:
        return []
    T = observation.truth.T_world_cam
    stamps_s = observation.stamp_s - np.array([0.1, 0.05, 0.0])
    return [(float(stamp_s), T, np.array([1.0, 2.0]) * k) for k, stamp_s in enumerate(stamps_s)]


def write_kitti(folder: Path, n: int = 4, names: tuple[str, str] = ("image_0", "image_1")) -> Path:
    rng = np.random.default_rng(4)
    for name in names:
        (folder / name).mkdir(parents=True)
        for i in range(n):
            cv2.imwrite(str(folder / name / f"{i:06d}.png"), rng.integers(0, 256, (24, 32), dtype=np.uint8))
    P = [np.array(P) for P in CAMERA.P]
    (folder / "calib.txt").write_text("".join(f"P{i}: {row(P[i % 2])}\n" for i in range(4)) + "Tr: 1 2 3\n")
    # One metre forward, that is, along z, and ten centimetres down, along y, an image.
    poses = [from_rotation(np.eye(3), [0, 0.1 * i, 1.0 * i])[:3] for i in range(n)]
    (folder / "poses.txt").write_text("".join(f"{row(T)}\n" for T in poses))
    return folder


def row(matrix: np.ndarray) -> str:
    return " ".join(f"{number:.12e}" for number in matrix.ravel())


@pytest.fixture(scope="session")
def synthetic() -> SimpleNamespace:
    """The makers above; tests are imported one by one, so they cannot import them."""
    return SimpleNamespace(
        camera=CAMERA,
        T_base_cam=T_BASE_CAM,
        observations=make_observations,
        write_mcap=write_mcap,
        ticks_of=ticks_of,
        write_kitti=write_kitti,
        row=row,
    )


@pytest.fixture
def mcap_file(tmp_path: Path) -> Path:
    return write_mcap(tmp_path / "drive.mcap", make_observations(5))


@pytest.fixture
def kitti_folder(tmp_path: Path) -> Path:
    return write_kitti(tmp_path / "kitti")
