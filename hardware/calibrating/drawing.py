"""What the page shows of the cameras' pictures: the corners that are found, and what of the picture has been seen."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from stereogrid.calibration import Chessboard
from stereogrid.geometry import FloatArray
from stereogrid.observation import Image

from .session import CalibrationSession
from .sight import TILES, Sight

GREEN, ORANGE = (60, 170, 60), (30, 140, 240)
"""BGR."""
VEIL = 0.3
Picture = NDArray[np.uint8]


class Drawing:
    """Draws pairs for a session; keeps what the boards taken so far cover. size_px: (width, height)."""

    def __init__(self, session: CalibrationSession, size_px: tuple[int, int]) -> None:
        self._session = session
        self._size_px = size_px
        self._covered = tuple(np.zeros(size_px[::-1], bool) for _ in "lr")
        self._counted = 0

    def draw(self, pair: tuple[Image, Image], sight: Sight) -> tuple[Picture, Picture]:
        """Both pictures (H, W, 3) BGR: green what has been covered, orange where the board should go next."""
        self._cover()
        tiles = [goal.tile for goal in self._session.next_goals if goal.tile is not None]
        left, right = (
            self._draw_one(image, corners, covered, tiles)
            for image, corners, covered in zip(pair, sight.corners, self._covered, strict=True)
        )
        return left, right

    def _cover(self) -> None:
        """Bring the covered parts up to date with the pairs taken."""
        taken = self._session.taken
        if len(taken) < self._counted:
            for covered in self._covered:
                covered[:] = False
            self._counted = 0
        for sight in taken[self._counted :]:
            for corners, covered in zip(sight.seen or (), self._covered, strict=True):
                covered |= _outlined(corners, sight.board, covered.shape)
        self._counted = len(taken)

    def _draw_one(
        self, image: Image, corners: FloatArray | None, covered: NDArray[np.bool_], tiles: Sequence[tuple[int, int]]
    ) -> Picture:
        shown = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
        shown[covered] = (1 - VEIL) * shown[covered] + VEIL * np.array(GREEN)
        width, height = self._size_px
        line = max(1, width // 320)
        for row, column in tiles:
            x, y = width * column // TILES, height * row // TILES
            far = (x + width // TILES - line, y + height // TILES - line)
            cv2.rectangle(shown, (x + line, y + line), far, ORANGE, 2 * line)
        if corners is not None:
            board = self._session.board
            cv2.drawChessboardCorners(
                shown, (board.columns, board.rows), corners.astype(np.float32).reshape(-1, 1, 2), True
            )
        return np.asarray(shown, np.uint8)


def _outlined(corners: FloatArray, board: Chessboard, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """The pixels (H, W) within a board's outer inner corners."""
    n, m = board.columns, board.rows
    around = corners[[0, n - 1, n * m - 1, n * (m - 1)]]
    filled = cv2.fillConvexPoly(np.zeros(shape, np.uint8), np.round(around).astype(np.int32), 1)
    return np.asarray(filled, bool)
