"""The robot's motion error: seeded odometry noise, and eps of Eq. 13."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .errors import InvalidInputError
from .geometry import FloatArray, from_yaw, inverse, yaw_rad
from .observation import Observation, Odometry, Recording


@dataclass(frozen=True)
class MotionError:
    """eps as a function of the distance since the pose was last certain: eps^2 = kappa^2 (a d + b^2 d^2).

    a_m [m]: random slip; b [1]: scale error from run to run; kappa: eps in the same coverage as the disparity
    sigma (1 = one standard deviation). Both zero: poses are taken as exact.
    """

    a_m: float = 0.0
    b: float = 0.0
    kappa: float = 1.0

    def __post_init__(self) -> None:
        for name in ("a_m", "b", "kappa"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InvalidInputError(f"{name} must be >= 0 and finite, not {getattr(self, name)}")

    def sigma_m(self, odometry: Odometry) -> float:
        """eps [m] of Eq. 13 at this reading."""
        d = odometry.travelled_m
        return float(self.kappa * np.sqrt(self.a_m * d + np.square(self.b * d)))


@dataclass(frozen=True)
class OdometryNoise:
    """The field's four alphas, as variances that grow with the path, so that the sampling rate does not matter.

    var(turn) = rotation_per_rad |turn| + rotation_per_m path [rad^2];
    var(path) = translation_per_m path + translation_per_rad |turn| [m^2].
    After Thrun, Burgard and Fox, Probabilistic Robotics, section 5.4 (whose variances are of one step).
    """

    rotation_per_rad: float = 0.0
    rotation_per_m: float = 0.0
    translation_per_m: float = 0.0
    translation_per_rad: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise InvalidInputError(f"{name} must be >= 0 and finite, not {value}")

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


class NoisyOdometry:
    """A recording whose odometry is perturbed as it is read; truth and images stay as they were."""

    def __init__(self, recording: Recording, noise: OdometryNoise, seed: int) -> None:
        self.camera, self.T_base_cam = recording.camera, recording.T_base_cam
        self._recording, self._noise, self._seed = recording, noise, seed

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[Observation]:
        rng = np.random.default_rng(self._seed)
        T_odom_before = T_noisy = None
        for observation in self._recording:
            T_odom_base = observation.odometry.T_odom_base
            if T_odom_before is None or T_noisy is None:
                T_noisy = T_odom_base
            else:
                T_noisy = T_noisy @ self._noise.perturbed(inverse(T_odom_before) @ T_odom_base, rng)
            T_odom_before = T_odom_base
            odometry = replace(observation.odometry, T_odom_base=T_noisy)
            yield replace(observation, odometry=odometry, T_world_cam=T_noisy @ self.T_base_cam)
