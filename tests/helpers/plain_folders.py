"""Plain folders of left and right pictures, a calibration and a trajectory."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from stereogrid.calibration import StereoCalibration, save_calibration
from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.trajectory import save_tum

CAMERA = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
MOUNT = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
RIG = StereoCalibration(
    (CAMERA.K, CAMERA.K),
    (np.array([-0.1, 0.02, 0.001, 0.0]),) * 2,
    from_rotation(cv2.Rodrigues(np.array([0.01, -0.02, 0.015]))[0], [-0.06, 0.001, 0]),
    (32, 24),
)
N = 6
CAMERA_TOML = "focal_px = 40.0\ncx_px = 15.5\ncy_px = 11.5\nbaseline_m = 0.06\n"
MOUNT_TOML = "[mount]\nx_m = 0.1\ny_m = 0.03\nz_m = 0.4\n"
STAMPS_S = 1000.0 + 0.1 * np.arange(N)
T_WORLD_BASE = np.stack([from_yaw(0.1 * i, [0.2 * i, 0, 0]) for i in range(N)])


def image(number: int) -> np.ndarray:
    """(24, 32), another for each number."""
    return np.random.default_rng(number).integers(0, 256, (24, 32), dtype=np.uint8)


def write_pictures(folder: Path, names: tuple[Sequence[str], Sequence[str]]) -> None:
    """The left ones are image(0), image(1), ..., the right ones image(100), ..."""
    for side, of_side in enumerate(names):
        for number, name in enumerate(of_side):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(folder / name), image(100 * side + number))


def write_folder(folder: Path) -> Path:
    """left/ and right/ counted, rig.toml with a mount, trajectory.txt of the left camera."""
    names = [[f"{side}/{i:03d}.png" for i in range(N)] for side in ("left", "right")]
    write_pictures(folder, (names[0], names[1]))
    save_calibration(RIG, folder / "rig.toml", T_base_cam=MOUNT)
    save_tum(folder / "trajectory.txt", STAMPS_S, T_WORLD_BASE @ MOUNT)
    return folder


def write_rectified(folder: Path, names: tuple[Sequence[str], Sequence[str]]) -> Path:
    """Pictures of these names, camera.toml and trajectory.txt of the left camera."""
    write_pictures(folder, names)
    (folder / "camera.toml").write_text(CAMERA_TOML)
    save_tum(folder / "trajectory.txt", STAMPS_S, T_WORLD_BASE @ MOUNT)
    return folder
