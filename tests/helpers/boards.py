"""Checked boards: their corners are where geometry puts them."""

import cv2
import numpy as np

from sim.scene.scene import Lamp, World
from sim.scene.solids import Paint, box
from sim.scene.textures import Texture
from stereogrid.geometry import FloatArray, from_rotation, from_yaw

SQUARES = 8
HALF_M = 0.8
FRONT_M = -0.05
"""A board faces -x in its own frame, from which the robot looks at it."""


def board_world(T_world_board: FloatArray) -> World:
    side = 1024 // SQUARES
    checks = np.kron(np.indices((SQUARES, SQUARES)).sum(axis=0) % 2, np.ones((side, side)))
    texture = Texture((60 + 150 * checks).astype(np.uint8), glows=True)
    solid = box(
        "board",
        (FRONT_M, -HALF_M, -HALF_M),
        (0.0, HALF_M, HALF_M),
        Paint("checks", fit=True),
        T_world_box=T_world_board,
    )
    lamps = (Lamp((0.0, 0.0, 2.5), (0.5, 0.5)),)
    return World("board", 0, (solid,), {"checks": texture}, lamps, np.array([[0.0, 0.0], [1.0, 0.0]]))


def tilted(distance_m: float, yaw: float) -> FloatArray:
    pitch = cv2.Rodrigues(np.array([0.0, 0.3, 0.0]))[0]
    return from_yaw(yaw, [distance_m, 0.1, 0.45]) @ from_rotation(pitch)
