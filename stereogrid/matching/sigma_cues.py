"""Cues of a disparity's error, taken from the pair and the disparity alone: the same for every matcher.

Numba's cache does not notice when a function inlined from another file changes: the kernels stand together.
"""

import cv2
import numpy as np
from numba import njit

from ..geometry import Array
from ..observation import FloatImage, Image

CUES = ("roughness_px", "around_px", "shift_px", "unmatched", "gradient")
"""What `cues` gives, in this order; see there."""
OFFSETS = np.array([(0, 6), (4, 4), (6, 0), (4, -4), (4, 10), (10, 4), (10, -4), (4, -10)])
"""Steps (row, column) to one of two opposite neighbours [px]: further apart than a matcher's window is wide."""
ROUGHEST_PX = 1.0
"""Larger differences between neighbours are another surface or a mismatch, and count as this."""
AROUND_PX = 15
WINDOW_PX = 9
ROUNDING = 1 / 6
"""Variance of the difference of two grey values that were rounded to whole levels."""
FAINTEST = 1e-6
"""Mean squared gradient [grey^2 / px^2] of a window that has no texture."""


def cues(left: Image, right: Image, disparity_px: FloatImage) -> FloatImage:
    """The CUES (5, H, W) of disparities (H, W), NaN = no match; of no meaning where nothing matched.

    roughness_px: mean distance of the disparity from the middle of two opposite neighbours', which is 0 on any plane;
    around_px: its mean over the matches in AROUND_PX; unmatched: the share of pixels there that have no match;
    shift_px: sqrt(V / E), the standard deviation of a least-squares shift between the two matched windows of
    WINDOW_PX (Matthies, Kanade and Szeliski 1989). V: variance of their grey difference, whose mean (a gain between
    the cameras) is left out and to which that of rounding is added; E: sum over the window of (dI/dx)^2.
    gradient: root mean square of dI/dx over the window [grey / px].
    """
    found = np.empty((len(CUES), *disparity_px.shape), np.float32)
    rough, around, square, share, energy = found
    # Fresh memory costs more than the sums: what is written to is used again.
    matched = (disparity_px > 0).astype(np.float32)
    roughness(disparity_px, OFFSETS, ROUGHEST_PX, rough)
    first, second = rough * matched, np.empty_like(rough)
    cv2.boxFilter(first, cv2.CV_32F, (AROUND_PX, AROUND_PX), dst=around)
    cv2.boxFilter(matched, cv2.CV_32F, (AROUND_PX, AROUND_PX), dst=share)
    window = (WINDOW_PX, WINDOW_PX)
    grey_difference(left, right, disparity_px, second)
    mean = cv2.boxFilter(second, cv2.CV_32F, window, dst=first)
    cv2.sqrBoxFilter(second, cv2.CV_32F, window, dst=square)
    gradient = cv2.Sobel(left, cv2.CV_32F, 1, 0, dst=second, ksize=3, scale=1 / 8)
    cv2.sqrBoxFilter(gradient, cv2.CV_32F, window, dst=energy)
    finish(mean, cv2.boxFilter(matched, cv2.CV_32F, window, dst=second), WINDOW_PX, found)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def roughness(disparity: Array, offsets: Array, roughest: float, out: Array) -> None:
    """Write into out (H, W) the roughness of disparity (H, W) [px], each distance counted as `roughest` at most.

    Pairs of neighbours not both matched do not count; a pixel without a pair has `roughest`.
    """
    height, width = disparity.shape
    top = np.float32(roughest)
    half, nothing, one = np.float32(0.5), np.float32(0), np.float32(1)
    total, count = np.empty(width, np.float32), np.empty(width, np.float32)
    for row in range(height):
        total[:] = nothing
        count[:] = nothing
        for n in range(len(offsets)):
            down, along = offsets[n, 0], offsets[n, 1]
            margin = abs(along)
            if row - down < 0 or row + down >= height or width <= 2 * margin:
                continue
            # Slices of one length from 0 on: LLVM then does several pixels at once.
            above = disparity[row - down, margin - along : width - margin - along]
            below = disparity[row + down, margin + along : width - margin + along]
            centre = disparity[row, margin : width - margin]
            sums, counts = total[margin:], count[margin:]
            for i in range(len(centre)):
                gap = abs(half * (above[i] + below[i]) - centre[i])
                both = one if gap == gap else nothing
                sums[i] += both * (gap if gap < top else top)
                counts[i] += both
        for column in range(width):
            out[row, column] = total[column] / count[column] if count[column] > nothing else top


@njit(cache=True, nogil=True, error_model="numpy")
def grey_difference(left: Array, right: Array, disparity: Array, out: Array) -> None:
    """Write left(x) - right(x - d), right interpolated between its columns, into out (H, W); 0 where unmatched."""
    last = left.shape[1] - 1
    for row in range(left.shape[0]):
        for column in range(last + 1):
            there = np.float32(column) - disparity[row, column]
            if not 0 <= there <= last:
                out[row, column] = 0
                continue
            whole = int(there)
            low, high = np.float32(right[row, whole]), np.float32(right[row, min(whole + 1, last)])
            out[row, column] = np.float32(left[row, column]) - low - (there - np.float32(whole)) * (high - low)


@njit(cache=True, nogil=True, error_model="numpy")
def finish(mean: Array, near: Array, window: int, found: Array) -> None:
    """Turn window means into cues, in found (5, H, W).

    Roughness; roughness of matches, squared grey difference (0 where unmatched), share of matches, squared gradient.
    mean, near (H, W): of the grey difference and of matches, in the smaller window.
    """
    little, rounding, faintest = np.float32(1e-6), np.float32(ROUNDING), np.float32(FAINTEST)
    nothing, one, side = np.float32(0), np.float32(1), np.float32(window)
    for row in range(found.shape[1]):
        for column in range(found.shape[2]):
            share = found[3, row, column]
            found[1, row, column] /= max(share, little)
            found[3, row, column] = one - share
            matched = max(near[row, column], little)
            middle = mean[row, column] / matched
            variance = max(found[2, row, column] / matched - middle * middle, nothing) + rounding
            gradient = np.sqrt(max(found[4, row, column], faintest))
            found[2, row, column] = np.sqrt(variance) / (gradient * side)
            found[4, row, column] = gradient


@njit(cache=True, nogil=True, error_model="numpy")
def look_up(cues: Array, knots: Array, log_sigma: Array, limits: Array, out: Array) -> None:
    """Write exp of the sum of each cue's part of log sigma into out (H, W), between limits (smallest, largest).

    knots, log_sigma (C, K): values of each cue and its parts there, straight lines between them, constant outside;
    above its last knot the shift's part grows with the shift itself. Pixels of out that are NaN stay so.
    """
    one, first = np.float32(1), log_sigma[:, 0].sum()
    total, last = np.empty(out.shape[1], np.float32), knots[2, -1]
    for row in range(out.shape[0]):
        total[:] = first
        for n in range(len(cues)):
            cue = cues[n, row]
            for k in range(knots.shape[1] - 1):
                low, high = knots[n, k], knots[n, k + 1]
                slope = (log_sigma[n, k + 1] - log_sigma[n, k]) / (high - low)
                for i in range(len(total)):
                    total[i] += slope * (min(max(cue[i], low), high) - low)
        shift = cues[2, row]
        for i in range(len(total)):
            if not np.isnan(out[row, i]):
                sigma = np.exp(total[i]) * max(shift[i] / last, one)
                out[row, i] = min(max(sigma, limits[0]), limits[1])
