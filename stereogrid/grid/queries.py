"""What may be asked of a map. The work stands in a room a question; docs/conventions.md lists them."""

import numpy as np
from numpy.typing import ArrayLike

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_floats, as_pose
from . import boxes, fields, layers, normals, rays
from .blocks import BlockStore
from .states import judge, states_of

NOWHERE = 2**52
"""An index beyond every cell."""


class MapQueries:
    """The questions to a map of cubic cells of cell_m; OccupancyGrid adds how it comes to know them.

    Known cells are OCCUPIED where p > p_occupied and FREE where p <= p_free (p_occupied where not given); between
    the two they count as UNKNOWN, as cells do that were never updated. Lengths are metres in world. Answers larger
    than memory_limit_gb raise MapTooLargeError; what cannot be meant raises InvalidInputError.
    """

    cell_m: float
    memory_limit_gb: float
    blocks: BlockStore

    def _cells_at(self, points_m: ArrayLike) -> Array:
        """Indices (N, 3) int64 of the cells that hold points (N, 3) [m]; NaN and infinity get one never held."""
        cells = np.floor(as_floats(points_m).reshape(-1, 3) / self.cell_m)
        return np.where(np.abs(cells) < NOWHERE, cells, NOWHERE).astype(np.int64)

    def state(self, points_m: ArrayLike, *, p_occupied: float = 0.5, p_free: float | None = None) -> Array:
        """Codes (N,) int8 of State at points (N, 3) [m]; UNKNOWN at NaN."""
        points = as_floats(points_m)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InvalidInputError(f"points must be (N, 3), not {points.shape}")
        return states_of(self.blocks.words_at(self._cells_at(points)), judge(self.blocks.rule, p_occupied, p_free))

    def bounds_m(self) -> tuple[FloatArray, FloatArray]:
        """The corners (3,), (3,) [m] of the smallest box that holds all known cells. Raises where there is none."""
        cells, _ = self.blocks.known()
        if not len(cells):
            raise InvalidInputError("the map knows no cell, so it has no bounds")
        return cells.min(axis=0) * self.cell_m, (cells.max(axis=0) + 1) * self.cell_m

    def box(self, low_m: ArrayLike, high_m: ArrayLike) -> boxes.DenseBox:
        """p(occupied) of all cells that the box between two corners (3,) [m] meets, as an array, NaN unknown."""
        return boxes.dense_box(self.blocks, self.cell_m, self._span(low_m, high_m), limit_gb=self.memory_limit_gb)

    def count_boxes(
        self, boxes_m: ArrayLike, *, p_occupied: float = 0.5, p_free: float | None = None
    ) -> boxes.BoxCounts:
        """How many occupied, free and unknown cells each of many boxes meets, and their largest p.

        boxes_m (N, 2, 3): low and high corner [m]; a box without volume meets one cell. For collision checks.
        """
        corners = as_floats(boxes_m)
        if corners.ndim != 3 or corners.shape[1:] != (2, 3):
            raise InvalidInputError(f"boxes must be (N, 2, 3), low and high corners, not {corners.shape}")
        span = boxes.span_of(corners[:, 0], corners[:, 1], self.cell_m)
        return boxes.count_boxes(self.blocks, span, judge(self.blocks.rule, p_occupied, p_free))

    def first_hit(
        self,
        origins_m: ArrayLike,
        directions: ArrayLike,
        max_range_m: float,
        *,
        p_occupied: float = 0.5,
        unknown_stops: bool = False,
    ) -> rays.RayHits:
        """Where rays enter the first cell with p > p_occupied, exactly (Amanatides and Woo 1987).

        origins_m (N, 3), or (3,) for all; directions (N, 3) of any length but zero: ranges are metres whatever it is.
        unknown_stops: a cell that was never updated ends a ray as well. A cell entered at max_range_m still counts.
        """
        return rays.first_hits(
            self.blocks,
            self.cell_m,
            (origins_m, directions),
            max_range_m,
            judge=judge(self.blocks.rule, p_occupied),
            unknown_stops=unknown_stops,
        )

    def depth_image(
        self,
        camera: StereoCamera,
        T_world_cam: ArrayLike,
        max_range_m: float,
        *,
        p_occupied: float = 0.5,
        unknown_stops: bool = False,
    ) -> Array:
        """Depth z (H, W) float32 [m] of what the left camera sees from T_world_cam (4, 4), NaN where no hit.

        max_range_m is along the ray. Depths are those of the cells' near faces.
        """
        return rays.depth_image(
            self.blocks,
            self.cell_m,
            (camera, T_world_cam),
            max_range_m,
            judge=judge(self.blocks.rule, p_occupied),
            unknown_stops=unknown_stops,
        )

    def surface(
        self, *, p_occupied: float = 0.5, p_free: float | None = None, reach_cells: int = 4
    ) -> tuple[FloatArray, FloatArray]:
        """Centres (N, 3) [m] of the occupied cells, and unit normals (N, 3) towards free space.

        Estimated from the free cells within reach_cells (planes: 2 degrees mean error at 4, 5 at 3); NaN where these
        do not say, as inside solids and for a wall one cell thick that was seen from both sides.
        """
        rule = judge(self.blocks.rule, p_occupied, p_free)
        cells, _ = self.blocks.known()
        cells = cells[self.blocks.words_at(cells) >= rule[2]]
        centres: FloatArray = (cells + 0.5) * self.cell_m
        return centres, normals.normals_at(self.blocks, cells, judge=rule, reach_cells=reach_cells)

    def distance_field(
        self,
        low_m: ArrayLike | None = None,
        high_m: ArrayLike | None = None,
        *,
        p_occupied: float = 0.5,
        unknown_is_obstacle: bool = False,
        signed: bool = False,
    ) -> fields.DistanceField:
        """Distance [m] of each cell of a box, of bounds_m() where no corners are given, to the nearest obstacle in it.

        Obstacles are occupied cells and, if unknown_is_obstacle, those never updated. signed: negative within them.
        """
        if (low_m is None) != (high_m is None):
            raise InvalidInputError("a box has both low_m and high_m, or neither for the whole map")
        low, high = self.bounds_m() if low_m is None or high_m is None else (as_floats(low_m), as_floats(high_m))
        return fields.distance_field(
            self.blocks,
            self.cell_m,
            self._span(low, high),
            judge=judge(self.blocks.rule, p_occupied),
            unknown_is_obstacle=unknown_is_obstacle,
            signed=signed,
            limit_gb=self.memory_limit_gb,
        )

    def project(
        self, low_m: float, high_m: float, *, p_occupied: float = 0.5, p_free: float | None = None
    ) -> layers.Projection:
        """The cells that meet heights from low_m to high_m [m], seen from above; an end may be infinite."""
        band = layers.band_of(low_m, high_m, self.cell_m)
        rule = judge(self.blocks.rule, p_occupied, p_free)
        return layers.project(self.blocks, self.cell_m, band, judge=rule, limit_gb=self.memory_limit_gb)

    def section(
        self,
        T_world_plane: ArrayLike,
        u_m: tuple[float, float],
        v_m: tuple[float, float],
        *,
        step_m: float | None = None,
    ) -> layers.Section:
        """p(occupied) on the plane z = 0 of a pose (4, 4), for x from u_m[0] to u_m[1] and y from v_m[0] to v_m[1].

        step_m: a cell where not given; points are in the middles of steps. A plane through a point p with unit
        vectors u and v: geometry.from_rotation(np.column_stack([u, v, np.cross(u, v)]), p).
        """
        step = self.cell_m if step_m is None else step_m
        points, u, v = layers.section_points(T_world_plane, (u_m, v_m), step, limit_gb=self.memory_limit_gb)
        words = self.blocks.words_at(self._cells_at(points)).reshape(len(u), len(v))
        return layers.Section(as_pose(T_world_plane), u, v, boxes.known_probability(self.blocks, words))

    def _span(self, low_m: ArrayLike, high_m: ArrayLike) -> boxes.Span:
        low, high = as_floats(low_m), as_floats(high_m)
        if low.shape != (3,) or high.shape != (3,) or not (low < high).all():
            raise InvalidInputError(f"a box goes from a low to a high corner (3,) [m], not {low_m!r} to {high_m!r}")
        return boxes.span_of(low, high, self.cell_m)
