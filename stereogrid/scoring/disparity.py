"""How good is a disparity image, against the true one?

Scharstein and Szeliski (IJCV 2002): the share of bad pixels, and the mean absolute error; always with the density.
"""

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from ..geometry import FloatArray
from ..observation import Disparity, FloatImage
from .score import DIMENSIONLESS, Score

PERCENT, PIXEL = "%", "px"
BAD_PX = (0.5, 1.0, 2.0)


def filled(disparity_px: FloatImage) -> FloatImage:
    """The disparity (H, W) with holes filled from the smaller of the nearest matches left and right on the row.

    A hole is most often an occlusion, and what is hidden belongs to the farther surface. A row without a match
    takes the smallest disparity of the image; an image without any match is 0.
    """
    left = _carried(disparity_px)
    right = _carried(disparity_px[:, ::-1])[:, ::-1]
    result: FloatImage = np.where(np.isnan(disparity_px), np.fmin(left, right), disparity_px)
    known = disparity_px[~np.isnan(disparity_px)]
    return np.nan_to_num(result, nan=float(known.min()) if known.size else 0.0)


def _carried(disparity_px: FloatImage) -> FloatImage:
    """Each value carried to the right over the holes that follow it."""
    column = np.where(np.isnan(disparity_px), 0, np.arange(disparity_px.shape[1]))
    carried: FloatImage = np.take_along_axis(disparity_px, np.maximum.accumulate(column, axis=1), axis=1)
    return carried


def disparity_scores(found_px: FloatImage, truth_px: FloatArray, judged: NDArray[np.bool_]) -> list[Score]:
    """Density, bad-0.5, bad-1 and bad-2 [%] and MAE [px] over the judged pixels; found_px (H, W), NaN = no match.

    A name without a suffix is over the matched pixels; `_filled` over all, the holes filled by `filled`.
    """
    if not found_px.shape == truth_px.shape == judged.shape:
        raise InvalidInputError(
            f"disparity, truth and judged differ in size: {found_px.shape}, {truth_px.shape} and {judged.shape}"
        )
    if np.isnan(truth_px[judged]).any():
        raise InvalidInputError("judged pixels must have a true disparity")
    valid = judged & ~np.isnan(found_px)
    density = 100 * valid.sum() / max(1, judged.sum())
    return [
        Score("density", density, PERCENT, int(judged.sum())),
        *_errors(np.abs(found_px[valid] - truth_px[valid]), ""),
        *_errors(np.abs(filled(found_px)[judged] - truth_px[judged]), "_filled"),
    ]


def _errors(error_px: FloatArray, suffix: str) -> list[Score]:
    n = error_px.size
    bad = {f"bad_{px:.1f}".replace(".", "_"): 100 * float(np.mean(error_px > px)) if n else np.nan for px in BAD_PX}
    mae_px = float(np.mean(error_px)) if n else np.nan
    return [
        *(Score(f"{name}{suffix}", value, PERCENT, n) for name, value in bad.items()),
        Score(f"mae{suffix}", mae_px, PIXEL, n),
    ]


def sigma_coverage(
    found: Disparity, truth_px: FloatArray, judged: NDArray[np.bool_], *, step_px: float = 0.0
) -> list[Score]:
    """Shares of the matched, judged pixels whose error is within 1 and 2 sigma: .683 and .954 where sigma is right.

    A truth that is a multiple of step_px is itself off by up to half of it: its variance step^2 / 12 is added to
    sigma^2, so that the rounding is not held against the matcher.
    """
    valid = judged & found.valid
    n = int(valid.sum())
    error_px = np.abs(found.disparity_px[valid] - truth_px[valid])
    sigma_px = np.sqrt(np.square(found.sigma_px[valid], dtype=np.float64) + step_px**2 / 12)
    return [
        Score(f"within_{times}_sigma", float(np.mean(error_px <= times * sigma_px)) if n else np.nan, DIMENSIONLESS, n)
        for times in (1, 2)
    ]


def occlusion_f1(found_px: FloatImage, occluded: NDArray[np.bool_], judged: NDArray[np.bool_]) -> Score:
    """F1 of "no match" as a detector of occluded pixels, over the judged ones (visible or known to be occluded)."""
    said, true = np.isnan(found_px) & judged, occluded & judged
    both = np.count_nonzero(said & true)
    total = np.count_nonzero(said) + np.count_nonzero(true)
    return Score("occlusion_f1", 2 * both / total if total else np.nan, DIMENSIONLESS, int(judged.sum()))
