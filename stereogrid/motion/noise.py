"""Seeded odometry noise, applied when a recording is read."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Protocol

import numpy as np

from ..described import Doc, check_fields
from ..geometry import FloatArray, from_yaw, inverse, yaw_rad
from ..observation import Observation, Odometry, Recording
from .error import MotionError

Walk = Callable[[FloatArray], FloatArray]
"""Takes the true steps T_before_after (4, 4) of one run in their order, and returns the pose (4, 4) it then claims."""


class Noise(Protocol):
    """What makes odometry err."""

    def walk(self, T_odom_base: FloatArray, rng: np.random.Generator) -> Walk:
        """One run from T_odom_base (4, 4), whose noise is drawn from rng."""
        ...


@dataclass(frozen=True)
class OdometryNoise:
    """The field's four alphas, as variances that grow with the path, so that the sampling rate does not matter.

    var(turn) = rotation_per_rad |turn| + rotation_per_m path [rad^2];
    var(path) = translation_per_m path + translation_per_rad |turn| [m^2].
    After Thrun, Burgard and Fox, Probabilistic Robotics, section 5.4 (whose variances are of one step).
    """

    rotation_per_rad: Annotated[float, Doc("Variance of the turn for each radian turned.", "rad^2/rad", least=0)] = 0.0
    rotation_per_m: Annotated[float, Doc("Variance of the turn for each metre of path.", "rad^2/m", least=0)] = 0.0
    translation_per_m: Annotated[float, Doc("Variance of the path for each metre of it.", "m^2/m", least=0)] = 0.0
    translation_per_rad: Annotated[float, Doc("Variance of the path for each radian turned.", "m^2/rad", least=0)] = 0.0

    def __post_init__(self) -> None:
        check_fields(self)

    def walk(self, T_odom_base: FloatArray, rng: np.random.Generator) -> Walk:
        """One run from T_odom_base (4, 4)."""
        T_noisy = T_odom_base

        def claim(T_before_after: FloatArray) -> FloatArray:
            nonlocal T_noisy
            T_noisy = T_noisy @ self.perturbed(T_before_after, rng)
            return T_noisy

        return claim

    def perturbed(self, T_before_after: FloatArray, rng: np.random.Generator) -> FloatArray:
        """The step T_before_after (4, 4) as a robot with this noise would report it."""
        step = T_before_after.copy()
        path_m = float(np.linalg.norm(step[:3, 3]))
        turn_rad = abs(yaw_rad(step))
        rotation_sd = np.sqrt(self.rotation_per_rad * turn_rad + self.rotation_per_m * path_m)
        translation_sd = np.sqrt(self.translation_per_m * path_m + self.translation_per_rad * turn_rad)
        first, along, second = rng.standard_normal(3)
        # A turn on the spot slips too: along the heading, where the step itself has no direction.
        direction = step[:3, 3] / path_m if path_m > 0 else step[:3, 0]
        step[:3, 3] += along * translation_sd * direction
        # The turn's error is split between the start and the end of the step, as in the motion model's two turns.
        half_rad = rotation_sd / np.sqrt(2)
        return from_yaw(first * half_rad) @ step @ from_yaw(second * half_rad)


@dataclass(frozen=True)
class MotionNoise:
    """Noise that errs just as a MotionError says: what is fitted to it, or fused with it, can be held against it.

    Normal errors throughout. The run's own scale, drift, bend and turn scale are drawn first; then each step's.
    """

    error: MotionError

    def walk(self, T_odom_base: FloatArray, rng: np.random.Generator) -> Walk:
        """One run from T_odom_base (4, 4)."""
        e = self.error
        scale, drift, bend, turn_scale = rng.standard_normal(4) * [e.along.b, e.across.b, e.heading.b, e.turn.b]
        T_walked = T_odom_base

        def claim(T_before_after: FloatArray) -> FloatArray:
            nonlocal T_walked
            path_m, turn_rad = float(np.linalg.norm(T_before_after[:3, 3])), yaw_rad(T_before_after)
            drawn = rng.standard_normal(7)
            along_m = drawn[0] * np.sqrt(e.along.a * path_m)
            across_m = drift * path_m + drawn[1] * np.sqrt(e.across.a * path_m)
            steady_rad = turn_scale * turn_rad + bend * path_m
            sd_rad = np.sqrt(e.heading.a * path_m + e.turn.a * abs(turn_rad))
            wander_rad = drawn[2] * sd_rad
            # The step goes where it heads for on the whole: half of what is steady, the mean of what wanders.
            mean_rad = 0.5 * steady_rad + 0.5 * wander_rad + drawn[3] * sd_rad / np.sqrt(12)
            step = T_before_after.copy()
            step[:3, 3] = step[:3, 3] * (1 + scale) + from_yaw(0.5 * turn_rad)[:3, :2] @ [along_m, across_m]
            T_walked = T_walked @ from_yaw(mean_rad) @ step @ from_yaw(steady_rad + wander_rad - mean_rad)
            x_m, y_m = drawn[4:6] * e.position_m
            claimed: FloatArray = from_yaw(0.0, (x_m, y_m, 0.0)) @ T_walked @ from_yaw(drawn[6] * e.heading_rad)
            return claimed

        return claim


class NoisyOdometry:
    """A recording whose odometry is perturbed as it is read; truth and images stay as they were.

    Where travelled_m falls the pose is known again, and the noise begins anew.
    """

    def __init__(self, recording: Recording, noise: Noise, seed: int) -> None:
        self.camera, self.T_base_cam = recording.camera, recording.T_base_cam
        self._recording, self._noise, self._seed = recording, noise, seed

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[Observation]:
        rng = np.random.default_rng(self._seed)
        before: Odometry | None = None
        claim: Walk | None = None
        for observation in self._recording:
            odometry = observation.odometry
            T_odom_base = odometry.T_odom_base
            if before is None or claim is None or odometry.travelled_m < before.travelled_m:
                # The pose is known, at the start or again.
                T_noisy, claim = T_odom_base, self._noise.walk(T_odom_base, rng)
            else:
                T_noisy = claim(inverse(before.T_odom_base) @ T_odom_base)
            before = odometry
            odometry = replace(odometry, T_odom_base=T_noisy)
            yield replace(observation, odometry=odometry, T_world_cam=T_noisy @ self.T_base_cam)
