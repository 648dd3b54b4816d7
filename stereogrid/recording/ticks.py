"""The robot's motion between the observations, as a simulator knows it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from ..errors import InvalidInputError
from ..geometry import FloatArray, between
from ..observation import Recording


@dataclass(frozen=True)
class Ticks:
    """What the robot did, tick by tick: far more often than it takes pictures.

    stamp_s (K,): increasing [s]. T_world_base (K, 4, 4): its true poses. wheels_rad (K, 2): how far the left and
    the right wheels have turned since the start [rad].
    """

    stamp_s: FloatArray
    T_world_base: FloatArray
    wheels_rad: FloatArray

    def __post_init__(self) -> None:
        count = len(self.stamp_s)
        if count == 0 or self.T_world_base.shape != (count, 4, 4) or self.wheels_rad.shape != (count, 2):
            raise InvalidInputError(
                f"ticks must have (K,) stamps, (K, 4, 4) poses and (K, 2) turns of the wheels, not "
                f"{self.stamp_s.shape}, {self.T_world_base.shape} and {self.wheels_rad.shape}"
            )
        if not (np.diff(self.stamp_s) > 0).all():
            raise InvalidInputError("the stamps of the ticks must increase")

    def __len__(self) -> int:
        return len(self.stamp_s)

    def T_world_base_at(self, time_s: float) -> FloatArray:
        """The true pose (4, 4) at a time [s], between two ticks on the shortest way; before the first that of the
        first, after the last that of the last."""
        k = int(np.searchsorted(self.stamp_s, time_s, side="right"))
        if k == 0 or k == len(self):
            end: FloatArray = self.T_world_base[min(k, len(self) - 1)].copy()
            return end
        times, poses = self.stamp_s[k - 1 : k + 1], self.T_world_base[k - 1 : k + 1]
        share = (time_s - times[0]) / (times[1] - times[0])
        return between(poses[0], poses[1], share)


@runtime_checkable
class KnowsMotion(Recording, Protocol):
    """A recording that may know the robot's motion between its observations, and tells of what world it is."""

    @property
    def metadata(self) -> Mapping[str, str]:
        """What is known of the drive, such as its world and seed."""
        ...

    def ticks(self) -> Ticks | None:
        """The robot's true motion tick by tick, or None."""
        ...
