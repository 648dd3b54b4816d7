"""The paper's equations exactly as printed, wrong signs included, so that the difference can be shown.

Nothing else in the library calls them, but `SensorModel(form="printed")` fuses by printed Eqs. 3 and 11.
docs/method.md holds each beside its correction.
"""

import numpy as np
from numpy.typing import ArrayLike

from .geometry import FloatArray, as_floats


def probability(log_odds: ArrayLike) -> FloatArray:
    """Eq. 2 in print: p = 1 - 1 / (1 - e^l). Infinite at l = 0, 1.58 at l = 1."""
    with np.errstate(divide="ignore"):
        p: FloatArray = 1.0 - 1.0 / (1.0 - np.exp(as_floats(log_odds)))
    return p


def fuse(log_odds_before: ArrayLike, p_reading: ArrayLike, prior: float) -> FloatArray:
    """Eq. 3 in print: l + log(p / (1 - p0)) - log((1 - p) / p0), which is l + logit p + logit p0."""
    p = as_floats(p_reading)
    fused: FloatArray = as_floats(log_odds_before) + np.log(p / (1 - prior)) - np.log((1 - p) / prior)
    return fused


def world_points(R_world_cam: FloatArray, t_m: ArrayLike, points_cam: ArrayLike) -> FloatArray:
    """Eq. 7 in print: P_w = R^T P_c + T, points (N, 3) [m]. Right only where R is symmetric."""
    points: FloatArray = as_floats(points_cam) @ R_world_cam + as_floats(t_m)
    return points


def occupancy_probability(
    range_m: ArrayLike, measured_range_m: ArrayLike, sigma_m: ArrayLike, *, k_m: float, p_min: float
) -> FloatArray:
    """Eqs. 11 and 12 in print: P_occ + (k / (dl sqrt(2 pi)) + 0.5 - P_occ) exp(-((l - l_p) / dl)^2 / 2).

    P_occ is p_min in front and 0.5 behind; k_m has no value in the paper. Above 1 near the peak as soon as
    dl < 0.798 k.
    """
    sigma = as_floats(sigma_m)
    u: FloatArray = (as_floats(range_m) - as_floats(measured_range_m)) / sigma
    side = np.where(u < 0, p_min, 0.5)
    peak = k_m / (sigma * np.sqrt(2 * np.pi)) + 0.5
    p: FloatArray = side + (peak - side) * np.exp(-0.5 * np.square(u))
    return p
