"""What RGB-D recordings of any layout have in common: depth images, poses, the depth camera, frames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera import DISTORTION_SIZES, StereoCamera
from ..errors import InvalidInputError, RecordingError
from ..geometry import Array, FloatArray, as_floats, nearest_pose
from ..observation import Image
from ..textrows import floats, rows_of_words
from .images import read_depth

CAMERA_FILES = ("camera-intrinsics.txt", "calibration.txt")
"""The matrix in three rows, or `fx fy cx cy` and OpenCV's distortion in one; the first found is read."""
NOTHING_FURTHER = 65535
"""What some depth cameras write where they measured nothing, as others write 0."""
SQUARE = 1e-4
"""Pixels are square where fx and fy differ by no more than this, relative."""


@dataclass(frozen=True)
class RgbdFrame:
    """One reading: when, where its depth and its colour image (None: there is none) are, T_world_cam (4, 4)."""

    stamp_ns: int
    depth: Path
    colour: Path | None
    T_world_cam: FloatArray


@dataclass(frozen=True)
class RgbdLens:
    """The depth camera: K (3, 3) [px] and distortion as OpenCV orders it; source: who says so."""

    K: FloatArray
    distortion: tuple[float, ...]
    source: str

    def __post_init__(self) -> None:
        K = self.K
        right = K.shape == (3, 3) and np.isfinite(K).all() and K[0, 0] > 0 and K[1, 1] > 0
        if not right or np.abs([K[0, 1], K[1, 0], *(K[2] - [0, 0, 1])]).max() > 0:
            raise RecordingError(f"{self.source}: {K.tolist()} is no matrix fx 0 cx, 0 fy cy, 0 0 1 of a camera")
        if len(self.distortion) not in (0, *DISTORTION_SIZES) or not np.isfinite(self.distortion).all():
            raise RecordingError(f"{self.source}: {list(self.distortion)} is no distortion as OpenCV orders it")

    @property
    def is_straight(self) -> bool:
        """Whether pictures are as a pinhole with square pixels sees them."""
        return bool(abs(self.K[0, 0] / self.K[1, 1] - 1) <= SQUARE) and not any(self.distortion)

    def camera(self, baseline_m: float, shape: tuple[int, int]) -> StereoCamera:
        """The virtual rig of this focal length over straightened pictures (H, W)."""
        focal_px = float((self.K[0, 0] + self.K[1, 1]) / 2)
        return StereoCamera(focal_px, float(self.K[0, 2]), float(self.K[1, 2]), baseline_m, shape[1], shape[0])


class Straightened:
    """Pictures of a lens as a pinhole camera with square pixels sees them; unchanged where they are so already."""

    def __init__(self, lens: RgbdLens, camera: StereoCamera) -> None:
        self._maps: tuple[Array, Array] | None = None
        if not lens.is_straight:
            distortion = as_floats(lens.distortion or (0.0,) * 4)
            size_px = camera.width_px, camera.height_px
            self._maps = cv2.initUndistortRectifyMap(lens.K, distortion, None, camera.K, size_px, cv2.CV_32FC1)

    def colour(self, image: Image) -> Image:
        """A picture (H, W), between its pixels."""
        if self._maps is None:
            return image
        moved: Image = cv2.remap(image, *self._maps, cv2.INTER_LINEAR)
        return moved

    def depth_m(self, depth_m: FloatArray) -> FloatArray:
        """Depths (H, W) [m], each that of the nearest pixel: nothing stands between two surfaces. NaN outside."""
        if self._maps is None:
            return depth_m
        nan = float("nan")
        moved: FloatArray = cv2.remap(
            depth_m, *self._maps, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=nan
        )
        return moved


@dataclass(frozen=True)
class RgbdFiles:
    """What a folder of some layout holds. frames: in the order of their stamps; per_m: a depth image's number for 1 m.

    shape: (height, width) of depth images. left_out: what could not be used, counted, by the reason.
    """

    layout: str
    frames: Sequence[RgbdFrame]
    per_m: float
    lens: RgbdLens
    shape: tuple[int, int]
    left_out: Mapping[str, int]


def metres(numbers: NDArray[np.uint16], per_m: float) -> FloatArray:
    """Depths (H, W) [m] of a depth image's numbers, NaN where it measured nothing."""
    known = (numbers > 0) & (numbers < NOTHING_FURTHER)
    depth_m: FloatArray = np.where(known, numbers / per_m, np.nan)
    return depth_m


def read_depth_m(path: Path, shape: tuple[int, int], per_m: float) -> FloatArray:
    """A depth image (H, W) [m], NaN where it measured nothing. Raises RecordingError, naming the file."""
    return metres(read_depth(path, shape), per_m)


def read_pose_file(path: Path) -> FloatArray:
    """A pose (4, 4) from a file of its 16 numbers, its rotation made one; RecordingError when they are none."""
    numbers = [number for where, words in rows_of_words(path) for number in floats(words, where)]
    if len(numbers) != 16:
        raise RecordingError(f"{path}: {len(numbers)} numbers, expected the 16 of a pose")
    try:
        return nearest_pose(np.reshape(numbers, (4, 4)), "the pose")
    except InvalidInputError as error:
        raise RecordingError(f"{path}: {error}") from error


def find_lens(folder: Path) -> RgbdLens | None:
    """The depth camera that a file in the folder or the one above tells of; None without such a file."""
    for place in (folder, folder.resolve().parent):
        for name in CAMERA_FILES:
            if (place / name).is_file():
                return _read_lens(place / name)
    return None


def no_lens(folder: Path) -> RecordingError:
    """The error for a recording whose depth camera nothing tells of."""
    return RecordingError(
        f"{folder}: nothing tells of its camera; put a file {CAMERA_FILES[0]} there, or above it, with the three rows "
        "'fx 0 cx', '0 fy cy', '0 0 1' [px] of the depth camera"
    )


def _read_lens(path: Path) -> RgbdLens:
    rows = [floats(words, where) for where, words in rows_of_words(path)]
    if [len(row) for row in rows] == [3, 3, 3]:
        return RgbdLens(np.array(rows), (), str(path))
    if len(rows) == 1 and len(rows[0]) >= 4:
        fx, fy, cx, cy, *distortion = rows[0]
        return RgbdLens(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), tuple(distortion), str(path))
    raise RecordingError(f"{path}: expected three rows 'fx 0 cx', '0 fy cy', '0 0 1', or one row 'fx fy cx cy' [px]")
