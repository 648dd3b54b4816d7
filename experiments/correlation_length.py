"""How far errors go together in an image: autocorrelation with pixels missing, and the square of one independent look.

The correlation length L [px] is the side of the square of pixels that carries one independent look: L^2 is the sum of
the autocorrelation over all lags of the plane, so that the mean over a window of A >> L^2 pixels has the variance
L^2 / A of a single pixel's. White noise has L = 1.

The mean over the image is taken off first: an error that is the same all over does not average out in any window, and
with it the sum does not end. It is a bias, for which no L makes up, and is reported beside L.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray

LARGEST_LAG_PX = 32
"""A cell's footprint is hardly larger (5 cm at 1 m and 834 px of focal length: 42 px), and within it what goes together
farther is one more bias; farther lags would show the surfaces of the scene rather than the matcher."""
UNCORRELATED = 0.05
"""The sum over lags ends where rho, averaged over directions, first falls below it: what follows is mostly noise, and
a plane holds so many lags that little of it would count for much. Of a Gaussian rho this leaves out 5 % of L^2."""
LARGEST_ERROR = 3.0
"""Errors beyond so many sigmas count as so many: wrong matches are no part of the spread that sigma describes."""
FEWEST_PIXELS = 10_000
"""Of fewer, rho would be known worse than UNCORRELATED."""


@dataclass(frozen=True)
class Autocorrelation:
    """rho (2 R + 1, 2 R + 1) of the errors of n pixels by lag (rows, columns), 1 at its centre.

    bias: their mean, and spread: their standard deviation about it, both in sigmas.
    """

    rho: FloatArray
    bias: float
    spread: float
    n: int

    @property
    def radial(self) -> FloatArray:
        """rho (R + 1) at the distances 0 .. R px, averaged over the lags that round to each."""
        distance_px = np.rint(_distance_px(self.rho)).astype(int).ravel()
        total = np.bincount(distance_px, self.rho.ravel())[: self.rho.shape[0] // 2 + 1]
        mean: FloatArray = total / np.bincount(distance_px)[: total.size]
        return mean

    @property
    def reach_px(self) -> int:
        """The first distance at which rho is below UNCORRELATED, or one more than the largest."""
        below = np.flatnonzero(self.radial < UNCORRELATED)
        return int(below[0]) if below.size else self.radial.size

    @property
    def length_px(self) -> float:
        """L: the root of the sum of rho over lags nearer than reach_px, at least 1."""
        near = np.rint(_distance_px(self.rho)) < self.reach_px
        return float(np.sqrt(max(self.rho[near].sum(), 1.0)))

    def looks(self, side_px: int) -> float:
        """How many independent errors would average out as the errors of a window of side_px x side_px <= R do."""
        reach = self.rho.shape[0] // 2
        if not 1 <= side_px <= reach:
            raise InvalidInputError(f"a window must have 1 to {reach} px, not {side_px}")
        share = np.maximum(1 - np.abs(np.arange(-reach, reach + 1)) / side_px, 0)
        return float(side_px**2 / (share @ self.rho @ share))


def autocorrelation(error: FloatArray, largest_lag_px: int = LARGEST_LAG_PX) -> Autocorrelation:
    """Of errors (H, W) in sigmas, NaN = missing: at each lag, the mean product of all the pairs of pixels that exist.

    Raises InvalidInputError where fewer than FEWEST_PIXELS are known, or none differ.
    """
    known = ~np.isnan(error)
    n = int(known.sum())
    if n < FEWEST_PIXELS:
        raise InvalidInputError(f"the errors of {n} pixels say nothing about their correlation: {FEWEST_PIXELS} do")
    clipped = np.clip(error, -LARGEST_ERROR, LARGEST_ERROR)
    bias = float(clipped[known].mean())
    spread = float(clipped[known].std())
    if spread == 0:
        raise InvalidInputError("all errors are the same: there is nothing to correlate")
    products = _lagged(np.where(known, clipped - bias, 0.0), largest_lag_px)
    pairs = np.rint(_lagged(known.astype(float), largest_lag_px))
    return Autocorrelation(products / np.maximum(pairs, 1) / spread**2, bias, spread, n)


def pooled(parts: Sequence[Autocorrelation]) -> Autocorrelation:
    """The mean over scenes of one kind, each weighing the same."""
    rho = np.mean([part.rho for part in parts], axis=0)
    bias, spread = (float(np.mean([getattr(part, name) for part in parts])) for name in ("bias", "spread"))
    return Autocorrelation(rho, bias, spread, sum(part.n for part in parts))


def _lagged(image: FloatArray, reach: int) -> FloatArray:
    """Sums (2 reach + 1, 2 reach + 1) of image(x) image(x + lag), what lies outside of the image being 0."""
    size = [fft.next_fast_len(side + reach, real=True) for side in image.shape]
    spectrum = np.abs(fft.rfft2(image, size)) ** 2
    sums: FloatArray = fft.irfft2(spectrum, size)
    return np.roll(sums, (reach, reach), (0, 1))[: 2 * reach + 1, : 2 * reach + 1]


def _distance_px(rho: FloatArray) -> FloatArray:
    lag = np.arange(rho.shape[0]) - rho.shape[0] // 2
    return np.hypot(lag[:, None], lag)
