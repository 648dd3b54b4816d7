"""People and things that move through a world on given paths."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, from_yaw

from .solids import Solid

TURN_RADPS = 2.0
"""Whoever pushes a trolley sweeps its end round at some 2 m/s, and turns about in 1.6 s."""


@dataclass(frozen=True)
class Mover:
    """A rigid body that walks along waypoints_m (N, 2) [m] at speed_mps, to the end and back, for ever.

    At bends and ends it stops and turns on the spot at TURN_RADPS.
    solids: its body in its own frame: x forward, z up, z = 0 on the ground. start_m: where on its way it is at
    time 0 [m]. Where it is follows from the time alone, so that everyone agrees on it.
    """

    name: str
    solids: tuple[Solid, ...]
    waypoints_m: FloatArray
    speed_mps: float
    start_m: float = 0.0

    def __post_init__(self) -> None:
        if self.waypoints_m.ndim != 2 or self.waypoints_m.shape[1] != 2 or len(self.waypoints_m) < 2:
            raise InvalidInputError(f"the way of {self.name!r} must be (N >= 2, 2), not {self.waypoints_m.shape}")
        if not (np.linalg.norm(np.diff(self.waypoints_m, axis=0), axis=1) > 0).all():
            raise InvalidInputError(f"the way of {self.name!r} has two equal points in a row")
        if not (np.isfinite(self.speed_mps) and self.speed_mps >= 0):
            raise InvalidInputError(f"speed_mps of {self.name!r} must be >= 0, not {self.speed_mps}")

    def mesh(self) -> trimesh.Trimesh:
        """Its body as one mesh in its own frame [m]."""
        return trimesh.util.concatenate([solid.mesh() for solid in self.solids])

    def T_world_mover(self, time_s: float) -> FloatArray:
        """Its pose (4, 4) at a time since the start [s], on the plane z = 0."""
        x, y, yaw = self.places(np.array([time_s]))[0]
        return from_yaw(float(yaw), (x, y, 0.0))

    def places(self, times_s: FloatArray) -> FloatArray:
        """x, y [m] and heading [rad], whole turns and all, (T, 3) at times (T,) since the start [s]."""
        stations, clock_s, stops = self._round
        start_s = np.interp(self.start_m % stations[-1], stations, clock_s)
        at_s = (start_s + (times_s if self.speed_mps > 0 else 0 * times_s)) % clock_s[-1]
        return np.stack([np.interp(at_s, clock_s, stops[:, k]) for k in range(3)], axis=1)

    @cached_property
    def _round(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """There and back: at each start and end of a leg, how far it has walked [m], the time [s], and x, y, heading.

        Between two of them it walks straight on or turns on the spot.
        """
        points = np.concatenate([self.waypoints_m, self.waypoints_m[-2::-1]])
        legs = np.diff(points, axis=0)
        headings = np.arctan2(legs[:, 1], legs[:, 0])
        turns = np.remainder(np.diff(headings, append=headings[0]) + np.pi, 2 * np.pi) - np.pi
        # Rounding shall not choose the side to which it turns about.
        turns[[len(legs) // 2 - 1, -1]] = np.pi
        yaws = headings[0] + np.concatenate([[0.0], np.cumsum(turns)])
        walks_m = np.linalg.norm(legs, axis=1)
        stops = np.stack([np.c_[points[:-1], yaws[:-1]], np.c_[points[1:], yaws[:-1]]], axis=1).reshape(-1, 3)
        stops = np.concatenate([stops, [[*points[-1], yaws[-1]]]])
        steps_m = np.stack([walks_m, 0 * walks_m], axis=1).ravel()
        # One that stands still has a place on its way, but no time.
        steps_s = np.stack([walks_m / (self.speed_mps or 1.0), np.abs(turns) / TURN_RADPS], axis=1).ravel()
        return _sums(steps_m), _sums(steps_s), stops


def _sums(steps: FloatArray) -> FloatArray:
    sums: FloatArray = np.concatenate([[0.0], np.cumsum(steps)])
    return sums
