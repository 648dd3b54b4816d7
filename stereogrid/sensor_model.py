"""The inverse sensor model: what one disparity says about the cells on its ray. Eqs. 2, 3 and 8 to 13.

Corrected where the paper's print cannot be right; `as_printed.py` keeps the literal forms, docs/method.md
shows the two side by side.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit, ndtr

from .camera import StereoCamera
from .described import Doc, check_fields
from .errors import InvalidInputError, unknown_name
from .geometry import FloatArray, as_floats

FORMS = ("corrected", "printed")
MOTION_RULES = ("rss", "linear")
"""How eps joins the stereo error in Eq. 13: as independent errors add, or the paper's sum, a worst-case bound."""
REACH_SIGMAS = 3.5
"""Further than this before the measured surface a cell is plainly free."""
REACH_BEHIND_SIGMAS = 1.5
"""A cell that begins further than this behind it learns nothing: what little Eq. 12 still claims there is not free of
the claims of the next observations, and adds up to walls many cells thick. (The printed form reaches as far behind as
before.)"""


LOOKS_EXPONENT = 0.2
"""n independent looks at a cell in one observation narrow its reading by the root of n, and are worth n^0.2 readings
of that width: much of what they say, they say together (0 and 1 are worse calibrated, see docs/results.md)."""


@dataclass(frozen=True)
class SensorModel:
    """Parameters of Eqs. 3, 11, 12 and 13; 0 < p_free < prior < p_occupied < 1."""

    p_free: Annotated[
        float, Doc("The least that one reading claims of a cell before its surface (p_min).", "1", above=0, below=1)
    ] = 0.25
    p_occupied: Annotated[
        float, Doc("The most that one reading claims of the cell at its surface (p_max).", "1", above=0, below=1)
    ] = 0.9
    prior: Annotated[
        float, Doc("Of a cell never updated (p0 of Eq. 3): between p_free and p_occupied.", "1", above=0, below=1)
    ] = 0.5
    max_range_m: Annotated[float, Doc("Depths beyond it are not used.", "m", above=0)] = 8.0
    form: Annotated[str, Doc("Eqs. 3 and 11: corrected, or as printed in the paper.", choices=FORMS)] = "corrected"

    def __post_init__(self) -> None:
        if not 0 < self.p_free < self.prior < self.p_occupied < 1:
            raise InvalidInputError(
                "expected 0 < p_free < prior < p_occupied < 1, not "
                f"p_free {self.p_free}, prior {self.prior}, p_occupied {self.p_occupied}"
            )
        if self.form not in FORMS:
            raise unknown_name("form of the sensor model", self.form, FORMS)
        check_fields(self)


def log_odds(probability: ArrayLike) -> FloatArray:
    """logit(p) = log(p / (1 - p)), any shape."""
    p = as_floats(probability)
    logit: FloatArray = np.log(p) - np.log1p(-p)
    return logit


def probability(log_odds: ArrayLike) -> FloatArray:
    """p = 1 - 1 / (1 + e^l), any shape. Eq. 2 with its sign corrected; exact where e^l would overflow or vanish."""
    p: FloatArray = expit(as_floats(log_odds))
    return p


def fuse(log_odds_before: ArrayLike, p_reading: ArrayLike, prior: float) -> FloatArray:
    """l_t = l_{t-1} + logit p - logit p0. Eq. 3 with its sign corrected: p = p0 changes nothing."""
    return as_floats(log_odds_before) + log_odds(p_reading) - log_odds(prior)


def depth_sigma_m(camera: StereoCamera, depth_m: ArrayLike, sigma_px: ArrayLike) -> FloatArray:
    """dz = z^2 dd / (b f) [m], any shape. Eq. 8, first order: use depth_interval_m where dd / d > 0.2."""
    sigma: FloatArray = np.square(as_floats(depth_m)) * as_floats(sigma_px) / camera.focal_baseline_px_m
    return sigma


def depth_interval_m(
    camera: StereoCamera, disparity_px: ArrayLike, sigma_px: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """The exact, skewed interval f b / (d +- dd) [m]; its far end is infinite where dd >= d."""
    d = as_floats(disparity_px)
    sigma = as_floats(sigma_px)
    with np.errstate(divide="ignore"):
        far: FloatArray = camera.focal_baseline_px_m / np.maximum(d - sigma, 0.0)
    return camera.depth_m(d + sigma), far


def range_and_sigma_m(points_cam: ArrayLike, depth_sigma_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """l_p = norm(P_c) and dl_p = dz l_p / z [m] of points (N, 3) in cam. Eqs. 9 and 10."""
    points = as_floats(points_cam)
    range_m: FloatArray = np.linalg.norm(points, axis=-1)
    sigma: FloatArray = as_floats(depth_sigma_m) * range_m / points[..., 2]
    return range_m, sigma


def widened_sigma_px(
    camera: StereoCamera,
    disparity_px: ArrayLike,
    sigma_px: ArrayLike,
    *,
    motion_sigma_m: ArrayLike,
    motion_rule: str = "rss",
) -> FloatArray:
    """The disparity sigma that carries eps of Eq. 13 as well [px], any shape.

    dz = z^2 dd / (b f) + eps is, in disparity space, dd + eps d^2 / (b f): one number a pixel. motion_rule: one of
    MOTION_RULES.
    """
    if motion_rule not in MOTION_RULES:
        raise unknown_name("motion rule", motion_rule, MOTION_RULES)
    eps_px = as_floats(motion_sigma_m) * np.square(as_floats(disparity_px)) / camera.focal_baseline_px_m
    if motion_rule == "linear":
        return as_floats(sigma_px) + eps_px
    widened: FloatArray = np.hypot(sigma_px, eps_px)
    return widened


def odds(probability: float) -> float:
    """p / (1 - p)."""
    return probability / (1 - probability)


def likelihood_ratios(model: SensorModel) -> tuple[float, float]:
    """How much likelier an occupied cell makes a reading whose surface is certainly in it (A), or behind it (F)."""
    return odds(model.p_occupied) / odds(model.prior), odds(model.p_free) / odds(model.prior)


def likelihood_ratio(
    range_m: ArrayLike, measured_range_m: ArrayLike, sigma_m: ArrayLike, *, cell_m: float, model: SensorModel
) -> FloatArray:
    """P(reading | cell occupied) / P(reading | free) of a cell of cell_m centred at range_m on the reading's ray.

    With u = (l - l_p) / dl and h = cell / (2 dl), the surface lies
      in the cell      with probability Phi(u + h) - Phi(u - h)   (Eq. 11: never above 1),
      behind the cell  with 1 - Phi(u + h)                        (the ray has passed through it),
      before the cell  with Phi(u - h)                            (the reading says nothing of it),
    and the ratio is the mean of A, F and 1 with these weights (Eq. 12). Arguments broadcast; from F to A.
    """
    hit, passed = likelihood_ratios(model)
    sigma = as_floats(sigma_m)
    u = (as_floats(range_m) - as_floats(measured_range_m)) / sigma
    half = 0.5 * cell_m / sigma
    ratio: FloatArray = passed + (hit - passed) * ndtr(u + half) - (hit - 1) * ndtr(u - half)
    return ratio


def occupancy_probability(
    range_m: ArrayLike, measured_range_m: ArrayLike, sigma_m: ArrayLike, *, cell_m: float, model: SensorModel
) -> FloatArray:
    """p(occupied) of a cell of cell_m whose centre lies at range_m on the ray of one reading. Eqs. 11 and 12.

    The posterior of the prior under likelihood_ratio: from p_free far in front of the surface over at most p_occupied
    to the prior far behind it. Arguments broadcast; in (0, 1) for every range, sigma and cell size.
    """
    ratio = likelihood_ratio(range_m, measured_range_m, sigma_m, cell_m=cell_m, model=model)
    posterior = ratio * odds(model.prior)
    p: FloatArray = posterior / (1 + posterior)
    return p


def reach_behind(model: SensorModel) -> float:
    """A cell that begins further behind the surface than this [sigmas] learns nothing."""
    return REACH_SIGMAS if model.form == "printed" else REACH_BEHIND_SIGMAS


KernelModel = tuple[float, float, float, bool, float, float]


def kernel_parameters(model: SensorModel) -> KernelModel:
    """(p_free, p_occupied, prior, printed, reach before, reach behind [sigmas]): the model as the kernels take it.

    Arguments, not constants of the kernels: Numba's cache does not notice when another module's constant changes.
    """
    return model.p_free, model.p_occupied, model.prior, model.form == "printed", REACH_SIGMAS, reach_behind(model)
