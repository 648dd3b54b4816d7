"""OccupancyGrid: the map, and how one observation changes it."""

import hashlib
import sys
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..camera import StereoCamera
from ..errors import InvalidInputError, MapTooLargeError, unknown_name
from ..geometry import Array, FloatArray, as_floats, as_pose
from ..observation import Disparity
from ..sensor_model import SensorModel, kernel_parameters, log_odds, probability, widened_sigma_px
from .blocks import BlockStore
from .kernels import BLOCK, add_evidence, sum_rays, sweep_cells, vote_hits
from .view import blocks_in_view, view_volume_m3

FUSIONS = ("cell", "sum_of_rays")
"""cell: one update a cell an observation. sum_of_rays: the paper read literally, every ray adds."""

NOWHERE = 2**52
"""An index beyond every cell."""
FARTHEST_CELLS = 1e9
"""A pose farther from the origin is a mistake, not a place."""
WORKING_BYTES_PER_CELL = 24
"""A cell in view while it is updated and drawn: what is kept of it, its evidence, and room for the pool to grow."""


class OccupancyGrid:
    """Occupancy probabilities of cubic cells of cell_m; cell (i, j, k) spans [i s, (i + 1) s) x ... in world.

    model: the sensor model, whose prior is the probability of a cell that was never updated. fusion: one of
    FUSIONS. clamp: the largest absolute log-odds a cell may reach, None for no limit. memory_limit_gb: growth
    beyond it raises MapTooLargeError and leaves the map as it was.
    """

    def __init__(
        self,
        cell_m: float,
        *,
        model: SensorModel | None = None,
        fusion: str = "cell",
        clamp: float | None = 4.0,
        memory_limit_gb: float = 4.0,
    ) -> None:
        if not (np.isfinite(cell_m) and cell_m > 0):
            raise InvalidInputError(f"cell_m must be positive and finite, not {cell_m}")
        if fusion not in FUSIONS:
            raise unknown_name("fusion rule", fusion, FUSIONS)
        if clamp is not None and not clamp > 0:
            raise InvalidInputError(f"clamp must be a positive log-odds or None, not {clamp}")
        if not memory_limit_gb > 0:
            raise InvalidInputError(f"memory_limit_gb must be positive, not {memory_limit_gb}")
        self.cell_m, self.fusion, self.clamp = float(cell_m), fusion, clamp
        self.model = model or SensorModel()
        self.memory_limit_gb = memory_limit_gb
        self.blocks = BlockStore(float(log_odds(self.model.prior)))

    def __repr__(self) -> str:
        return (
            f"OccupancyGrid(cell_m={self.cell_m}, {len(self.blocks)} blocks, {self.n_known:,} known cells, "
            f"{self.n_bytes / 1e6:.1f} MB)"
        )

    def check_fits(self, camera: StereoCamera) -> None:
        """Raise MapTooLargeError, naming the need, when one view of this camera would not fit in the limit."""
        # Cells can be so small that their volume vanishes in a float.
        cell_m3 = max(self.cell_m**3, sys.float_info.min)
        need_gb = view_volume_m3(camera, self.model.max_range_m) / cell_m3 * WORKING_BYTES_PER_CELL / 1e9
        if need_gb > self.memory_limit_gb:
            raise MapTooLargeError(
                f"cells of {self.cell_m:g} m are too small: one view up to {self.model.max_range_m:g} m needs "
                f"{need_gb:,.6g} GB, the limit is {self.memory_limit_gb:g} GB; choose larger cells or a shorter range"
            )

    def integrate(
        self, camera: StereoCamera, disparity: Disparity, T_world_cam: ArrayLike, motion_sigma_m: float = 0.0
    ) -> None:
        """Fuse one observation seen from T_world_cam (4, 4). motion_sigma_m: eps of Eq. 13 [m].

        Raises InvalidInputError or MapTooLargeError and then leaves the map as it was.
        """
        pose = as_pose(T_world_cam, "T_world_cam")
        if np.abs(pose[:3, 3]).max() > FARTHEST_CELLS * self.cell_m:
            raise InvalidInputError(f"T_world_cam is {np.abs(pose[:3, 3]).max():.3g} m from the origin: too far to map")
        if disparity.disparity_px.shape != camera.shape:
            raise InvalidInputError(f"the disparity is {disparity.disparity_px.shape}, the camera {camera.shape}")
        if not (np.isfinite(motion_sigma_m) and motion_sigma_m >= 0):
            raise InvalidInputError(f"motion_sigma_m must be >= 0 and finite, not {motion_sigma_m}")
        self.check_fits(camera)
        blocks = blocks_in_view(camera, pose, self.cell_m, max_range_m=self.model.max_range_m)
        evidence = self._evidence(camera, self._kernel_image(camera, disparity, motion_sigma_m), pose, blocks)
        touched = ~np.isnan(evidence).all(axis=(1, 2, 3))
        self._check_growth(blocks[touched])
        rows = self.blocks.rows(blocks[touched])
        limit = np.inf if self.clamp is None else self.clamp
        add_evidence(rows, evidence[touched], self.blocks.log_odds, self.blocks.n_updates, limit)

    def _kernel_image(self, camera: StereoCamera, disparity: Disparity, motion_sigma_m: float) -> Array:
        """(H, W, 2) float32: d and d / dd, where dd carries eps."""
        d = disparity.disparity_px
        sigma_px = widened_sigma_px(
            camera, d, disparity.sigma_px, motion_sigma_m=motion_sigma_m, motion=self.model.motion
        )
        return np.stack([d, d / sigma_px], axis=-1).astype(np.float32)

    def _evidence(self, camera: StereoCamera, image: Array, pose: FloatArray, blocks: Array) -> Array:
        """(B, 16, 16, 16) float32 log-odds that the observation adds to the cells of blocks (B, 3); NaN: none."""
        out = np.full((len(blocks), BLOCK, BLOCK, BLOCK), np.nan, dtype=np.float32)
        origin = blocks.min(axis=0)
        lookup = np.full(blocks.max(axis=0) - origin + 1, -1, dtype=np.int64)
        lookup[tuple((blocks - origin).T)] = np.arange(len(blocks))
        intrinsics = (camera.focal_px, camera.cx_px, camera.cy_px, camera.focal_baseline_px_m)
        constants = np.array([*intrinsics, self.cell_m, self.model.max_range_m])
        parameters = kernel_parameters(self.model)
        if self.fusion == "sum_of_rays":
            sum_rays(lookup, origin, pose, constants, image, parameters, out)
        else:
            sweep_cells(blocks, pose, constants, image, parameters, out)
            vote_hits(lookup, origin, pose, constants, image, parameters, out)
        return out

    def _check_growth(self, blocks: Array) -> None:
        need_gb = self.blocks.bytes_with(blocks) / 1e9
        if need_gb > self.memory_limit_gb:
            raise MapTooLargeError(f"the map would grow to {need_gb:.2f} GB, its limit is {self.memory_limit_gb:g} GB")

    @property
    def n_bytes(self) -> int:
        """Memory of the cells [bytes]."""
        return self.blocks.n_bytes

    @property
    def n_known(self) -> int:
        """Number of cells that were updated at least once."""
        return int(np.count_nonzero(self.blocks.counts()))

    def probability(self, points_m: ArrayLike) -> FloatArray:
        """p(occupied) (N,) at points (N, 3) in world [m]; NaN where the cell was never updated, or at NaN."""
        values, counts = self.blocks.at(self._cells_at(points_m))
        return np.where(counts > 0, probability(values), np.nan)

    def n_updates(self, points_m: ArrayLike) -> Array:
        """How often the cells at points (N, 3) in world [m] were updated, (N,) int."""
        return self.blocks.at(self._cells_at(points_m))[1]

    def _cells_at(self, points_m: ArrayLike) -> Array:
        """Indices (N, 3) int64 of the cells that hold points (N, 3) [m]; NaN and infinity get one never held."""
        cells = np.floor(as_floats(points_m).reshape(-1, 3) / self.cell_m)
        return np.where(np.abs(cells) < NOWHERE, cells, NOWHERE).astype(np.int64)

    def known_cells(self) -> tuple[Array, FloatArray]:
        """Indices (N, 3) int64 and probabilities (N,) of all cells ever updated."""
        cells, values = self.blocks.known()
        return cells, probability(values)

    def known_layer(self, height_m: float) -> Array:
        """Indices i, j (N, 2) int64 of the known cells at z = height_m [m] in world."""
        k = int(np.floor(height_m / self.cell_m))
        layers = [np.empty((0, 2), dtype=np.int64)]
        for index, _, known in self.blocks.in_order():
            if index[2] == k // BLOCK:
                layers.append(index[:2] * BLOCK + np.argwhere(known[:, :, k % BLOCK]))
        return np.concatenate(layers)

    def occupied_centres(self, threshold: float = 0.5) -> FloatArray:
        """Centres (N, 3) in world [m] of the known cells with p > threshold."""
        if not 0 <= threshold < 1:
            raise InvalidInputError(f"threshold must be a probability below 1, not {threshold}")
        cells, _ = self.blocks.known(above=float(log_odds(threshold)) if threshold else -np.inf)
        centres: FloatArray = (cells + 0.5) * self.cell_m
        return centres

    def sha256(self) -> str:
        """Digest of the cell size and of all known cells with their log-odds, whatever the order they came in.

        How often a cell was updated is not part of it.
        """
        digest = hashlib.sha256(np.float64(self.cell_m).tobytes())
        for index, values, known in self.blocks.in_order():
            if known.any():
                digest.update(index.astype("<i8").tobytes() + np.packbits(known).tobytes())
                digest.update(values[known].astype("<f4").tobytes())
        return digest.hexdigest()

    def save(self, path: str | Path) -> Path:
        """Write the map to path (.sgrid), beside and then renamed. Read it back with OccupancyGrid.load."""
        from .mapfile import save_grid

        return save_grid(self, Path(path))

    @classmethod
    def load(cls, path: str | Path) -> "OccupancyGrid":
        """The map saved at path. Raises RecordingError when it is missing, damaged or of another version."""
        from .mapfile import load_grid

        return load_grid(Path(path))
