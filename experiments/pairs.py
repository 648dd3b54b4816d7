"""Stereo pairs whose disparity is known, as the Middlebury benchmark and its repackagers lay them out."""

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
    for layout in (_middlebury_2, _motorcycle, _middlebury_3, _aloe):
        pair = layout(folder)
        if pair is not None:
            return pair
    raise RecordingError(
        f"{folder}: no stereo pair with truth; expected imL, imR and groundtruth.png or disp.npz; im0, im1 and "
        "disp0.pfm; or *L, *R and *GT images"
    )


def _middlebury_2(folder: Path) -> Pair | None:
    if not (folder / "groundtruth.png").exists():
        return None
    scale, last = (float(word) for word in (folder / "info.txt").read_text(encoding="ascii").split())
    raw = _read(folder / "groundtruth.png", cv2.IMREAD_GRAYSCALE)
    truth_px = np.where(raw == 0, np.nan, raw / scale)
    visible = _read(folder / "nonocc.png", cv2.IMREAD_GRAYSCALE) == 255
    judged = _read(folder / "all.png", cv2.IMREAD_GRAYSCALE) == 255
    known = ~np.isnan(truth_px)
    masks = (visible & known, judged & ~visible & known)
    return _pair(folder, ("imL.png", "imR.png"), truth_px, masks, last, float(np.gcd.reduce(raw, axis=None)) / scale)


def _motorcycle(folder: Path) -> Pair | None:
    if not (folder / "disp.npz").exists():
        return None
    truth_px = _finite(np.load(folder / "disp.npz", allow_pickle=False)["disp"])
    return _pair(folder, ("imL.png", "imR.png"), truth_px, seen_by_both(truth_px), np.nan, 0.0)


def _middlebury_3(folder: Path) -> Pair | None:
    truth = next((folder / n for n in ("disp0GT.pfm", "disp0.pfm") if (folder / n).exists()), None)
    if truth is None:
        return None
    truth_px = _finite(_read(truth, cv2.IMREAD_UNCHANGED))
    return _pair(folder, ("im0.png", "im1.png"), truth_px, seen_by_both(truth_px), np.nan, 0.0)


def _aloe(folder: Path) -> Pair | None:
    truth = next(iter(sorted(folder.glob("*GT.png"))), None)
    if truth is None:
        return None
    stem = truth.name.removesuffix("GT.png")
    raw = _read(truth, cv2.IMREAD_GRAYSCALE)
    truth_px = np.where(raw == 0, np.nan, raw.astype(float))
    images = [next(iter(sorted(folder.glob(f"{stem}{side}.*"))), folder / f"{stem}{side}.png").name for side in "LR"]
    return _pair(folder, (images[0], images[1]), truth_px, seen_by_both(truth_px), np.nan, 1.0)


def _pair(
    folder: Path, images: tuple[str, str], truth_px: FloatArray, masks: tuple[Mask, Mask], last: float, step_px: float
) -> Pair:
    left, right = (_read(folder / name, cv2.IMREAD_COLOR) for name in images)
    if not left.shape[:2] == right.shape[:2] == truth_px.shape:
        raise RecordingError(
            f"{folder}: images and truth differ in size: {left.shape[:2]}, {right.shape[:2]}, {truth_px.shape}"
        )
    count = _labels(truth_px) if np.isnan(last) else int(last) + 1
    return Pair(folder.name, left, right, truth_px, *masks, count, step_px)


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
    encoded = np.frombuffer(path.read_bytes(), np.uint8) if path.exists() else None
    image = None if encoded is None else cv2.imdecode(encoded, mode)
    if image is None:
        raise RecordingError(f"{path}: missing, or not a readable image")
    found: Image = image
    return found
