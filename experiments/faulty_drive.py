"""One drive as a rig and wheels with faults give it, with any of the faults made true."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sim.faults import CameraFaults, FaultyCameras
from sim.faults.optics import unknown_rotation
from stereogrid.camera import StereoCamera
from stereogrid.config import MatcherConfig
from stereogrid.geometry import FloatArray
from stereogrid.motion import MotionError, MotionNoise, NoisyOdometry
from stereogrid.observation import Disparity, Observation, Recording
from stereogrid.recording import TruePoses

from .drives import TRUE_SIGMA_PX, true_disparity

Reading = tuple[Observation, Disparity]


@dataclass(frozen=True)
class HeldRecording:
    """A recording whose observations are kept in memory."""

    camera: StereoCamera
    T_base_cam: FloatArray
    observations: Sequence[Observation]

    def __len__(self) -> int:
        return len(self.observations)

    def __iter__(self) -> Iterator[Observation]:
        return iter(self.observations)


@dataclass(frozen=True)
class FaultyDrive:
    """A drive, the faults of its cameras, the error of its odometry, and the seed that both are drawn with."""

    drive: Recording
    faults: CameraFaults
    motion_error: MotionError
    seed: int

    def readings(self, matcher: MatcherConfig | None, *, images: bool, calibration: bool) -> Iterator[Reading]:
        """Observations in their order, each with its disparity; poses are the drive's own.

        images, calibration: whether these are as faulty as they are, or true. matcher None: the true disparity, of
        what the cameras' calibration takes for rectified images.
        """
        if matcher is None:
            turned = replace(CameraFaults(), calibration_error_deg=self.faults.calibration_error_deg * calibration)
            R = unknown_rotation(turned, self.seed)
            yield from ((each, displaced_disparity(self.drive.camera, each, R)) for each in self._clean)
            return
        match = matcher.build().match
        yield from ((each, match(each.left, each.right)) for each in self._seen(images, calibration))

    def poses(self, *, true: bool) -> Callable[[Observation], Observation]:
        """Gives an observation the pose that it then claims. The noise is the same whatever pairs the cameras drop."""
        noise = MotionNoise(self.motion_error)
        known = TruePoses(self._clean) if true else NoisyOdometry(self._clean, noise, self.seed)
        by_stamp = {each.stamp_s: each for each in known}

        def claimed(each: Observation) -> Observation:
            other = by_stamp[each.stamp_s]
            return replace(each, odometry=other.odometry, T_world_cam=other.T_world_cam)

        return claimed

    def _seen(self, images: bool, calibration: bool) -> Recording:
        still = replace(self.faults, time_skew_s=0.0, rolling_shutter_s=0.0)
        faults = still if images else replace(CameraFaults(), calibration_error_deg=still.calibration_error_deg)
        if not calibration:
            faults = replace(faults, calibration_error_deg=0.0)
        return FaultyCameras(self._late if images else self._clean, faults, self.seed)

    @cached_property
    def _clean(self) -> HeldRecording:
        return HeldRecording(self.drive.camera, self.drive.T_base_cam, list(self.drive))

    @cached_property
    def _late(self) -> HeldRecording:
        """The pictures taken when the cameras take them: to draw them takes longest, and all arms share them."""
        when = replace(
            CameraFaults(), time_skew_s=self.faults.time_skew_s, rolling_shutter_s=self.faults.rolling_shutter_s
        )
        seen = FaultyCameras(self.drive, when, self.seed)
        return HeldRecording(seen.camera, seen.T_base_cam, list(seen)) if when.needs_motion else self._clean


def displaced_disparity(camera: StereoCamera, observation: Observation, R_calibrated_true: FloatArray) -> Disparity:
    """What a perfect matcher finds if the right camera is turned by R (3, 3) and its calibration does not know it.

    The true disparity, displaced as the right picture is; that a point then lies on another row does not stop it.
    """
    true = true_disparity(camera, observation)
    if np.array_equal(R_calibrated_true, np.eye(3)):
        return true
    in_right = camera.back_project(true.disparity_px) - [camera.baseline_m, 0.0, 0.0]
    seen = in_right @ R_calibrated_true  # R^T p, as rows
    at_px = camera.focal_px * seen[:, 0] / seen[:, 2]
    should_px = camera.focal_px * in_right[:, 0] / in_right[:, 2]
    disparity_px = true.disparity_px.copy()
    disparity_px[true.valid] -= at_px - should_px
    disparity_px[~(disparity_px > 0)] = np.nan
    return Disparity(disparity_px, np.full_like(disparity_px, TRUE_SIGMA_PX))
