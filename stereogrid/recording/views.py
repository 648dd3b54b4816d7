"""Recordings seen in another way: with true poses, in part, or with their poses in disorder."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Protocol, runtime_checkable

import numpy as np

from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray, from_yaw, inverse, yaw_rad
from ..observation import Observation, Recording


@runtime_checkable
class _KnowsPoses(Protocol):
    poses: FloatArray


def poses(recording: Recording) -> FloatArray:
    """The claimed T_world_cam (M, 4, 4) of all observations, without decoding images where that can be."""
    if isinstance(recording, _KnowsPoses):
        return recording.poses
    return np.array([each.T_world_cam for each in recording]).reshape(-1, 4, 4)


@runtime_checkable
class _KnowsStamps(Protocol):
    stamps_s: FloatArray


def stamps_s(recording: Recording) -> FloatArray:
    """The stamps (M,) of all observations [s], without decoding images where that can be."""
    if isinstance(recording, _KnowsStamps):
        return recording.stamps_s
    return np.array([each.stamp_s for each in recording], dtype=float)


class _ByTruth:
    """A recording that claims other poses, which its truth helps to tell; T_odom_base agrees with them.

    travelled_m and turned_rad stay as the odometry has them. Raises RecordingError when an observation
    carries no truth; the first one is tried at once.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.camera = recording.camera
        self.T_base_cam = recording.T_base_cam
        next(iter(self), None)

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[Observation]:
        for each in self._recording:
            if each.truth is None:
                raise RecordingError(f"the observation at {each.stamp_s} s carries no true pose")
            claimed = self._claimed(each, each.truth.T_world_cam)
            yield _with_pose(each, claimed, self.T_base_cam)

    def _claimed(self, each: Observation, T_world_cam: FloatArray) -> FloatArray:
        """The pose to claim of an observation whose true one is T_world_cam."""
        raise NotImplementedError


class TruePoses(_ByTruth):
    """A recording that claims its true poses: T_world_cam is the truth, T_odom_base agrees with it.

    Raises RecordingError when an observation carries no truth; the first one is tried at once.
    """

    def _claimed(self, each: Observation, T_world_cam: FloatArray) -> FloatArray:  # noqa: ARG002
        return T_world_cam


class TrueTilt(_ByTruth):
    """A recording that claims its own x, y and heading, and the true height, roll and pitch.

    As a robot on uneven ground with an inclinometer: wheels alone know of no slope. Raises RecordingError when an
    observation carries no truth; the first one is tried at once.
    """

    def _claimed(self, each: Observation, T_world_cam: FloatArray) -> FloatArray:
        claimed, true = (T @ inverse(self.T_base_cam) for T in (each.T_world_cam, T_world_cam))
        tilted = from_yaw(yaw_rad(claimed) - yaw_rad(true)) @ true
        tilted[:3, 3] = [*claimed[:2, 3], true[2, 3]]
        return tilted @ self.T_base_cam


class Subset:
    """The observations start, start + stride, ... before stop of a recording, as a slice takes them.

    Raises InvalidInputError unless 0 <= start, 0 <= stop and 1 <= stride.
    """

    def __init__(self, recording: Recording, start: int = 0, stop: int | None = None, stride: int = 1) -> None:
        if start < 0 or stride < 1 or (stop is not None and stop < 0):
            raise InvalidInputError(
                f"a subset needs start >= 0, stop >= 0 and stride >= 1, not {start}, {stop} and {stride}"
            )
        self._recording = recording
        self._slice = slice(start, stop, stride)
        self.camera = recording.camera
        self.T_base_cam = recording.T_base_cam

    def __len__(self) -> int:
        return len(range(len(self._recording))[self._slice])

    def __iter__(self) -> Iterator[Observation]:
        return islice(iter(self._recording), self._slice.start, self._slice.stop, self._slice.step)


class ShuffledPoses:
    """A negative control: each observation claims the position of another and a heading drawn anew, by rng_seed.

    Permuted positions alone would not do: a corridor looks alike from anywhere in it. Height, roll and pitch
    stay, so a level floor survives. Everything else, truth too, stays with its images; T_odom_base agrees with
    the claimed pose.
    """

    def __init__(self, recording: Recording, rng_seed: int) -> None:
        self._recording = recording
        self.camera = recording.camera
        self.T_base_cam = recording.T_base_cam
        rng = np.random.default_rng(rng_seed)
        self.poses: FloatArray = rng.permutation(poses(recording))
        for T_world_cam in self.poses:
            T_world_cam[:3, :3] = from_yaw(rng.uniform(-np.pi, np.pi))[:3, :3] @ T_world_cam[:3, :3]

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[Observation]:
        for each, T_world_cam in zip(self._recording, self.poses, strict=True):
            yield _with_pose(each, T_world_cam, self.T_base_cam)


def _with_pose(observation: Observation, T_world_cam: FloatArray, T_base_cam: FloatArray) -> Observation:
    odometry = replace(observation.odometry, T_odom_base=T_world_cam @ inverse(T_base_cam))
    return replace(observation, T_world_cam=T_world_cam, odometry=odometry)
