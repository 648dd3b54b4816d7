"""What a map of a drive is scored against: labels and visible set of one recording's true mesh and poses."""

import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from ..camera import StereoCamera
from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray
from .blocks import BLOCK_CELLS, FEWEST_BLOCKS, BlockBootstrap
from .calibration import ReliabilityTable
from .heights import ground_height_m
from .labels import CellLabels, label_cells
from .map_scores import SIGMA_PX, ScoredMap, map_reliability, score_map
from .score import Score
from .surface import SeenSurface
from .visibility import VisibleSet, visible_cells

if TYPE_CHECKING:
    import trimesh


AROUND_M = 1.0
"""Beyond the range: surfaces there are not seen, but tell which free cells are near one."""


@runtime_checkable
class KnowsTruth(Protocol):
    """A recording that carries the true poses and the true mesh, as simulated ones do."""

    camera: StereoCamera

    def true_poses(self) -> FloatArray | None:
        """T_world_cam (M, 4, 4), NaN rows where unknown; None when there are none."""
        ...

    def truth_mesh_ply(self) -> bytes | None:
        """The true mesh as a PLY file; None when there is none."""
        ...


@dataclass(frozen=True)
class MapTruth:
    """One visible set for every map of the same drive, so that their scores compare."""

    mesh: "trimesh.Trimesh"
    camera: StereoCamera
    labels: CellLabels
    visible: VisibleSet

    @classmethod
    def of_recording(
        cls,
        recording: object,
        cell_m: float,
        *,
        max_range_m: float,
        around_path: bool = False,
        progress: Callable[[int, int], object] | None = None,
    ) -> "MapTruth":
        """Labels of cells of cell_m and the set seen within max_range_m. RecordingError without a truth.

        around_path: label no more of the mesh than what a camera on the path has within its range, which is all that
        can be seen: for large worlds of which a drive sees a part.
        """
        mesh_ply = recording.truth_mesh_ply() if isinstance(recording, KnowsTruth) else None
        poses = recording.true_poses() if isinstance(recording, KnowsTruth) else None
        if mesh_ply is None or poses is None or not isinstance(recording, KnowsTruth):
            raise RecordingError("the recording carries no true mesh and poses, so there is nothing to score against")
        mesh = load_ply(mesh_ply)
        known = poses[~np.isnan(poses).any(axis=(1, 2))]
        if not len(known):
            raise RecordingError("of no observation the true pose is known, so there is nothing to score against")
        # One cell around the mesh, as where all of it is labelled.
        ends_m = mesh.bounds + np.array([[-cell_m], [cell_m]])
        bounds_m = bounds_around(known, ends_m, max_range_m + AROUND_M) if around_path else None
        labels = label_cells(mesh, cell_m, bounds_m)
        visible = visible_cells(labels, mesh, recording.camera, known, max_range_m=max_range_m, progress=progress)
        return cls(mesh, recording.camera, labels, visible)

    def between(self, low_m: float, high_m: float) -> "MapTruth":
        """The same truth restricted to the layers of cells with centres from low_m to high_m in world z [m]."""
        z_m = (self.labels.origin_index[2] + np.arange(self.labels.label.shape[2]) + 0.5) * self.labels.cell_m
        kept = np.flatnonzero((z_m >= low_m) & (z_m <= high_m))
        if not len(kept):
            raise InvalidInputError(f"the truth has no cells between {low_m} and {high_m} m")
        layers = slice(kept[0], kept[-1] + 1)
        origin = self.labels.origin_index + np.array([0, 0, kept[0]])
        labels = CellLabels(self.labels.cell_m, origin, self.labels.label[:, :, layers])
        visible = VisibleSet(self.visible.nearest_m[:, :, layers], self.visible.in_view[:, :, layers])
        return MapTruth(self.mesh, self.camera, labels, visible)

    def above_ground(self, low_m: float, high_m: float) -> "MapTruth":
        """The same truth restricted to the cells with centres from low_m to high_m above the ground below them [m].

        The ground is the lowest surface that faces upwards; cells over none are left out.
        """
        ground_m = ground_height_m(self.mesh, self.labels)
        if not np.isfinite(ground_m).any():
            raise InvalidInputError("the true mesh has no ground: no surface of it faces upwards")
        part = self.between(float(np.nanmin(ground_m)) + low_m, float(np.nanmax(ground_m)) + high_m)
        z_m = (part.labels.origin_index[2] + np.arange(part.labels.label.shape[2]) + 0.5) * part.labels.cell_m
        height_m = z_m - ground_m[..., None]
        kept = (height_m >= low_m) & (height_m <= high_m)
        nearest_m = np.where(kept, part.visible.nearest_m, np.float32(np.inf))
        return replace(part, visible=VisibleSet(nearest_m, part.visible.in_view & kept))

    def score(
        self,
        grid: ScoredMap,
        *,
        prior: float = 0.5,
        sigma_px: float = SIGMA_PX,
        surface: bool = True,
        intervals: bool = False,
    ) -> list[Score]:
        """Every score of SCORE_NAMES of a map of this drive; arguments as in score_map.

        surface: whether to give those of the surface too, which take the most time. intervals: whether to give 95 %
        intervals, from blocks of the map (scoring.blocks); interval_note says of what.
        """
        return score_map(
            grid,
            self.labels,
            self.visible,
            prior=prior,
            seen=self.seen_surface if surface else None,
            camera=self.camera,
            sigma_px=sigma_px,
            blocks=self.blocks if intervals else None,
        )

    @property
    def blocks(self) -> BlockBootstrap:
        """The blocks that intervals of scores of such maps are from."""
        return BlockBootstrap(BLOCK_CELLS * self.labels.cell_m)

    @cached_property
    def interval_note(self) -> str:
        """What the intervals of scores are, for a reader."""
        n = self.blocks.block_of(self.labels.centres_m(self.visible.mask))[1]
        if n < FEWEST_BLOCKS:
            return f"Scores have no intervals: the {n} blocks of {self.blocks.block_m:g} m that were seen are too few."
        return (
            f"95 % intervals: from blocks of the map of {self.blocks.block_m:g} m x {self.blocks.block_m:g} m, {n} of "
            "them seen, drawn again 1000 times. They say how much a score hangs on where one looked; what errs in the "
            "whole map alike, such as drift, is not in them."
        )

    @cached_property
    def seen_surface(self) -> SeenSurface:
        """What surfaces of maps are held against: the same for all of them."""
        return SeenSurface.of(self.mesh, self.labels, self.visible)

    def reliability(self, grid: ScoredMap, *, prior: float | None = None) -> ReliabilityTable:
        """The reliability diagram of a map of this drive, 10 bins of equal width; prior as in map_reliability."""
        return map_reliability(grid, self.labels, self.visible, prior=prior)

    def section_m(self, height_m: float) -> FloatArray:
        """Segments (S, 2, 3) in which the true mesh meets the plane z = height_m [m]."""
        from trimesh.intersections import mesh_plane

        segments: FloatArray = np.asarray(mesh_plane(self.mesh, [0.0, 0.0, 1.0], [0.0, 0.0, height_m]))
        return segments.reshape(-1, 2, 3)


def bounds_around(poses: FloatArray, ends_m: FloatArray, reach_m: float) -> FloatArray:
    """(2, 3) the box within reach_m [m] of the poses (M, 4, 4), as far as the world's ends (2, 3) [m]."""
    at_m = poses[:, :3, 3]
    low_m = np.maximum(at_m.min(axis=0) - reach_m, ends_m[0])
    high_m = np.minimum(at_m.max(axis=0) + reach_m, ends_m[1])
    return np.stack([low_m, np.maximum(low_m, high_m)])


def load_ply(ply: bytes) -> "trimesh.Trimesh":
    """A mesh from the bytes of a PLY file. Raises RecordingError when they are not one."""
    import trimesh

    try:
        mesh = trimesh.load(io.BytesIO(ply), file_type="ply", process=False)
    except Exception as error:  # trimesh raises whatever its parsers stumble on
        raise RecordingError(f"the true mesh cannot be read: {error}") from None
    if not isinstance(mesh, trimesh.Trimesh):
        raise RecordingError("the true mesh holds no triangles")
    return mesh
