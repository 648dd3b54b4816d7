"""Calibrations as OpenCV's own samples write them (cv2.FileStorage): raw cameras, and how they were rectified."""

from pathlib import Path

import cv2
import numpy as np

from ..errors import InvalidInputError
from ..geometry import FloatArray, as_floats, from_rotation, rotation_angle_rad
from .rig import MAX_RECTIFYING_TURN_DEG, StereoCalibration

OPENCV_SUFFIXES = (".yml", ".yaml", ".xml")
NAMES = {
    "M1": ("M1", "K1", "cameraMatrix1"),
    "D1": ("D1", "distCoeffs1"),
    "M2": ("M2", "K2", "cameraMatrix2"),
    "D2": ("D2", "distCoeffs2"),
    "R": ("R",),
    "T": ("T",),
}
"""What it is called in different programs' files."""


def read_opencv(path: Path) -> StereoCalibration:
    """T in metres. Raises InvalidInputError, without the file's name, for what is missing or cannot be true."""
    try:
        text = path.read_text(encoding="utf-8")
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        found = {name: _matrix(storage, aliases) for name, aliases in NAMES.items()}
    except OSError as error:
        raise InvalidInputError(f"cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, cv2.error, SystemError):
        raise InvalidInputError("is no file of OpenCV's") from None
    missing = [name for name, matrix in found.items() if matrix is None]
    if missing:
        raise InvalidInputError(f"lacks {', '.join(missing)}: a calibration of two cameras has {', '.join(NAMES)}")
    M1, D1, M2, D2, R, T = (as_floats(matrix) for matrix in found.values() if matrix is not None)
    if R.shape != (3, 3) or T.size != 3:
        raise InvalidInputError(f"R must be (3, 3) and T of 3 numbers, not {R.shape} and {T.size}")
    _check_rectified(storage, M1)
    return StereoCalibration((M1, M2), (D1.ravel(), D2.ravel()), from_rotation(R, T.ravel()), _size_px(storage))


def _check_rectified(storage: cv2.FileStorage, M1: FloatArray) -> None:
    """How the file's own program rectified, where it says so, must be possible: else its cameras are wrong too."""
    R1, P1 = _matrix(storage, ("R1",)), _matrix(storage, ("P1",))
    if R1 is not None and R1.shape == (3, 3):
        turn_deg = float(np.degrees(rotation_angle_rad(from_rotation(R1))))
        if turn_deg > MAX_RECTIFYING_TURN_DEG:
            raise InvalidInputError(
                f"its rectification turns the left picture by {turn_deg:.0f} degrees (R1[0][0] = {R1[0, 0]:.2f}), more "
                f"than {MAX_RECTIFYING_TURN_DEG:g}: these are not two cameras side by side"
            )
    if P1 is not None and P1.shape == (3, 4) and not 0.5 < P1[0, 0] / M1[0, 0] < 2.0:
        raise InvalidInputError(
            f"its rectification turns a focal length of {M1[0, 0]:.0f} px into {P1[0, 0]:.0f} px: it cannot be true"
        )


def _matrix(storage: cv2.FileStorage, names: tuple[str, ...]) -> FloatArray | None:
    """The matrix of the first of these names that the file has; None when it has none."""
    nodes = [storage.getNode(name) for name in names]
    return next((as_floats(node.mat()) for node in nodes if node.isMap() and node.mat() is not None), None)


def _size_px(storage: cv2.FileStorage) -> tuple[int, int]:
    for names in (("image_width", "image_height"), ("imageWidth", "imageHeight"), ("width", "height")):
        width, height = (storage.getNode(name) for name in names)
        if width.isInt() and height.isInt():
            return int(width.real()), int(height.real())
    for name in ("image_size", "imageSize", "size"):
        node = storage.getNode(name)
        if node.isSeq() and node.size() == 2:
            return int(node.at(0).real()), int(node.at(1).real())
    raise InvalidInputError("does not say the size of the pictures: add image_width and image_height")
