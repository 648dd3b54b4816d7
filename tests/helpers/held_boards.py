"""A chessboard held before two cameras of a known kind: exact corners, and pictures of them, drawn at once."""

from functools import cache

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from hardware.calibrating.session import CalibrationSession
from hardware.calibrating.sight import Sight
from stereogrid.calibration import Chessboard
from stereogrid.geometry import FloatArray, as_floats, from_rotation, transform
from stereogrid.observation import Image

BOARD = Chessboard(9, 6, 0.03)
SIZE_PX = (320, 240)
FOCAL_PX, BASELINE_M = 330.0, 0.06
K = as_floats([[FOCAL_PX, 0, 160.5], [0, FOCAL_PX, 118.0], [0, 0, 1]])
T_RIGHT_LEFT = from_rotation(Rotation.from_rotvec([0.004, -0.006, 0.005]).as_matrix(), [-BASELINE_M, 0.0003, -0.0005])
TEXELS_A_SQUARE = 24
PAPER, INK = 210, 35


def pose(at: tuple[float, float], share: float, tilt_deg: tuple[float, float] = (0.0, 0.0)) -> FloatArray:
    """T_left_board (4, 4): the board's middle at (x, y) of the left picture, 0 to 1; its corners span `share` of the
    width or height; tilt_deg: > 0 brings the right edge, and the lower one, nearer."""
    size_m = np.array([BOARD.columns - 1, BOARD.rows - 1]) * BOARD.square_m
    distance_m = float((FOCAL_PX * size_m / SIZE_PX).max() / share)
    turn = Rotation.from_euler("yx", [tilt_deg[0], -tilt_deg[1]], degrees=True).as_matrix()
    ray = np.append((np.array(at) * SIZE_PX - K[:2, 2]) / FOCAL_PX, 1.0)
    return from_rotation(turn, distance_m * ray - turn @ BOARD.corners_m.mean(axis=0))


def corners_px(T_left_board: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The corners (N, 2) in the left and the right picture."""
    left, right = (_project(transform(T @ T_left_board, BOARD.corners_m)) for T in (np.eye(4), T_RIGHT_LEFT))
    return left, right


def pictures(T_left_board: FloatArray | None, blur_px: float = 0.7) -> tuple[Image, Image]:
    """The left and the right picture; of a wall, without a board."""
    if T_left_board is None:
        return _drawn(None, blur_px), _drawn(None, blur_px)
    return _drawn(T_left_board, blur_px), _drawn(T_RIGHT_LEFT @ T_left_board, blur_px)


def is_in_view(T_left_board: FloatArray, margin_px: float = 6.0) -> bool:
    """Whether both cameras see the board's squares, and some of the white around them."""
    s, (x, y, _) = BOARD.square_m, BOARD.corners_m.max(axis=0)
    rim = np.array([[a, b, 0.0] for a in (-s, x + s) for b in (-s, y + s)])
    seen = np.concatenate([_project(transform(T @ T_left_board, rim)) for T in (np.eye(4), T_RIGHT_LEFT)])
    return bool((seen >= margin_px).all() and (seen <= np.array(SIZE_PX) - 1 - margin_px).all())


def pose_in_view(at: tuple[float, float], share: float, tilt_deg: tuple[float, float] = (0.0, 0.0)) -> FloatArray:
    """pose, or the next one towards the middle of both pictures that both cameras see, smaller if need be."""
    for step in np.linspace(0, 1, 51):
        x, y = np.array(at) * (1 - step) + np.array([0.55, 0.5]) * step
        T = pose((float(x), float(y)), share, tilt_deg)
        if is_in_view(T):
            return T
    return pose_in_view(at, 0.9 * share, tilt_deg)


def follow(session: CalibrationSession, rng: np.random.Generator) -> FloatArray:
    """The pose, T_left_board (4, 4), that a person shows who does as the session says, about."""
    at, share, tilt = rng.uniform(0.4, 0.6, 2), 0.45, rng.uniform(-10, 10, 2)
    for goal in session.next_goals:
        if goal.tile is not None:
            at, share = (np.array(goal.tile)[::-1] + 0.5) / 3 + rng.uniform(-0.02, 0.02, 2), 0.3
        elif goal.name == "near":
            at, share = np.clip(at, 0.45, 0.55), 0.62
        elif goal.name == "far":
            share = 0.3
        elif goal.name.endswith("nearer"):
            ways = {"right": (1, 0), "left": (-1, 0), "lower": (0, 1), "upper": (0, -1)}
            tilt = rng.uniform(25, 35) * np.array(ways[goal.name.split()[0]])
        else:
            tilt, share = rng.uniform(-30, 30, 2), rng.uniform(0.35, 0.6)
    return pose_in_view((float(at[0]), float(at[1])), share, (float(tilt[0]), float(tilt[1])))


def exact_sight(T_left_board: FloatArray, stamp_s: float = 0.0, *, skew_s: float = 0.0, edge_px: float = 2.5) -> Sight:
    """What is seen of a board, without the error of finding it."""
    return Sight(BOARD, SIZE_PX, stamp_s, skew_s, corners_px(T_left_board), edge_px)


def followed_poses(seed: int, extra: int = 4) -> list[FloatArray]:
    """The poses that a person shows who does as a session says until it is content; and some more."""
    rng, session = np.random.default_rng(seed), CalibrationSession(BOARD)
    poses: list[FloatArray] = []
    while extra:
        extra -= session.complete
        poses.append(follow(session, rng))
        for k in range(6):
            session.consider(exact_sight(poses[-1], 2.0 * len(poses) + k / 10))
    return poses


def _project(points: FloatArray) -> FloatArray:
    seen = points @ K.T
    return seen[:, :2] / seen[:, 2:]


@cache
def _print() -> Image:
    """The board with a white rim of one square; its texel (0, 0) is two squares above and left of the first corner."""
    rows, columns = np.indices((BOARD.rows + 3, BOARD.columns + 3))
    inside = (rows > 0) & (rows < BOARD.rows + 2) & (columns > 0) & (columns < BOARD.columns + 2)
    squares = np.where(inside & ((rows + columns) % 2 == 0), INK, PAPER).astype(np.uint8)
    return np.kron(squares, np.ones((TEXELS_A_SQUARE, TEXELS_A_SQUARE), np.uint8))


def _drawn(T_cam_board: FloatArray | None, blur_px: float) -> Image:
    finer = 4
    width, height = SIZE_PX
    wall = np.full((height * finer, width * finer), 120, np.uint8)
    if T_cam_board is not None:
        # From texels to metres on the board; centres are at integers in texels and in pixels.
        scale = BOARD.square_m / TEXELS_A_SQUARE
        offset = 0.5 * scale - 2 * BOARD.square_m
        on_board = np.array([[scale, 0, offset], [0, scale, offset], [0, 0, 1]])
        to_finer = np.array([[finer, 0, (finer - 1) / 2], [0, finer, (finer - 1) / 2], [0, 0, 1]])
        H = to_finer @ K @ T_cam_board[:3, [0, 1, 3]] @ on_board
        cv2.warpPerspective(_print(), H, wall.shape[::-1], wall, cv2.INTER_AREA, cv2.BORDER_TRANSPARENT)
    small = cv2.resize(wall, SIZE_PX, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), blur_px), np.uint8)
