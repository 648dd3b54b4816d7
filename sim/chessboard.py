"""The virtual rig looks at a virtual chessboard: raw pairs to calibrate from, and the calibration that is true."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from stereogrid.calibration import Chessboard, StereoCalibration
from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.files import make_folder, written_beside
from stereogrid.geometry import R_BASE_OPTICAL, FloatArray, from_rotation, inverse, transform
from stereogrid.observation import Image
from stereogrid.recording.images import encode_png

from .faults import CameraFaults, FaultyPair, camera_faults
from .faults.optics import Lens
from .faults.streams import LEFT, RIGHT
from .faults.tone import AutoExposure
from .rendering.render import Renderer
from .rig import MINORU, StereoRig
from .scene import textures as paint
from .scene.scene import World
from .scene.solids import Paint, box
from .scene.textures import Texture

CLOSE, FAR = (0.8, 0.6), (0.55, 0.4)
"""Share of the picture's width or height that the board fills: in every other view much, or little, where it fits
into a corner."""
TILT_DEG, ROLL_DEG = 40.0, 20.0
MARGIN_PX = 8.0
"""How far the board stays from the picture's edges."""
HEIGHT_M = 1.2
INK, PAPER = 0.2, 0.92
TEXELS = (1024, 2048)


@dataclass(frozen=True)
class ChessboardSession:
    """Somebody holds a chessboard still before the rig, count times.

    camera: of each raw sensor, and the baseline. faults: of the cameras; those of time do not matter, since the board
    is held still, and no picture is lost. seed: of the poses, the faults and the room.
    """

    board: Chessboard = field(default_factory=Chessboard)
    faults: CameraFaults = field(default_factory=lambda: camera_faults("minoru"))
    seed: int = 0
    count: int = 18
    camera: StereoCamera = MINORU

    def __post_init__(self) -> None:
        if not 1 <= self.count <= 99:
            raise InvalidInputError(f"count must be 1 to 99 pairs, not {self.count}")
        if self.seed < 0:
            raise InvalidInputError(f"seed must be >= 0, not {self.seed}")

    def pairs(self) -> Iterator[tuple[Image, Image]]:
        """The raw pairs (H, W) uint8, as the cameras send them."""
        left, right = self._lenses
        cameras = FaultyPair(self.camera, self.faults.still, self.seed, (left, right))
        renderer, rig = Renderer(board_world(self.board, self.seed)), StereoRig(left.scene)
        for index, T_cam_board in enumerate(self.poses()):
            T_world_cam = T_WORLD_BOARD @ inverse(T_cam_board)
            clean = tuple(renderer.view(left.scene, T).gray for T in (T_world_cam, rig.right_of(T_world_cam)))
            gains = AutoExposure(self.faults.auto_exposure).gains((clean[LEFT], clean[RIGHT]), 0.0)
            yield cameras.raw((clean[LEFT], clean[RIGHT]), index, gains)

    def poses(self) -> Iterator[FloatArray]:
        """T_cam_board (4, 4) of each view: the whole board is in both pictures, and in all parts of them in turn."""
        rng = np.random.default_rng([self.seed, 0])
        parts = [(x, y) for y in (0.2, 0.8, 0.5) for x in (0.25, 0.75, 0.5)]
        for index in range(self.count):
            near, far = CLOSE if index % 2 else FAR
            while True:
                part = np.array(parts[(index // 2) % len(parts)]) + rng.uniform(-0.1, 0.1, 2)
                T_cam_board = self._pose(part, rng, self._filling_m / rng.uniform(far, near))
                if self._is_in_view(T_cam_board):
                    yield T_cam_board
                    break
                # A board that is near does not fit into every part of the picture.
                far *= 0.98

    def truth(self) -> StereoCalibration:
        """What a perfect calibration of these cameras would find."""
        K, distortion = self.camera.K, np.array([self.faults.distortion_k1, 0.0, 0.0, 0.0, 0.0])
        R_right_left = self._lenses[RIGHT].R_scene_raw.T
        T_right_left = from_rotation(R_right_left, R_right_left @ [-self.camera.baseline_m, 0.0, 0.0])
        return StereoCalibration((K, K), (distortion, distortion), T_right_left, self.camera.shape[::-1])

    @cached_property
    def _lenses(self) -> tuple[Lens, Lens]:
        left, right = (Lens.of_sensor(self.camera, self.faults, self.seed, side) for side in (LEFT, RIGHT))
        return left, right

    @property
    def _filling_m(self) -> float:
        """The distance at which the board, rim and all, would fill the picture's width or height [m]."""
        size_m = np.array([self.board.columns + 1, self.board.rows + 1]) * self.board.square_m
        return float((self.camera.focal_px * size_m / self.camera.shape[::-1]).max())

    def _pose(self, part: FloatArray, rng: np.random.Generator, distance_m: float) -> FloatArray:
        """The board's middle at a part (x, y) of the picture, 0 to 1, tilted and rolled by chance."""
        tilt = np.deg2rad(rng.uniform(-TILT_DEG, TILT_DEG, 2))
        turn = Rotation.from_euler("zxy", [np.deg2rad(rng.uniform(-ROLL_DEG, ROLL_DEG)), *tilt]).as_matrix()
        pixel = part * self.camera.shape[::-1]
        ray = np.append((pixel - [self.camera.cx_px, self.camera.cy_px]) / self.camera.focal_px, 1.0)
        return from_rotation(turn, distance_m * ray - turn @ self.board.corners_m.mean(axis=0))

    def _is_in_view(self, T_cam_board: FloatArray) -> bool:
        # One square more on each side: the board's own rim.
        x, y, _ = self.board.corners_m.max(axis=0)
        s = self.board.square_m
        rim = np.array([[a, b, 0.0] for a in (-s, x + s) for b in (-s, y + s)])
        truth = self.truth()
        for T, K, D in zip((np.eye(4), truth.T_right_left), truth.K, truth.distortion, strict=True):
            points = transform(T @ T_cam_board, rim)
            pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, D)[0].reshape(-1, 2)
            low, high = pixels.min(axis=0), pixels.max(axis=0)
            if (low < MARGIN_PX).any() or (high > np.array(truth.size_px) - 1 - MARGIN_PX).any():
                return False
        return True


T_WORLD_BOARD: FloatArray = from_rotation(R_BASE_OPTICAL, [0.0, 0.1, HEIGHT_M])
"""The board hangs upright and looks along -x; its frame is at its first inner corner: see Chessboard.corners_m."""


def board_world(board: Chessboard, seed: int) -> World:
    """The board in a room, before a wall."""
    streams = np.random.default_rng([seed, 1]).spawn(2)
    s = board.square_m
    # The print: the squares and a white rim of one square all around.
    low, high = (-2 * s, -2 * s), ((board.columns + 1) * s, (board.rows + 1) * s)
    to_world = from_rotation(R_BASE_OPTICAL, T_WORLD_BOARD[:3, 3])
    a, b = transform(to_world, [(*low, 0.0), (*high, 0.004)])
    corners = np.sort(np.array([a, b]), axis=0)
    sheet = box("board", tuple(corners[0]), tuple(corners[1]), {"-x": Paint("print", fit=True), "": Paint("floor")})
    room = (
        box("floor", (-3.0, -3.0, -0.1), (2.0, 3.0, 0.0), Paint("floor")),
        box("wall", (1.0, -3.0, 0.0), (1.1, 3.0, 2.6), Paint("wall")),
    )
    textures = {"print": _print(board), "floor": paint.floor(streams[0]), "wall": paint.wall(streams[1])}
    path = np.array([[0.0, 0.0], [0.1, 0.0]])
    return World("chessboard", seed, (sheet, *room), textures, (), path, ambient=0.9)


def _print(board: Chessboard) -> Texture:
    """Squares and rim; each texel is as dark as the share of it that is inked."""
    (inked_y, inside_y), (inked_x, inside_x) = (
        _stripes(texels, corners) for texels, corners in zip(TEXELS, (board.rows, board.columns), strict=True)
    )
    # A square is dark where its two stripes differ: +1 and -1 multiply. The rim, 0, stays white.
    ink = 0.5 * (np.outer(inside_y, inside_x) - np.outer(inked_y, inked_x))
    return Texture(paint.to_image((PAPER + (INK - PAPER) * ink).astype(np.float32)))


def _stripes(texels: int, inner_corners: int) -> tuple[FloatArray, FloatArray]:
    """(texels,) each, along an axis: the mean of +1, -1, ... over the squares, 0 on the rim, that each texel covers;
    and the share of it that lies on squares."""
    edges = np.linspace(-1.0, inner_corners + 2.0, texels + 1)
    place = np.clip(edges, 0.0, inner_corners + 1.0)
    # The integral of the stripes up to a place, in squares: it climbs and falls by one a square.
    climbed = 1.0 - np.abs(place % 2.0 - 1.0)
    return np.diff(climbed) / np.diff(edges), np.diff(place) / np.diff(edges)


def write_pairs(session: ChessboardSession, folder: Path) -> int:
    """Write left01.png, right01.png, ... into a folder, which is made if need be; the number of pairs.

    Raises InvalidInputError when pictures of that name are there already.
    """
    there = sorted(folder.glob("left[0-9][0-9].*")) + sorted(folder.glob("right[0-9][0-9].*"))
    if there:
        raise InvalidInputError(f"{there[0]}: exists already; choose another folder")
    make_folder(folder)
    number = 0
    for number, pair in enumerate(session.pairs(), start=1):
        for side, image in zip(("left", "right"), pair, strict=True):
            with written_beside(folder / f"{side}{number:02d}.png") as path:
                path.write_bytes(encode_png(image))
    return number
