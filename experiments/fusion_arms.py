"""The arms: what the grid is told of how far errors go together, and how it fuses."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from stereogrid.camera import StereoCamera
from stereogrid.config import GridConfig
from stereogrid.geometry import FloatArray
from stereogrid.grid import OccupancyGrid
from stereogrid.grid.cells import DEFAULT_CLAMP, OCTOMAP_CLAMP
from stereogrid.observation import Disparity
from stereogrid.sensor_model import SensorModel

Clamp = float | tuple[float, ...] | None
FIRST, THREE, MEASURED, ONE_LOOK, SUM = NAMES = "1 px", "3 px", "measured", "one look", "sum of rays"


@dataclass(frozen=True)
class Reading:
    """A disparity and where it was seen from: T_world_cam (4, 4)."""

    disparity: Disparity
    T_world_cam: FloatArray


@dataclass(frozen=True)
class Arm:
    """correlation_px: what the grid is told, None: as the disparity says. fusion: the grid's rule."""

    correlation_px: float | None = None
    fusion: str = "cell"

    def seen(self, disparity: Disparity) -> Disparity:
        """The disparity with this arm's correlation length."""
        return disparity if self.correlation_px is None else replace(disparity, correlation_px=self.correlation_px)


OF_MATCHERS = {
    FIRST: Arm(1.0),
    MEASURED: Arm(),
    ONE_LOOK: Arm(math.inf),
    SUM: Arm(fusion="sum_of_rays"),
}
"""For readings whose errors go together over a length that was measured."""
OF_INDEPENDENT = {
    FIRST: Arm(1.0),
    THREE: Arm(3.0),
    ONE_LOOK: Arm(math.inf),
    SUM: Arm(fusion="sum_of_rays"),
}
"""For readings whose errors are independent from pixel to pixel."""
CLAMPS: dict[str, Clamp] = {
    "+-2": (-2.0, 2.0),
    "+-4": (-4.0, 4.0),
    "+-6": (-6.0, 6.0),
    "+-8": (-8.0, 8.0),
    "OctoMap's -2, 3.511": OCTOMAP_CLAMP,
    "none": None,
}
USUAL_CLAMP = next(name for name, clamp in CLAMPS.items() if clamp == DEFAULT_CLAMP)
"""What a grid has where nothing else is asked for."""


def fused(
    camera: StereoCamera, readings: Iterable[Reading], arm: Arm, *, grid: GridConfig, model: SensorModel
) -> OccupancyGrid:
    """The map of the readings by this arm; the grid's own rule of fusion counts for nothing."""
    return fused_within(camera, readings, arm, grid=grid, model=model, clamp=grid.clamp or None)


def fused_within(
    camera: StereoCamera, readings: Iterable[Reading], arm: Arm, *, grid: GridConfig, model: SensorModel, clamp: Clamp
) -> OccupancyGrid:
    """The same with another clamp than the grid's."""
    made = OccupancyGrid(grid.cell_m, model=model, fusion=arm.fusion, clamp=clamp, memory_limit_gb=grid.memory_limit_gb)
    for reading in readings:
        made.integrate(camera, arm.seen(reading.disparity), reading.T_world_cam)
    return made
