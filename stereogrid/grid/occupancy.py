"""OccupancyGrid: the map, and how one observation changes it."""

import hashlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..camera import StereoCamera
from ..errors import InvalidInputError, MapTooLargeError, unknown_name
from ..geometry import Array, FloatArray
from ..observation import Disparity
from ..sensor_model import SensorModel, log_odds, probability
from ..thumbnails import layer_picture, shown
from .blocks import BlockStore
from .cells import DEFAULT_CLAMP, LogOddsCells
from .fusion import FUSIONS, Learnt, View, default_threads
from .queries import MapQueries
from .resample import coarsened, cropped, refined
from .view import view_volume_m3

WORKING_BYTES_PER_CELL = 24
"""A cell in view while it is updated and drawn: what is kept of it, its evidence, and room for the pool to grow."""


class OccupancyGrid(MapQueries):
    """Occupancy probabilities of cubic cells of cell_m; cell (i, j, k) spans [i s, (i + 1) s) x ... in world.

    model: the sensor model, whose prior is the probability of a cell that was never updated. fusion: one of
    FUSIONS. clamp: lowest and highest log-odds that a cell may reach (one number: either way alike), None for no
    limit: the map then does not depend on the order of the observations. memory_limit_gb: growth beyond it raises
    MapTooLargeError and leaves the map as it was. threads: how many may share the work of one observation, by default
    all processors up to 4; the map does not depend on it.
    """

    def __init__(
        self,
        cell_m: float,
        *,
        model: SensorModel | None = None,
        fusion: str = "cell",
        clamp: float | Sequence[float] | None = DEFAULT_CLAMP,
        memory_limit_gb: float = 4.0,
        threads: int | None = None,
    ) -> None:
        if not (np.isfinite(cell_m) and cell_m > 0):
            raise InvalidInputError(f"cell_m must be positive and finite, not {cell_m}")
        if fusion not in FUSIONS:
            raise unknown_name("fusion rule", fusion, FUSIONS)
        if not memory_limit_gb > 0:
            raise InvalidInputError(f"memory_limit_gb must be positive, not {memory_limit_gb}")
        if threads is not None and not 1 <= threads <= 256:
            raise InvalidInputError(f"threads must be 1 to 256, not {threads}")
        self.cell_m, self.fusion = float(cell_m), fusion
        self.threads = threads or default_threads()
        self.model = model or SensorModel()
        self.memory_limit_gb = memory_limit_gb
        self.blocks = BlockStore(LogOddsCells(self.model.prior, _limits(clamp)))

    @property
    def clamp(self) -> tuple[float, float] | None:
        """Lowest and highest log-odds that a cell may reach; None: no limit."""
        return self.blocks.rule.clamp

    def __repr__(self) -> str:
        return (
            f"OccupancyGrid(cell_m={self.cell_m}, {len(self.blocks)} blocks, {self.n_known:,} known cells, "
            f"{self.n_bytes / 1e6:.1f} MB)"
        )

    def _repr_html_(self) -> str:
        cells, p = self.known_cells()
        if not len(cells):
            return shown(repr(self))
        k = np.bincount(cells[:, 2] - cells[:, 2].min()).argmax() + cells[:, 2].min()
        layer = cells[:, 2] == k
        size_m = (np.ptp(cells[layer, :2], axis=0) + 1) * self.cell_m
        caption = (
            f"slice at z = {(k + 0.5) * self.cell_m:.2f} m, {size_m[0]:.2f} x {size_m[1]:.2f} m, x to the right: white "
            "free, black occupied, blue-grey unknown"
        )
        return shown(repr(self), layer_picture(cells[layer, :2], p[layer]), caption)

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
        self,
        camera: StereoCamera,
        disparity: Disparity,
        T_world_cam: ArrayLike,
        motion_sigma_m: float = 0.0,
        *,
        motion_rule: str = "rss",
        pose_covariance: ArrayLike | None = None,
        weight: float = 1.0,
    ) -> None:
        """Fuse one observation seen from T_world_cam (4, 4).

        motion_sigma_m: eps of Eq. 13 [m], which joins the stereo error by motion_rule, one of
        sensor_model.MOTION_RULES. pose_covariance (6, 6): how well the pose is known, as motion.PoseUncertainty gives
        it; it acts along each ray and across it. weight: what of the observation is new, above 0 to 1 (frames from one
        place repeat their errors: see Mapper). Raises InvalidInputError or MapTooLargeError and then leaves the map as
        it was.
        """
        view = View(
            camera,
            disparity,
            T_world_cam,
            self.cell_m,
            self.model,
            eps_m=motion_sigma_m,
            motion_rule=motion_rule,
            pose_covariance=pose_covariance,
            weight=weight,
        )
        self.check_fits(camera)
        self._fuse(FUSIONS[self.fusion](view, self.threads))

    def _fuse(self, learnt: Learnt) -> None:
        touched = learnt.judged | learnt.free
        self._check_growth(learnt.blocks[touched])
        rows = np.full(len(touched), -1, dtype=np.int64)
        rows[touched] = self.blocks.rows(learnt.blocks[touched])
        judged, free = np.where(learnt.judged, rows, -1), rows[learnt.free]
        rule, words = self.blocks.rule, self.blocks.words
        rule.fuse(words, judged, learnt.evidence)
        rule.fuse_whole(words, free, learnt.free_evidence[learnt.free])

    def _check_growth(self, blocks: Array) -> None:
        need_gb = self.blocks.bytes_with(blocks) / 1e9
        if need_gb > self.memory_limit_gb:
            raise MapTooLargeError(f"the map would grow to {need_gb:.4g} GB, its limit is {self.memory_limit_gb:g} GB")

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

    def known_cells(self) -> tuple[Array, FloatArray]:
        """Indices (N, 3) int64 and probabilities (N,) of all cells ever updated."""
        cells, values = self.blocks.known()
        return cells, probability(values)

    def known_layer(self, height_m: float) -> Array:
        """Indices i, j (N, 2) int64 of the known cells at z = height_m [m] in world."""
        k = int(np.floor(height_m / self.cell_m))
        cells, _ = self.blocks.known()
        layer: Array = cells[cells[:, 2] == k, :2]
        return layer

    def occupied_centres(self, threshold: float = 0.5) -> FloatArray:
        """Centres (N, 3) in world [m] of the known cells with p > threshold."""
        if not 0 <= threshold < 1:
            raise InvalidInputError(f"threshold must be a probability below 1, not {threshold}")
        cells, _ = self.blocks.known(above=float(log_odds(threshold)) if threshold else -np.inf)
        centres: FloatArray = (cells + 0.5) * self.cell_m
        return centres

    def crop(self, low_m: ArrayLike, high_m: ArrayLike) -> "OccupancyGrid":
        """A new map of the cells whose centres lie in the box low_m <= c < high_m (3,) [m]; an end may be infinite."""
        return self._holding(cropped(self.blocks, self.cell_m, low_m, high_m), self.cell_m)

    def coarsened(self, factor: int) -> "OccupancyGrid":
        """A new map of cells `factor` times larger: the largest log-odds and update count of their known children.

        Cell i holds the cells c with c // factor = i.
        """
        return self._holding(coarsened(self.blocks, factor), self.cell_m * factor)

    def refined(self, factor: int) -> "OccupancyGrid":
        """A new map of cells `factor` times smaller, each a copy of the one that it lies in."""
        return self._holding(refined(self.blocks, factor, limit_gb=self.memory_limit_gb), self.cell_m / factor)

    def spread(self, covariance: ArrayLike, about_m: ArrayLike) -> "OccupancyGrid":
        """A new map: of each cell the mean probability over where the map may lie.

        covariance (3, 3): of its displacement along x and y [m], and of its turn [rad] about the vertical through
        about_m (2,) [m]. Raises InvalidInputError or MapTooLargeError.
        """
        from .spread import spread

        return spread(self, covariance, about_m)

    def emptied(self) -> "OccupancyGrid":
        """A new map without cells that goes on as this one does."""
        return self._holding(BlockStore(self.blocks.rule), self.cell_m)

    def _holding(self, blocks: BlockStore, cell_m: float) -> "OccupancyGrid":
        """A map with other cells that goes on as this one does."""
        limit_gb = self.memory_limit_gb
        grid = OccupancyGrid(
            cell_m,
            model=self.model,
            fusion=self.fusion,
            clamp=self.clamp,
            memory_limit_gb=limit_gb,
            threads=self.threads,
        )
        grid.blocks = blocks
        return grid

    def sha256(self) -> str:
        """Digest of the cell size and of all known cells with their log-odds, whatever the order they came in.

        How often a cell was updated is not part of it.
        """
        digest = hashlib.sha256(np.float64(self.cell_m).tobytes())
        cells, values = self.blocks.known()
        digest.update(cells.astype("<i8").tobytes() + values.astype("<f4").tobytes())
        return digest.hexdigest()

    def save(self, path: str | Path) -> Path:
        """Write the map to path (.sgrid), beside and then renamed. Read it back with OccupancyGrid.load."""
        from .mapfile import save_grid

        return save_grid(self, Path(path))

    @classmethod
    def load(cls, path: str | Path, *, memory_limit_gb: float = 4.0) -> "OccupancyGrid":
        """The map saved at path: .sgrid, or OctoMap's .bt or .ot.

        Raises RecordingError when it is missing, damaged or of another version, MapTooLargeError beyond the limit.
        """
        from .mapfile import load_grid
        from .octomap import SUFFIXES, load_octomap

        load = load_octomap if Path(path).suffix in SUFFIXES else load_grid
        return load(Path(path), memory_limit_gb=memory_limit_gb)

    @classmethod
    def from_cells(
        cls, cell_m: float, cells: ArrayLike, log_odds: ArrayLike, n_updates: ArrayLike = 1, **options: Any
    ) -> "OccupancyGrid":
        """A map of cells (N, 3), all different, with log_odds (N,) and n_updates () or (N,); options as of the class.

        Log-odds are rounded to 1 / 256 nat and clamped. Raises InvalidInputError or MapTooLargeError.
        """
        from .compose import fill

        grid = cls(cell_m, **options)
        fill(grid, cells, log_odds, n_updates)
        return grid

    def merge(self, other: "OccupancyGrid") -> None:
        """Add what other has seen: log-odds and update counts add up, and are clamped. In any order the same.

        Raises InvalidInputError when cell size, prior, clamp or fusion differ, MapTooLargeError beyond the memory
        limit; the map is then as it was.
        """
        from .compose import merge

        merge(self, other)


def _limits(clamp: float | Sequence[float] | None) -> tuple[float, float] | None:
    if clamp is None:
        return None
    limits = (-clamp, clamp) if isinstance(clamp, int | float) else tuple(clamp)
    if len(limits) != 2:
        raise InvalidInputError(f"clamp must be a lowest and a highest log-odds, one number or None, not {clamp}")
    return float(limits[0]), float(limits[1])
