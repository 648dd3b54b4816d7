"""The chessboard that cameras are calibrated with, and its corners in an image."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..errors import InvalidInputError
from ..geometry import FloatArray
from ..observation import Image

_REFINED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-4)


@dataclass(frozen=True)
class Chessboard:
    """columns x rows inner corners, where four squares meet; square_m: side of a square [m]."""

    columns: int = 9
    rows: int = 6
    square_m: float = 0.025

    def __post_init__(self) -> None:
        for name in ("columns", "rows"):
            if getattr(self, name) < 3:
                raise InvalidInputError(
                    f"a chessboard needs at least 3 {name} of inner corners, not {getattr(self, name)}"
                )
        if not (np.isfinite(self.square_m) and self.square_m > 0):
            raise InvalidInputError(f"square_m must be positive and finite, not {self.square_m}")

    def __str__(self) -> str:
        return f"{self.columns}x{self.rows} inner corners"

    @cached_property
    def corners_m(self) -> FloatArray:
        """(columns * rows, 3) [m], row after row; x along a row, y from row to row, z = 0."""
        row, column = np.mgrid[: self.rows, : self.columns]
        flat = np.column_stack([column.ravel(), row.ravel(), np.zeros(row.size)])
        corners: FloatArray = flat * self.square_m
        return corners


def find_corners(image: Image, board: Chessboard) -> FloatArray | None:
    """The inner corners (columns * rows, 2) [px] in an image (H, W) uint8, row after row; None when none is whole.

    Pixel centres are at integers. The first corner is the one from which rows run to the right, or down.
    """
    # OpenCV's fast check sees no board in every other picture of 320 x 240, and saves time on noise alone.
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(image, (board.columns, board.rows), flags=flags)
    if not found:
        return None
    grid = corners.reshape(board.rows, board.columns, 2)
    # A window that reaches the next corner would be drawn to it.
    sides = np.concatenate([np.linalg.norm(np.diff(grid, axis=a), axis=-1).ravel() for a in (0, 1)])
    half = int(np.clip(0.35 * sides.min(), 2, 11))
    refined = cv2.cornerSubPix(image, corners.astype(np.float32), (half, half), (-1, -1), _REFINED)
    placed: FloatArray = refined.reshape(-1, 2).astype(np.float64)
    # Where a row runs left, count from the other end.
    along = placed[board.columns - 1] - placed[0]
    return placed[::-1].copy() if along[0] + 0.5 * along[1] < 0 else placed


def find_corners_of_pair(pair: tuple[Image, Image], board: Chessboard) -> tuple[FloatArray | None, FloatArray | None]:
    """find_corners of the left and the right image, counted from the same corner of the board."""
    left, right = (find_corners(image, board) for image in pair)
    if left is not None and right is not None:
        along_left, along_right = (corners[board.columns - 1] - corners[0] for corners in (left, right))
        # A board near the angle at which the count turns round must not be turned in one of them alone.
        if along_left @ along_right < 0:
            right = right[::-1].copy()
    return left, right
