"""How much of an observation is new: frames from one place repeat most of their errors.

A matcher's error at a surface point has a part that changes from frame to frame and one that stays while the camera
does (measured, see matching/correlation.py). A robot that waits would otherwise grow ever surer of the same mistake.
"""

import numpy as np

from .camera import StereoCamera
from .geometry import FloatArray, inverse, transform
from .matching.correlation import ErrorReach
from .observation import Disparity

STRIDE_PX = 16
"""Every 16th pixel of every 16th row tells the motion of the image."""


class Novelty:
    """Weighs the observations of one drive, in their order, by the camera's motion since the one before."""

    def __init__(self, camera: StereoCamera, reach: ErrorReach | None) -> None:
        self._camera, self._reach = camera, reach
        self._T_world_before: FloatArray | None = None

    def weight(self, disparity: Disparity, T_world_cam: FloatArray) -> float:
        """Share (0, 1] of this observation's evidence that the one before did not give already.

        The temporal share at rest, growing with the image motion to 1 where errors have lost each other, so that all
        observations of a camera that moves count in full.
        """
        before, self._T_world_before = self._T_world_before, T_world_cam
        if before is None or self._reach is None:
            return 1.0
        moved_px = image_motion_px(self._camera, disparity, inverse(before) @ T_world_cam)
        gone = min(1.0, moved_px / self._reach.decorrelation_px) if self._reach.decorrelation_px else 1.0
        return max(self._reach.temporal_share + (1 - self._reach.temporal_share) * gone, 1e-3)


def image_motion_px(camera: StereoCamera, disparity: Disparity, T_before_now: FloatArray) -> float:
    """Median distance [px] between where the matched points are seen now and where they were; inf without any."""
    sampled = np.zeros(camera.shape, dtype=np.bool_)
    sampled[STRIDE_PX // 2 :: STRIDE_PX, STRIDE_PX // 2 :: STRIDE_PX] = True
    d = np.where(sampled, disparity.disparity_px, np.nan)
    row, column = np.nonzero(d > 0)
    points = transform(T_before_now, camera.back_project(d))
    seen = points[:, 2] > 0
    if not seen.any():
        return float("inf")
    was = camera.project(points[seen])[:, :2]
    return float(np.median(np.hypot(was[:, 0] - column[seen], was[:, 1] - row[seen])))
