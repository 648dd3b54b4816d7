"""A rig whose raw pictures are bent and turned, and what it sees of a wall whose every point is known."""

import numpy as np
from scipy.spatial.transform import Rotation

from stereogrid.calibration import StereoCalibration
from stereogrid.geometry import FloatArray, from_rotation
from stereogrid.observation import Image

SIZE_PX = (160, 120)
DISPARITY_PX = 7.0


def crooked_rig() -> StereoCalibration:
    """Two different cameras, 6 cm apart, turned against each other by two degrees."""
    K = np.array([[170.0, 0, 77.0], [0, 171.0, 61.0], [0, 0, 1]]), np.array([[173.0, 0, 82], [0, 172.0, 58], [0, 0, 1]])
    distortion = np.array([-0.18, 0.05, 0.001, -0.002]), np.array([-0.15, 0.03, -0.001, 0.001, 0.002])
    turn = Rotation.from_rotvec(np.radians([0.8, -1.5, 1.0])).as_matrix()
    return StereoCalibration(K, distortion, from_rotation(turn, [-0.06, 0.0015, -0.001]), SIZE_PX)


def wall(column: FloatArray, row: FloatArray) -> FloatArray:
    """What is seen at places of the left rectified picture: smooth, so that looking between pixels costs little."""
    return 128 + 55 * np.sin(column / 6.0 + row / 17.0) + 50 * np.cos(row / 5.0 - column / 23.0)


def ideal_pair() -> tuple[FloatArray, FloatArray]:
    """The wall as ideal cameras see it, (H, W) each."""
    column, row = np.meshgrid(np.arange(SIZE_PX[0], dtype=float), np.arange(SIZE_PX[1], dtype=float))
    return wall(column, row), wall(column + DISPARITY_PX, row)


def straight(x_bent: FloatArray, y_bent: FloatArray, distortion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where rays (N,) come from that a lens bends to these places: Brown's equations, solved by iteration."""
    k1, k2, p1, p2, k3 = np.pad(distortion, (0, 5 - distortion.size))
    x, y = x_bent, y_bent
    for _ in range(60):
        r2 = x**2 + y**2
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        x, y = (
            (x_bent - 2 * p1 * x * y - p2 * (r2 + 2 * x**2)) / radial,
            (y_bent - p1 * (r2 + 2 * y**2) - 2 * p2 * x * y) / radial,
        )
    return x, y


def raw_pair(rig: StereoCalibration) -> tuple[Image, Image]:
    """The wall as this rig sees it: each raw pixel looks along its own ray, by the lens' equations alone."""
    rectification = rig.rectification()
    R_left = rectification.R_rect_left
    turns = R_left, R_left @ rig.T_right_left[:3, :3].T
    column, row = np.meshgrid(np.arange(SIZE_PX[0], dtype=float), np.arange(SIZE_PX[1], dtype=float))
    pictures = []
    for K, distortion, turn, shift in zip(rig.K, rig.distortion, turns, (0.0, DISPARITY_PX), strict=True):
        x, y = straight((column.ravel() - K[0, 2]) / K[0, 0], (row.ravel() - K[1, 2]) / K[1, 1], distortion)
        rectified = np.column_stack([x, y, np.ones_like(x)]) @ turn.T @ rectification.camera.K.T
        places = rectified[:, :2] / rectified[:, 2:]
        seen = wall(places[:, 0] + shift, places[:, 1]).reshape(SIZE_PX[::-1])
        pictures.append(np.round(seen).astype(np.uint8))
    return pictures[0], pictures[1]
