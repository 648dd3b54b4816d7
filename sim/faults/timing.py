"""Moments: free-running cameras and rolling shutters, which see a robot that moves from other places than the stamp's.

Their pictures are taken again in the recording's world, from where the robot truly was.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from stereogrid.errors import RecordingError
from stereogrid.geometry import FloatArray
from stereogrid.observation import Image, Observation, Recording
from stereogrid.recording import KnowsMotion, Ticks

from ..rendering.render import Renderer
from ..rendering.renderers import RASTER, RowPhotographer
from ..rig import StereoRig
from ..worlds.world import WorldPlan
from .kinds import CameraFaults
from .shared import Shared
from .streams import LEFT, RIGHT, stream

DRIFT_S = 60.0
"""Time in which one camera's clock falls behind the other's by a whole range of skews: some hundred ppm."""
PICTURES_KEPT = 16


def skew_s(faults: CameraFaults, seed: int, stamp_s: float) -> float:
    """How much later than the left camera the right one takes its picture at a stamp [s]: -skew to +skew.

    It drifts from end to end; there the next picture of the other camera is the nearer one, and it starts again.
    """
    rng = stream(seed, "skew")
    start, faster = rng.uniform(), 1.0 if rng.random() < 0.5 else -1.0
    phase = (start + faster * stamp_s / DRIFT_S) % 1.0
    return faults.time_skew_s * float(2 * phase - 1)


@dataclass(frozen=True)
class Shutters:
    """Two cameras on a robot that moves as `ticks` say. photographer: called when the first picture is taken.

    The last pictures are kept: arms that read a drive side by side share them.
    """

    rig: StereoRig
    ticks: Ticks
    photographer: Callable[[], RowPhotographer]
    faults: CameraFaults
    seed: int
    _taken: Shared[tuple[int, float], Image] = field(default_factory=lambda: Shared(PICTURES_KEPT), init=False)

    @classmethod
    def of(cls, recording: Recording, faults: CameraFaults, seed: int) -> "Shutters":
        """Those of a recording. Raises RecordingError, naming what is missing, when it is none of a simulated drive
        seen by the raster renderer, and InvalidInputError for a world that is not known."""
        needed = [name for name in ("time_skew_s", "rolling_shutter_s") if getattr(faults, name) > 0]
        why = f"{' and '.join(needed)} need the robot's motion and its world"
        if not isinstance(recording, KnowsMotion):
            raise RecordingError(
                f"{why}, and this {type(recording).__name__} has neither: faults belong on the recording itself"
            )
        try:
            plan = WorldPlan.of(recording.metadata)
        except RecordingError as error:
            raise RecordingError(f"{why}, and {error}") from error
        renderer = recording.metadata.get("renderer", RASTER)
        if renderer != RASTER:
            raise RecordingError(f"{why}, drawn by the renderer {RASTER!r}; the recording is drawn by {renderer!r}")
        ticks = recording.ticks()
        if ticks is None:
            raise RecordingError(f"{why}, and the recording has no ticks: record the drive again")
        rig = StereoRig(recording.camera, recording.T_base_cam)
        return cls(rig, ticks, partial(_renderer, plan), faults, seed)

    def pictures(self, observation: Observation) -> tuple[Image, Image]:
        """What the two cameras saw about the observation's stamp, (H, W) uint8, with no other faults."""
        left = observation.left
        if self.faults.rolling_shutter_s > 0:
            left = self._picture(LEFT, observation.stamp_s)
        return left, self._picture(RIGHT, observation.stamp_s + skew_s(self.faults, self.seed, observation.stamp_s))

    def _picture(self, side: int, time_s: float) -> Image:
        return self._taken.get((side, time_s), lambda: self._take(side, time_s))

    def _take(self, side: int, time_s: float) -> Image:
        camera, readout_s = self.rig.camera, self.faults.rolling_shutter_s
        if readout_s == 0:
            return self.photographer().view(camera, self._T_world_camera(side, time_s), time_s=time_s).gray
        times_s = time_s + readout_s * np.linspace(-0.5, 0.5, camera.height_px)
        poses = np.stack([self._T_world_camera(side, each) for each in times_s])
        return self.photographer().view_rows(camera, poses, time_s=time_s).gray

    def _T_world_camera(self, side: int, time_s: float) -> FloatArray:
        T_world_left = self.ticks.T_world_base_at(time_s) @ self.rig.T_base_cam
        return T_world_left if side == LEFT else self.rig.right_of(T_world_left)


def _renderer(plan: WorldPlan) -> RowPhotographer:
    return _RENDERERS.get(plan, lambda: Renderer(plan.make()))


_RENDERERS: Shared[WorldPlan, RowPhotographer] = Shared(2)
"""Kept, since every seed of noise reads the same drive."""
