"""What each leg of a run, from mark to mark, adds to the error of the odometry, and how much of it is the measuring."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..geometry import FloatArray
from .runs import Run

Leg = tuple[FloatArray, FloatArray, FloatArray]
"""Errors (m,) that the legs add, lengths (m,) of the legs [m or rad], covariance (m, m) of what measuring adds."""


@dataclass(frozen=True)
class Measured:
    """How well the truth is known at a mark and at the start: standard deviations of each of x and y [m], of headings.

    Of the odometry's rounding too. Zero takes it as exact; then what the measuring errs by is taken for random slip.
    """

    position_m: float = 0.0
    heading_rad: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise InvalidInputError(f"{name} must be >= 0 and finite, not {value}")

    def along(self, run: Run) -> Leg:
        """Along the way, odometry - truth [m]."""
        return _planar(run)[0], run.steps_m, self._differences(run, self.position_m)

    def across(self, run: Run, heading_a: float = 0.0) -> Leg:
        """To the left of the way: what the heading's error at the marks does not explain [m].

        Between marks a heading that wanders by heading_a [rad^2/m] is off by more than the chord between its errors
        at them: as a Brownian bridge, by heading_a h^3 / 12 over a leg h.
        """
        noise, steps = self._differences(run, self.position_m), run.steps_m
        if run.has_headings:
            means = steps[:, None] * 0.5 * (_later(run) + _earlier(run))
            noise = noise + self.heading_rad**2 * means @ means.T + np.diag(heading_a * steps**3 / 12)
        return _planar(run)[1], steps, noise

    def heading(self, run: Run) -> Leg:
        """Of the heading, over a straight run [rad over m]."""
        return _headings(run), run.steps_m, self._differences(run, self.heading_rad)

    def turn(self, run: Run) -> Leg:
        """Of the heading, over a turn on the spot: positive where odometry turns too far [rad over rad]."""
        sign = np.sign(run.turns_rad.sum())
        return sign * _headings(run), np.abs(run.turns_rad), self._differences(run, self.heading_rad)

    def _differences(self, run: Run, sigma: float) -> FloatArray:
        """Of the differences of neighbours that err by sigma each."""
        across_legs = _later(run) - _earlier(run)
        covariance: FloatArray = sigma**2 * across_legs @ across_legs.T
        return covariance


EXACT = Measured()
"""A truth without error."""
LegsOf = Callable[[Run], Leg]


def _later(run: Run) -> FloatArray:
    return np.eye(len(run.true))[1:]


def _earlier(run: Run) -> FloatArray:
    return np.eye(len(run.true))[:-1]


def _headings(run: Run) -> FloatArray:
    """How much further odometry turns than the truth from mark to mark (m,) [rad]."""
    erred: FloatArray = np.diff(np.unwrap(run.odo[:, 2])) - run.turns_rad
    return erred


def _planar(run: Run) -> tuple[FloatArray, FloatArray]:
    """What the legs add along the true way and to its left, (m,) each [m].

    With headings each leg of the odometry is laid from where the robot truly stood, in its true heading, and turned
    back by half of what its heading errs by within the leg: what is left is none of the heading's.
    """
    odo, true = (np.diff(values[:, 0] + 1j * values[:, 1]) for values in (run.odo, run.true))
    if run.has_headings:
        odo = odo * np.exp(-1j * (run.odo[:-1, 2] - run.true[:-1, 2] + 0.5 * _headings(run)))
    erred = (odo - true) * np.exp(-1j * np.angle(true))
    return erred.real, erred.imag
