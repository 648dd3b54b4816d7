"""Small RGB-D folders of a textured wall with a box before it, in TUM's and 7-Scenes' layouts."""

from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

SIZE_PX = (96, 72)
K = np.array([[80.0, 0, 47.5], [0, 80.0, 35.5], [0, 0, 1]])
WALL_M, BOX_M = 2.0, 1.0
BOX = (slice(24, 48), slice(36, 60))
"""Rows and columns."""
UNKNOWN = (slice(0, 4), slice(10, 20))


def depth_m() -> np.ndarray:
    """What the depth camera sees (H, W) [m]: NaN where it measures nothing."""
    depth = np.full(SIZE_PX[::-1], WALL_M)
    depth[BOX] = BOX_M
    depth[UNKNOWN] = np.nan
    return depth


def colour(k: int) -> np.ndarray:
    """(H, W, 3) BGR, with a texture that a matcher can hold on to."""
    grey = cv2.GaussianBlur(np.random.default_rng(k).integers(0, 256, SIZE_PX[::-1], dtype=np.uint8), (0, 0), 0.8)
    return np.stack([grey, grey // 2, grey], axis=2)


def depth_numbers(per_m: float, unknown: int = 0) -> np.ndarray:
    """The depth image's numbers (H, W) uint16."""
    return np.nan_to_num(depth_m() * per_m, nan=unknown).round().astype(np.uint16)


def world_poses(n: int) -> np.ndarray:
    """T_world_cam (n, 4, 4) in a world with z up: a camera, 1.2 m high, that looks down by 25 degrees and turns."""
    T = np.tile(np.eye(4), (n, 1, 1))
    optical = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    wobble_rad = 0.04 * np.sin(np.arange(n) * 2.4)
    for k in range(n):
        body = Rotation.from_euler("ZYX", [0.25 * k - 0.5, np.radians(25), wobble_rad[k]])
        T[k, :3, :3], T[k, :3, 3] = (body * optical).as_matrix(), [0.1 * k, 0.02 * k, 1.2]
    return T


def write_tum(folder: Path, n: int = 5, lens: str | None = "80 80 47.5 35.5") -> Path:
    """TUM's layout: colours every 33 ms, depths 4 ms later, the trajectory at 100 Hz; poses of world_poses."""
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    lists: dict[str, list[str]] = {"rgb": ["# color images", "# timestamp filename"], "depth": ["# depth maps"]}
    for k in range(n):
        for name, after_s in (("rgb", 0.0), ("depth", 0.004)):
            stamp = f"{1305031102.175304 + k / 30 + after_s:.6f}"
            cv2.imwrite(str(folder / name / f"{stamp}.png"), colour(k) if name == "rgb" else depth_numbers(5000))
            lists[name].append(f"{stamp} {name}/{stamp}.png")
    for name, lines in lists.items():
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    poses = world_poses(10)
    rows = ["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw"]
    for k, T in enumerate(poses):
        quaternion = Rotation.from_matrix(T[:3, :3]).as_quat()
        numbers = " ".join(f"{number:.6f}" for number in [*T[:3, 3], *quaternion])
        rows.append(f"{1305031102.10 + 0.05 * k:.4f} {numbers}")
    (folder / "groundtruth.txt").write_text("\n".join(rows) + "\n")
    if lens is not None:
        (folder / "calibration.txt").write_text(lens + "\n")
    return folder


def write_frames(folder: Path, n: int = 6, colours: bool = True) -> Path:
    """7-Scenes' layout: poses of world_poses in a world that is turned anyhow."""
    folder.mkdir(parents=True, exist_ok=True)
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_rotvec([1.2, -0.3, 0.8]).as_matrix()
    for k, T in enumerate(turned @ world_poses(n)):
        place = folder / f"frame-{10 * k:06d}"
        cv2.imwrite(f"{place}.depth.png", depth_numbers(1000, unknown=65535 if k % 2 else 0))
        if colours:
            cv2.imwrite(f"{place}.color.png", colour(k))
        np.savetxt(f"{place}.pose.txt", T, fmt="%.6f")
    np.savetxt(folder / "camera-intrinsics.txt", K)
    return folder
