"""Grids that take the same synthetic frames: ours, and OctoMap as its users run it."""

import inspect
from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray, transform
from stereogrid.grid import OccupancyGrid
from stereogrid.observation import Disparity
from stereogrid.sensor_model import SensorModel

from .frames import PERIOD_M, Frames


class GridContender(Protocol):
    """A map that frames are added to. A frame is prepared first, so that only the map's own work is timed."""

    def prepared(self, camera: StereoCamera, disparity: Disparity, T_world_cam: FloatArray) -> Any:
        """The frame as the map takes it."""
        ...

    def add(self, frame: Any) -> None:
        """Fuse a prepared frame."""
        ...

    @property
    def n_bytes(self) -> int:
        """Memory of the map [bytes], as it counts itself."""
        ...


class StereogridMap:
    """Our grid, its defaults but for the range, on one core."""

    def __init__(self, cell_m: float, range_m: float) -> None:
        self.grid = occupancy_grid(cell_m, range_m, threads=1)

    def prepared(self, camera: StereoCamera, disparity: Disparity, T_world_cam: FloatArray) -> Any:
        """Nothing to be done."""
        return camera, disparity, T_world_cam

    def add(self, frame: Any) -> None:
        """One observation."""
        self.grid.integrate(*frame)

    @property
    def n_bytes(self) -> int:
        """Memory of the cells."""
        return self.grid.n_bytes

    def n_updates(self) -> int:
        """How many updates its cells have had altogether."""
        cells, _ = self.grid.known_cells()
        return int(self.grid.n_updates((cells + 0.5) * self.grid.cell_m).sum(dtype=np.int64))


class OctoMap:
    """OctoMap with its defaults; each cell once a frame (discretize), as octomap_server inserts."""

    def __init__(self, cell_m: float, range_m: float) -> None:
        import octomap

        self.tree = octomap.OcTree(cell_m)
        self.range_m = range_m

    def prepared(self, camera: StereoCamera, disparity: Disparity, T_world_cam: FloatArray) -> Any:
        """The points in world, and the eye."""
        return transform(T_world_cam, camera.back_project(disparity.disparity_px)), T_world_cam[:3, 3].copy()

    def add(self, frame: Any) -> None:
        """One point cloud."""
        points_m, eye_m = frame
        self.tree.insertPointCloud(points_m, eye_m, self.range_m, False, True)

    @property
    def n_bytes(self) -> int:
        """Memory of the nodes."""
        return int(self.tree.memoryUsage())


GRIDS = {"stereogrid": StereogridMap, "octomap": OctoMap}


def occupancy_grid(cell_m: float, range_m: float, threads: int) -> OccupancyGrid:
    """An OccupancyGrid for depths up to range_m [m], on so many threads where it can be told."""
    known = inspect.signature(OccupancyGrid).parameters
    options: dict[str, Any] = {"threads": threads} if "threads" in known else {}
    return OccupancyGrid(cell_m, model=SensorModel(max_range_m=range_m), **options)


def along(frames: Frames, from_m: float, to_m: float) -> Iterator[tuple[Disparity, FloatArray]]:
    """The frames from from_m to to_m of a drive that repeats frames, which must fill the period of their corridor."""
    first, last = (round(x_m / frames.config.spacing_m) for x_m in (from_m, to_m))
    repeated = list(frames)
    for n in range(first, last):
        disparity, T_world_cam = repeated[n % len(repeated)]
        T_world_shifted = np.eye(4)
        T_world_shifted[0, 3] = n // len(repeated) * PERIOD_M
        yield disparity, T_world_shifted @ T_world_cam
