"""What makes wheel odometry err, cause by cause, applied when a recording is read.

Where stereogrid.motion.OdometryNoise is the field's statistical model, these are the causes: the same wheels turned as
the recording's ticks say, and a robot with these faults would have believed something else.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stereogrid.errors import InvalidInputError, RecordingError, unknown_name
from stereogrid.geometry import FloatArray, from_yaw
from stereogrid.observation import Observation, Odometry, Recording
from stereogrid.recording import KnowsMotion, Ticks, stamps_s

from .odometry import EFFECTIVE_TRACK_M, WHEEL_RADIUS_M


@dataclass(frozen=True)
class WheelFaults:
    """One number a cause; zero is none of it.

    left_radius, right_radius: by what share the believed radius is too large. track: by what share the believed track
    is. slip: how much further than the ground wheels run, as a share; it varies from 0 up, the same over about
    slip_length_m, each side for itself. encoder_m: what one tick of the encoders stands for. heading: random walk of
    the believed heading [rad per root of a metre that the wheels run].
    """

    left_radius: float = 0.0
    right_radius: float = 0.0
    track: float = 0.0
    slip: float = 0.0
    slip_length_m: float = 0.5
    encoder_m: float = 0.0
    heading: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value):
                raise InvalidInputError(f"{name} must be finite, not {value}")
        for name in ("left_radius", "right_radius", "track"):
            if not abs(getattr(self, name)) < 0.5:
                raise InvalidInputError(f"{name} must be between -0.5 and 0.5, not {getattr(self, name)}")
        for name in ("slip", "encoder_m", "heading"):
            if not 0 <= getattr(self, name) <= 1:
                raise InvalidInputError(f"{name} must be 0 to 1, not {getattr(self, name)}")
        if not self.slip_length_m > 0:
            raise InvalidInputError(f"slip_length_m must be positive, not {self.slip_length_m}")

    def believed(self, wheels_rad: FloatArray, rng: np.random.Generator) -> FloatArray:
        """What a robot whose wheels turned so far (K, 2) believes, from the start on.

        Returns (K, 5): x, y [m] and heading [rad] in odom, and the lengths of its way [m] and of its turns [rad].
        """
        # A stream a cause, so that one more leaves the others as they were.
        slipping, straying = rng.spawn(2)
        left_m, right_m = WHEEL_RADIUS_M * np.diff(self._reported_rad(wheels_rad, slipping), axis=0).T
        ahead_m, turn_rad = 0.5 * (left_m + right_m), (right_m - left_m) / (EFFECTIVE_TRACK_M * (1 + self.track))
        stray_rad = self.heading * np.sqrt(0.5 * (abs(left_m) + abs(right_m))) * straying.standard_normal(len(ahead_m))
        heading_rad = np.cumsum(turn_rad + stray_rad)
        # As WheelOdometry: the chord of each tick's arc; what strays, strays after it.
        chord_m, along_rad = ahead_m * np.sinc(turn_rad / (2 * np.pi)), heading_rad - stray_rad - 0.5 * turn_rad
        x_m, y_m = chord_m * np.cos(along_rad), chord_m * np.sin(along_rad)
        steps = [x_m, y_m, turn_rad + stray_rad, abs(ahead_m), abs(turn_rad)]
        return np.concatenate([np.zeros((1, 5)), np.cumsum(steps, axis=1).T])

    def _reported_rad(self, wheels_rad: FloatArray, rng: np.random.Generator) -> FloatArray:
        """The turns (K, 2) that the encoders report, by the believed radius."""
        turned = np.diff(wheels_rad, axis=0)
        if self.slip > 0:
            turned *= 1 + self.slip * np.abs(_wander(WHEEL_RADIUS_M * np.abs(turned) / self.slip_length_m, rng))
        total = np.concatenate([np.zeros((1, 2)), np.cumsum(turned, axis=0)])
        if self.encoder_m > 0:
            tick_rad = self.encoder_m / WHEEL_RADIUS_M
            total = np.round(total / tick_rad) * tick_rad
        reported: FloatArray = total * (1 + np.array([self.left_radius, self.right_radius]))
        return reported


WHEEL_FAULTS: dict[str, WheelFaults] = {
    "none": WheelFaults(),
    # 34,000 ticks a turn of the wheel, and a robot that was calibrated on the day before.
    "good": WheelFaults(left_radius=0.002, right_radius=0.001, track=0.01, slip=0.003, encoder_m=2e-5, heading=0.002),
    # Tyres of unequal pressure, and a track that was taken from the manual.
    "worn": WheelFaults(left_radius=0.012, right_radius=0.006, track=0.05, slip=0.02, encoder_m=2e-5, heading=0.01),
}


def wheel_faults(name: str) -> WheelFaults:
    """The preset of that name. Raises InvalidInputError for an unknown one."""
    if name not in WHEEL_FAULTS:
        raise unknown_name("wheel faults", name, WHEEL_FAULTS)
    return WHEEL_FAULTS[name]


class FaultyWheels:
    """A recording as a robot with such wheels would have made it: its odometry alone differs.

    Raises RecordingError when the recording does not hold the turns of the wheels.
    """

    def __init__(self, recording: Recording, faults: WheelFaults, seed: int) -> None:
        ticks = recording.ticks() if isinstance(recording, KnowsMotion) else None
        if not isinstance(recording, KnowsMotion) or ticks is None:
            raise RecordingError(
                "wheel faults need the turns of the wheels, which this recording does not hold; the simulator's do"
            )
        self.camera, self.T_base_cam = recording.camera, recording.T_base_cam
        self._recording, self._faults, self._seed, self._ticks = recording, faults, seed, ticks

    @property
    def metadata(self) -> Mapping[str, str]:
        """That of the recording."""
        return self._recording.metadata

    def ticks(self) -> Ticks:
        """The robot's true motion, as recorded."""
        return self._ticks

    @cached_property
    def stamps_s(self) -> FloatArray:
        """The stamps (M,) [s], without taking pictures."""
        return stamps_s(self._recording)

    @cached_property
    def poses(self) -> FloatArray:
        """The claimed T_world_cam (M, 4, 4), without taking pictures."""
        beliefs = self._odometry(self.stamps_s)
        return np.array([each.T_odom_base @ self.T_base_cam for each in beliefs]).reshape(-1, 4, 4)

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[Observation]:
        for observation in self._recording:
            (odometry,) = self._odometry(np.array([observation.stamp_s]))
            yield replace(observation, odometry=odometry, T_world_cam=odometry.T_odom_base @ self.T_base_cam)

    def _odometry(self, times_s: FloatArray) -> Iterator[Odometry]:
        """What the robot believes at times (N,), by the latest tick."""
        # A nanosecond is what a stamp in a file may be rounded by.
        latest = np.searchsorted(self._ticks.stamp_s - 1e-9, times_s, side="right") - 1
        for x_m, y_m, heading_rad, travelled_m, turned_rad in self._believed[np.maximum(latest, 0)]:
            yield Odometry(from_yaw(heading_rad, (x_m, y_m, 0.0)), travelled_m, turned_rad)

    @cached_property
    def _believed(self) -> FloatArray:
        return self._faults.believed(self._ticks.wheels_rad, np.random.default_rng(self._seed))


def _wander(steps: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A process (K, 2) of unit variance in each column whose correlation falls by e over a sum of steps of 1."""
    keep = np.exp(-steps)
    fresh = np.sqrt(1 - keep**2) * rng.standard_normal(steps.shape)
    out = np.empty_like(steps)
    now = rng.standard_normal((steps.shape[1],)).tolist()
    for column in range(steps.shape[1]):
        # Plain numbers: on single elements of arrays the loop would take ten times as long.
        for k, (share, new) in enumerate(zip(keep[:, column].tolist(), fresh[:, column].tolist(), strict=True)):
            now[column] = share * now[column] + new
            out[k, column] = now[column]
    return out
