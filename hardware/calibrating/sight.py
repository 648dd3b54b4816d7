"""What one raw pair shows of the board: where, how near, how tilted, how sharp."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from stereogrid.calibration import Chessboard, find_corners_of_pair
from stereogrid.calibration.residuals import board_pose
from stereogrid.geometry import FloatArray, as_floats
from stereogrid.observation import Image

from ..cameras.pairs import RawPair

TILES = 3
"""The picture is so many tiles wide and high, for telling a person where the board is to go."""
FOCAL_OF_WIDTH = 1.1
"""Of a webcam, roughly: tilts are only told apart by it, never measured."""


@dataclass(frozen=True, eq=False)
class Sight:
    """corners (N, 2) [px] in the left and the right picture, None where the whole board is not seen; size_px (width,
    height); edge_px: over how many pixels the board's edges rise, NaN where that cannot be told."""

    board: Chessboard
    size_px: tuple[int, int]
    stamp_s: float
    skew_s: float
    corners: tuple[FloatArray | None, FloatArray | None]
    edge_px: float = np.nan

    @property
    def seen(self) -> tuple[FloatArray, FloatArray] | None:
        """The corners, where both cameras see the board."""
        left, right = self.corners
        return None if left is None or right is None else (left, right)

    @cached_property
    def in_tiles(self) -> FloatArray:
        """(TILES, TILES): corners in each part of the pictures, row by row, in the one that has fewer there."""
        counts = []
        for corners in self.seen or ():
            tiles = np.clip(np.floor(corners / self.size_px * TILES), 0, TILES - 1).astype(int)
            count = np.zeros((TILES, TILES))
            np.add.at(count, (tiles[:, 1], tiles[:, 0]), 1)
            counts.append(count)
        return np.min(counts, axis=0) if counts else np.zeros((TILES, TILES))

    @cached_property
    def share(self) -> float:
        """What the corners span of the left picture's width or height, whichever is more."""
        left, _ = self.corners
        return 0.0 if left is None else float((np.ptp(left, axis=0) / self.size_px).max())

    @cached_property
    def normal(self) -> FloatArray:
        """(3,) of the board in the left optical frame, away from the camera; x > 0: its right edge is the nearer one,
        y > 0: its lower edge. Roughly, since the focal length is not known yet."""
        left, _ = self.corners
        if left is None:
            return as_floats([0.0, 0.0, 1.0])
        width, height = self.size_px
        focal_px = FOCAL_OF_WIDTH * width
        K = np.array([[focal_px, 0, (width - 1) / 2], [0, focal_px, (height - 1) / 2], [0, 0, 1]])
        away = board_pose(K, np.zeros(5), left, self.board)[:3, 2]
        normal: FloatArray = away if away[2] >= 0 else -away
        return normal

    def moved_px(self, other: "Sight") -> float:
        """How far the corners are from where they were, in the mean, in the picture where that is more."""
        if self.seen is None or other.seen is None:
            return np.inf
        return max(float(np.linalg.norm(a - b, axis=1).mean()) for a, b in zip(self.seen, other.seen, strict=True))

    def turned_deg(self, other: "Sight") -> float:
        """The angle between the boards' planes."""
        return float(np.degrees(np.arccos(np.clip(self.normal @ other.normal, -1, 1))))


def look(pair: RawPair, board: Chessboard) -> Sight:
    """Look for the board in a raw pair."""
    corners = find_corners_of_pair((pair.left, pair.right), board)
    height, width = pair.left.shape
    edges = [_edge_px(image, each, board) for image, each in zip((pair.left, pair.right), corners, strict=True)]
    known = [edge for edge in edges if np.isfinite(edge)]
    return Sight(board, (width, height), pair.stamp_s, pair.skew_s, corners, max(known, default=np.nan))


def _edge_px(image: Image, corners: FloatArray | None, board: Chessboard) -> float:
    """The wider of the board's edges along the rows and the columns [px]."""
    if corners is None:
        return np.nan
    size, placed = (board.columns, board.rows), corners.astype(np.float32).reshape(-1, 1, 2)
    widths = [cv2.estimateChessboardSharpness(image, size, placed, vertical=v)[0][0] for v in (False, True)]
    # OpenCV says 9999 of squares that are too small to tell.
    return max((width for width in widths if width < 1000), default=np.nan)
