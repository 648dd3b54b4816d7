"""What tells a real image from a made one, in numbers: how well pairs match, and a few statistics of the image."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from scipy import fft

from stereogrid.geometry import FloatArray
from stereogrid.matching import matcher
from stereogrid.observation import FloatImage, Image
from stereogrid.scoring.disparity import disparity_scores

from .pairs import Mask

MATCHERS = ("bm", "sgbm")
WINDOW_PX = 9
"""Local contrast is taken over the block that bm compares."""
FLAT_GRAY = 2.0
"""A window whose deviation is below this many gray levels has next to nothing to match."""
BLOCK_PX = 16
QUIETEST = 0.1
"""The noise is told in the quietest tenth of the blocks, where texture adds least to it."""
SLOPE_BAND = (0.02, 0.30)
"""Frequencies [cycles/px] over which the spectrum's slope is fitted: neither the scene's layout nor the pixels."""


@dataclass(frozen=True)
class Measure:
    """A number taken of every pair: its heading, its unit, and how it reads in words."""

    heading: str
    unit: str
    meaning: str
    decimals: int = 1


MEASURES = {
    "bm_density": Measure("BM density", "%", "pixels that bm matched, of all"),
    "bm_bad_1_0": Measure("BM bad-1.0", "%", "of the matched pixels that both images show, those off by > 1 px"),
    "bm_bad_2_0": Measure("BM bad-2.0", "%", "the same, by > 2 px"),
    "sgbm_density": Measure("SGBM density", "%", "pixels that sgbm matched, of all"),
    "sgbm_bad_1_0": Measure("SGBM bad-1.0", "%", "as for bm"),
    "sgbm_bad_2_0": Measure("SGBM bad-2.0", "%", "as for bm"),
    "photo_gray": Measure(
        "left - right", "gray", "median |left - right| at sgbm's matches: do both eyes see one shade?"
    ),
    "mean_gray": Measure("mean", "gray", "mean of the left image", 0),
    "contrast_gray": Measure("contrast", "gray", "deviation of the left image", 0),
    "local_gray": Measure("local contrast", "gray", f"median deviation in windows of {WINDOW_PX} px"),
    "flat": Measure("flat", "%", f"windows whose deviation is below {FLAT_GRAY:g} gray levels", 0),
    "slope": Measure("slope", "1", "b of the power spectrum f^-b: about 2 in photographs", 2),
    "noise_gray": Measure(
        "noise", "gray", "deviation of single pixels in the quietest tenth of the image, where JPEG leaves little", 2
    ),
}
"""In the order of the tables."""


def measures(
    left: Image, right: Image, *, num_disparities: int, truth_px: FloatArray | None = None, visible: Mask | None = None
) -> dict[str, float]:
    """All of MEASURES of a gray pair (H, W), in their order; NaN for bad pixels where there is no truth.

    truth_px (H, W): the left image's true disparity; visible (H, W): where it is known and both images show the pixel.
    """
    values: dict[str, float] = {}
    for name in MATCHERS:
        found_px = matcher(name, num_disparities=num_disparities).match(left, right).disparity_px
        values[f"{name}_density"] = 100 * float(np.mean(~np.isnan(found_px)))
        scores = {} if truth_px is None or visible is None else _by_name(found_px, truth_px, visible)
        values |= {f"{name}_{bad}": scores.get(bad, np.nan) for bad in ("bad_1_0", "bad_2_0")}
    values["photo_gray"] = photo_difference_gray(left, right, found_px)
    values |= image_statistics(left)
    return {name: values[name] for name in MEASURES}


def _by_name(found_px: FloatImage, truth_px: FloatArray, visible: Mask) -> Mapping[str, float]:
    return {score.name: score.value for score in disparity_scores(found_px, truth_px, visible)}


def photo_difference_gray(left: Image, right: Image, found_px: FloatImage) -> float:
    """Median |left(x) - right(x - d)| over the matched pixels [gray levels]; NaN where nothing matched."""
    row, column = np.nonzero(~np.isnan(found_px))
    if not len(row):
        return np.nan
    at = column - found_px[row, column]
    first = np.clip(np.floor(at).astype(np.int64), 0, left.shape[1] - 2)
    share = at - first
    seen = (1 - share) * right[row, first] + share * right[row, first + 1]
    return float(np.median(np.abs(left[row, column] - seen)))


def image_statistics(image: Image) -> dict[str, float]:
    """Mean, contrast, local contrast, share of flat windows, slope of the spectrum and noise of an image (H, W)."""
    gray = image.astype(np.float32)
    local = _local_deviation(gray)
    return {
        "mean_gray": float(gray.mean()),
        "contrast_gray": float(gray.std()),
        "local_gray": float(np.median(local)),
        "flat": 100 * float(np.mean(local < FLAT_GRAY)),
        "slope": spectrum_slope(gray),
        "noise_gray": noise_gray(gray),
    }


def _local_deviation(gray: FloatImage) -> FloatImage:
    window = (WINDOW_PX, WINDOW_PX)
    centred = gray - gray.mean()  # or the squares would lose what is looked for
    mean, square = cv2.blur(centred, window), cv2.blur(centred**2, window)
    deviation: FloatImage = np.sqrt(np.maximum(square - mean**2, 0))
    return deviation


def spectrum_slope(gray: FloatImage) -> float:
    """b of the power spectrum f^-b over SLOPE_BAND, by a line through the logarithms of means over rings.

    Field (JOSA A 1987): natural images have b of about 2.
    """
    height, width = gray.shape
    window = np.hanning(height)[:, None] * np.hanning(width)[None, :]
    power = np.abs(fft.rfft2((gray - gray.mean()) * window)) ** 2
    frequency = np.hypot(fft.fftfreq(height)[:, None], fft.rfftfreq(width)[None, :])
    edges = np.geomspace(*SLOPE_BAND, 13)
    ring = np.digitize(frequency, edges)
    means = np.array([power[ring == k].mean() for k in range(1, len(edges))])
    if not (means > 0).all():
        return np.nan
    middle = np.sqrt(edges[:-1] * edges[1:])
    return -float(np.polyfit(np.log(middle), np.log(means), 1)[0])


def noise_gray(gray: FloatImage) -> float:
    """Deviation of the noise of single pixels [gray levels], from the quietest blocks that are not clipped.

    A difference of Laplacians cancels planes and edges along the axes (Immerkaer, CVIU 1996); noise alone remains.
    """
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    response = cv2.filter2D(gray, cv2.CV_32F, mask)
    rows, columns = (n // BLOCK_PX * BLOCK_PX for n in gray.shape)
    shape = (rows // BLOCK_PX, BLOCK_PX, columns // BLOCK_PX, BLOCK_PX)
    energy = (response[:rows, :columns] ** 2).reshape(shape).mean(axis=(1, 3))
    level = gray[:rows, :columns].reshape(shape).mean(axis=(1, 3))
    quiet = energy[(level > 10) & (level < 245)]
    # The squares of the mask sum up to 36.
    return float(np.sqrt(np.quantile(quiet, QUIETEST) / 36)) if quiet.size else np.nan
