"""Stereo pairs whose disparity is known, as the Middlebury benchmark and its repackagers lay them out."""

import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from stereogrid.errors import RecordingError
from stereogrid.geometry import FloatArray
from stereogrid.observation import Image

Mask = NDArray[np.bool_]
LABEL_STEP = 4
EXPECTED = (
    "expected imL, imR and groundtruth.png or disp.npz; im0, im1 and disp0.pfm; or *L, *R and *GT images, as the "
    "Middlebury benchmark, scikit-image and OpenCV lay them out"
)


@dataclass(frozen=True)
class Pair:
    """Rectified colour images (H, W, 3) uint8 BGR and the left one's disparity truth_px (H, W), NaN = unknown.

    visible: the truth is known and both images show the pixel; hidden: only the left one does. step_px: the truth
    is a multiple of it (0: finer than matters).
    """

    name: str
    left: Image
    right: Image
    truth_px: FloatArray
    visible: Mask
    hidden: Mask
    num_disparities: int
    step_px: float

    @property
    def grey(self) -> tuple[Image, Image]:
        """Both images (H, W) uint8 in grey."""
        return cv2.cvtColor(self.left, cv2.COLOR_BGR2GRAY), cv2.cvtColor(self.right, cv2.COLOR_BGR2GRAY)

    def shrunk(self, times: int) -> "Pair":
        """The pair at 1 / times the size: images averaged over areas, truth taken from each area's centre."""
        size = (self.left.shape[1] // times, self.left.shape[0] // times)
        crop = (slice(0, size[1] * times), slice(0, size[0] * times))
        left, right = (cv2.resize(i[crop], size, interpolation=cv2.INTER_AREA) for i in (self.left, self.right))
        centre = (slice(times // 2, crop[0].stop, times), slice(times // 2, crop[1].stop, times))
        truth_px = self.truth_px[centre] / times
        return Pair(
            f"{self.name} / {times}",
            left,
            right,
            truth_px,
            self.visible[centre],
            self.hidden[centre],
            _labels(truth_px),
            self.step_px / times,
        )


def open_pair(folder: Path) -> Pair:
    """The pair in a folder of one of these layouts; raises RecordingError saying what was expected.

    Middlebury 2 pack (imL, imR, groundtruth, nonocc, all, info.txt), scikit-image's Motorcycle (imL, imR, disp.npz),
    Middlebury 3 (im0, im1, disp0GT.pfm or disp0.pfm), OpenCV's Aloe (*L, *R, *GT).
    """
    folder = Path(folder)
    pair = _opened(folder)
    if pair is None:
        raise RecordingError(f"{folder}: no stereo pair with truth; {EXPECTED}")
    return pair


def open_pairs(folder: Path) -> list[Pair]:
    """The pair that stands in a folder, or all in its sub-folders by name, passing over what is no pair.

    Raises RecordingError when there is none, or when one has the files of a layout but they are wrong.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder of stereo pairs")
    places = [folder, *sorted(each for each in folder.iterdir() if each.is_dir())]
    found = [pair for place in places if (pair := _opened(place)) is not None]
    if not found:
        raise RecordingError(f"{folder}: no stereo pair with truth there or one folder below; {EXPECTED}")
    return found


def _opened(folder: Path) -> Pair | None:
    return next((pair for layout in LAYOUTS if (pair := layout(folder)) is not None), None)


def _middlebury_2(folder: Path) -> Pair | None:
    if not (folder / "groundtruth.png").exists():
        return None
    scale, last = _scale_and_last(folder / "info.txt")
    raw = _read(folder / "groundtruth.png", cv2.IMREAD_GRAYSCALE)
    truth_px = np.where(raw == 0, np.nan, raw / scale)
    visible, judged = (_mask(folder / name, raw.shape) for name in ("nonocc.png", "all.png"))
    known = ~np.isnan(truth_px)
    masks = (visible & known, judged & ~visible & known)
    step_px = float(np.gcd.reduce(raw, axis=None)) / scale
    return _pair(folder, ("imL.png", "imR.png"), truth_px, masks, last=last, step_px=step_px)


def _scale_and_last(path: Path) -> tuple[float, int]:
    """What info.txt holds: grey levels a pixel of disparity, and the largest label."""
    try:
        scale, last = path.read_text(encoding="ascii").split()
        if 0 < float(scale) < np.inf and int(last) > 0:
            return float(scale), int(last)
    except (OSError, ValueError):
        pass
    raise RecordingError(f"{path}: missing, or not two positive numbers: the scale and the largest disparity")


def _mask(path: Path, shape: tuple[int, ...]) -> Mask:
    mask: Mask = _read(path, cv2.IMREAD_GRAYSCALE) == 255
    if mask.shape != shape:
        raise RecordingError(f"{path}: {mask.shape}, but the truth is {shape}")
    return mask


def _motorcycle(folder: Path) -> Pair | None:
    path = folder / "disp.npz"
    if not path.exists():
        return None
    try:
        disparity_px = np.asarray(np.load(path, allow_pickle=False)["disp"], np.float64)
    except (OSError, EOFError, ValueError, TypeError, LookupError, zipfile.BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path}: not an .npz file with an array of numbers named disp") from error
    return _pair_seen(folder, ("imL.png", "imR.png"), _finite(disparity_px), 0.0)


def _middlebury_3(folder: Path) -> Pair | None:
    truth = next((folder / n for n in ("disp0GT.pfm", "disp0.pfm") if (folder / n).exists()), None)
    if truth is None:
        return None
    return _pair_seen(folder, ("im0.png", "im1.png"), _finite(_read(truth, cv2.IMREAD_UNCHANGED)), 0.0)


def _aloe(folder: Path) -> Pair | None:
    truth = next(iter(sorted(folder.glob("*GT.png"))), None)
    if truth is None:
        return None
    stem = truth.name.removesuffix("GT.png")
    raw = _read(truth, cv2.IMREAD_GRAYSCALE)
    truth_px = np.where(raw == 0, np.nan, raw.astype(float))
    images = [next(iter(sorted(folder.glob(f"{stem}{side}.*"))), folder / f"{stem}{side}.png").name for side in "LR"]
    return _pair_seen(folder, (images[0], images[1]), truth_px, 1.0)


LAYOUTS = (_middlebury_2, _motorcycle, _middlebury_3, _aloe)


def _pair_seen(folder: Path, images: tuple[str, str], truth_px: FloatArray, step_px: float) -> Pair:
    """A pair whose masks and number of labels follow from its truth."""
    if truth_px.ndim != 2:
        raise RecordingError(f"{folder}: the truth must be (H, W), not {truth_px.shape}")
    return _pair(folder, images, truth_px, seen_by_both(truth_px), step_px=step_px)


def _pair(
    folder: Path,
    images: tuple[str, str],
    truth_px: FloatArray,
    masks: tuple[Mask, Mask],
    *,
    last: int | None = None,
    step_px: float,
) -> Pair:
    left, right = (_read(folder / name, cv2.IMREAD_COLOR) for name in images)
    if not left.shape[:2] == right.shape[:2] == truth_px.shape:
        raise RecordingError(
            f"{folder}: images and truth differ in size: {left.shape[:2]}, {right.shape[:2]}, {truth_px.shape}"
        )
    if not masks[0].any():
        raise RecordingError(f"{folder}: the truth is known at no pixel that both images show")
    count = _labels(truth_px) if last is None else last + 1
    return Pair(folder.absolute().name, left, right, truth_px, *masks, count, step_px)


def _labels(truth_px: FloatArray) -> int:
    """How many labels 0, 1, ... hold the truth, rounded up."""
    return -(-(int(np.ceil(np.nanmax(truth_px))) + 1) // LABEL_STEP) * LABEL_STEP


def _finite(truth_px: FloatArray) -> FloatArray:
    return np.where(np.isfinite(truth_px) & (truth_px > 0), truth_px, np.nan)


def seen_by_both(truth_px: FloatArray) -> tuple[Mask, Mask]:
    """(visible, hidden) (H, W) from the truth alone: nothing nearer by more than a pixel lands on the same place."""
    height, width = truth_px.shape
    known = ~np.isnan(truth_px)
    row, column = np.nonzero(known)
    d = truth_px[known]
    landing = np.rint(column - d).astype(int)
    inside = landing >= 0
    nearest = np.zeros((height, width))
    np.maximum.at(nearest, (row[inside], landing[inside]), d[inside])
    visible = np.zeros((height, width), bool)
    visible[row, column] = inside & (d >= nearest[row, np.maximum(landing, 0)] - 1)
    return visible, known & ~visible


def _read(path: Path, mode: int) -> Image:
    try:
        image = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), mode)
    except (OSError, cv2.error):  # not there, a folder, empty
        image = None
    if image is None:
        raise RecordingError(f"{path}: missing, or not a readable image")
    found: Image = image
    return found
