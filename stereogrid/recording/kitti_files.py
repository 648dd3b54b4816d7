"""The text files and image names of a KITTI-odometry folder, checked line by line."""

import re
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from ..geometry import FloatArray
from ..textrows import floats, rows_of_words, text_lines
from ..trajectory import read_kitti
from .picture_files import PICTURES

_LABEL = re.compile(r"\s*([A-Za-z]\w*)\s*:")
_FRAME_RATE_HZ = 10


def image_names(left: Path, right: Path) -> list[str]:
    """The sorted names of the pairs in two folders. Raises RecordingError when one of a pair is missing."""
    names = [{path.name for path in side.iterdir() if path.suffix.lower() in PICTURES} for side in (left, right)]
    for folder, missing in ((right, names[0] - names[1]), (left, names[1] - names[0])):
        if missing:
            shown = ", ".join(sorted(missing)[:3]) + (", ..." if len(missing) > 3 else "")
            raise RecordingError(f"{folder}: {len(missing)} images are missing: {shown}")
    if not names[0]:
        raise RecordingError(f"{left}: no images; expected {', '.join(PICTURES)}")
    return sorted(names[0])


def projections(calib: Path, row: int) -> tuple[FloatArray, FloatArray]:
    """The projection matrices (3, 4) number `row` and `row + 1` of calib.txt.

    Its lines are `P0: 12 numbers` as in the benchmark, or bare rows of 12; other labels are passed over.
    """
    found: dict[str, FloatArray] = {}
    for number, line in text_lines(calib):
        label = _LABEL.match(line)
        name = label.group(1) if label else f"P{len(found)}"
        if re.fullmatch(r"P\d", name):
            words = (line[label.end() :] if label else line).split()
            numbers = floats(words, f"{calib}:{number}")
            found[name] = _row_of_12(numbers, f"{calib}:{number}")
    for name in (f"P{row}", f"P{row + 1}"):
        if name not in found:
            raise RecordingError(f"{calib}: no {name}, only {', '.join(found) or 'nothing'}")
    return found[f"P{row}"], found[f"P{row + 1}"]


def read_poses(path: Path, n_images: int) -> FloatArray:
    """Poses (M, 4, 4), one row of 12 numbers an image. Raises RecordingError, naming the line."""
    poses = read_kitti(path)
    if len(poses) != n_images:
        raise RecordingError(f"{path}: {len(poses)} poses for {n_images} images, expected one row an image")
    return poses


def read_stamps(path: Path, n_images: int) -> list[float]:
    """The stamp of each image [s] from times.txt; 10 Hz from zero when there is no such file."""
    if not path.exists():
        return [number / _FRAME_RATE_HZ for number in range(n_images)]
    stamps_s: list[float] = []
    for where, words in rows_of_words(path):
        numbers = floats(words, where)
        if len(numbers) != 1 or not np.isfinite(numbers[0]) or (stamps_s and numbers[0] <= stamps_s[-1]):
            raise RecordingError(f"{where}: {' '.join(words)!r}; expected one time a row, increasing [s]")
        stamps_s.append(numbers[0])
    if len(stamps_s) != n_images:
        raise RecordingError(f"{path}: {len(stamps_s)} times for {n_images} images, expected one row an image")
    return stamps_s


def _row_of_12(numbers: list[float], where: str) -> FloatArray:
    if len(numbers) != 12:
        raise RecordingError(f"{where}: {len(numbers)} numbers, expected 12 (a 3x4 matrix, row by row)")
    return np.array(numbers).reshape(3, 4)
