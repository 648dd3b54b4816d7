"""Synthetic frames down a corridor: exact depths with the noise of a matcher, to measure grids alone by.

No images and no matcher: the depth of a mesh as embree sees it, made a disparity, made noisy independently from pixel
to pixel, and rounded as block matchers round. The furniture repeats every PERIOD_M, so frames of one period, shifted,
are the frames of a drive of any length.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated

import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.described import Doc, check_fields
from stereogrid.geometry import R_BASE_OPTICAL, FloatArray, as_floats, from_rotation, from_yaw
from stereogrid.observation import Disparity, FloatImage
from stereogrid.scoring import label_cells, visible_cells
from stereogrid.scoring.truth import MapTruth

if TYPE_CHECKING:
    import trimesh

HFOV_RAD = np.deg2rad(45.0)
BASELINE_M = 0.06
STEP_PX = 1 / 16
"""What disparities are rounded to."""
MISSING = 0.02
"""Share of the pixels that fail at random."""
EYE_M = 0.9
"""Height of the camera."""
PERIOD_M = 30.0
BEHIND_M, BEYOND_M = 2.0, 17.0
"""Corridor before the first and after the last pose: more than any range, so that its ends are never seen."""
WALL_M = 0.1
POLE_M = 0.02
POLE_EVERY_M = 5.0
INDEPENDENT = {"correlation_px": 1.0} if "correlation_px" in {field.name for field in fields(Disparity)} else {}
"""How a Disparity says that errors are independent from pixel to pixel, where it can."""


@dataclass(frozen=True)
class FramesConfig:
    """What is seen, and how well."""

    width_px: Annotated[int, Doc("Width of the images; 3 / 4 of it high.", "px", above=0)] = 320
    n: Annotated[int, Doc("So many poses.", above=0)] = 100
    spacing_m: Annotated[float, Doc("From pose to pose.", "m", above=0)] = 0.3
    range_m: Annotated[float, Doc("Depths beyond it are missing.", "m", above=0, below=BEYOND_M)] = 8.0
    sigma_px: Annotated[float, Doc("Noise of the disparities: standard deviation.", "px", above=0)] = 0.25
    seed: Annotated[int, Doc("Of furniture and noise.", least=0)] = 0
    aligned: Annotated[
        bool, Doc("Walls and furniture on borders of cells of 5 and 10 cm, instead of 1.4 cm off them.")
    ] = False

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def camera(self) -> StereoCamera:
        """The camera: 45 degrees across, square pixels."""
        height_px = self.width_px * 3 // 4
        focal_px = self.width_px / 2 / np.tan(HFOV_RAD / 2)
        cx_px, cy_px = (self.width_px - 1) / 2, (height_px - 1) / 2
        return StereoCamera(focal_px, cx_px, cy_px, BASELINE_M, self.width_px, height_px)

    @property
    def poses(self) -> FloatArray:
        """T_world_cam (n, 4, 4): along x, swinging a little in y and in yaw."""
        x_m = np.arange(self.n) * self.spacing_m
        bases = [from_yaw(0.12 * np.sin(0.5 * x), [x, 0.15 * np.sin(x / 3), EYE_M]) for x in x_m]
        return np.array([T_world_base @ from_rotation(R_BASE_OPTICAL) for T_world_base in bases])


@dataclass(frozen=True)
class Frames:
    """Frames of one drive: true poses T_world_cam (N, 4, 4), disparities_px (N, H, W) float32, NaN = missing."""

    config: FramesConfig
    camera: StereoCamera
    mesh: "trimesh.Trimesh"
    poses: FloatArray
    disparities_px: FloatImage

    def __len__(self) -> int:
        return len(self.poses)

    def __iter__(self) -> Iterator[tuple[Disparity, FloatArray]]:
        """(disparity with its sigma, T_world_cam) of each frame."""
        for disparity_px, T_world_cam in zip(self.disparities_px, self.poses, strict=True):
            sigma_px = np.full_like(disparity_px, self.config.sigma_px)
            yield Disparity(disparity_px, sigma_px, **INDEPENDENT), T_world_cam

    def truth(self, cell_m: float) -> MapTruth:
        """What a map of cells of cell_m made of these frames is scored against."""
        labels = label_cells(self.mesh, cell_m)
        visible = visible_cells(labels, self.mesh, self.camera, self.poses, max_range_m=self.config.range_m)
        return MapTruth(self.mesh, self.camera, labels, visible)


def make_frames(config: FramesConfig) -> Frames:
    """The frames of a config; the same config gives the same bytes."""
    camera, poses, mesh = config.camera, config.poses, corridor_mesh(config)
    depths_m = depth_images_m(mesh, camera, poses)
    disparities_px = [noisy_disparity_px(camera, depth_m, config, n) for n, depth_m in enumerate(depths_m)]
    return Frames(config, camera, mesh, poses, np.array(disparities_px))


def noisy_disparity_px(camera: StereoCamera, depth_m: FloatArray, config: FramesConfig, n: int) -> FloatImage:
    """The disparity (H, W) of frame n, whose true depth is depth_m (H, W) [m]: a stream of noise a frame."""
    rng = np.random.default_rng([config.seed, n])
    true_px = camera.disparity_px(np.where(depth_m <= config.range_m, depth_m, np.nan))
    noisy_px = true_px + rng.normal(0.0, config.sigma_px, depth_m.shape)
    noisy_px = np.round(noisy_px / STEP_PX) * STEP_PX
    noisy_px[(rng.random(depth_m.shape) < MISSING) | ~(noisy_px > 0)] = np.nan
    return noisy_px.astype(np.float32)


def depth_images_m(mesh: "trimesh.Trimesh", camera: StereoCamera, poses: FloatArray) -> Iterator[FloatArray]:
    """The exact depth (H, W) of the mesh from each T_world_cam (N, 4, 4) [m]."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(robust=True)
    triangles = TriangleMesh(scene, np.asarray(mesh.triangles, dtype=np.float32))  # noqa: F841, the scene needs it
    rays_cam = camera.ray_directions.reshape(-1, 3)  # at depth 1: embree counts in lengths of the direction
    for T_world_cam in poses:
        directions = (rays_cam @ T_world_cam[:3, :3].T).astype(np.float32)
        origins = np.tile(T_world_cam[:3, 3].astype(np.float32), (len(directions), 1))
        yield as_floats(scene.run(origins, directions, query="DISTANCE")).reshape(camera.shape)


def corridor_mesh(config: FramesConfig) -> "trimesh.Trimesh":
    """A straight corridor of closed boxes: floor, ceiling, walls, ends, furniture along the walls, thin poles."""
    import trimesh

    width_m, height_m, z_m = (2.4, 2.4, 0.0) if config.aligned else (2.3, 2.35, 0.0137)
    start_m, end_m = -BEHIND_M, config.n * config.spacing_m + BEYOND_M
    low, high = np.array([start_m, -width_m / 2, z_m]), np.array([end_m, width_m / 2, z_m + height_m])
    boxes = [*_shell(low, high), *_contents(low, high, config)]
    mesh: trimesh.Trimesh = trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in boxes])
    return mesh


def _shell(low: FloatArray, high: FloatArray) -> Iterator[FloatArray]:
    """The six boxes (2, 3) of WALL_M around the room from low to high [m]; floor and ceiling carry the walls."""
    outer = np.array([low, high]) + np.outer([-WALL_M, WALL_M], [1.0, 1.0, 0.0])
    for axis in (2, 1, 0):
        for side, inwards in ((0, 1), (1, 0)):
            box = outer.copy()
            box[inwards, axis] = (low, high)[side][axis]
            box[side, axis] = (low, high)[side][axis] + (-WALL_M, WALL_M)[side]
            yield box


def _contents(low: FloatArray, high: FloatArray, config: FramesConfig) -> Iterator[FloatArray]:
    """Boxes (2, 3) of furniture and poles that stand on low's z [m], one period after the other."""
    period = [*_furniture(low, high, config), *_poles(low, high, config)]
    for start_m in np.arange(0.0, high[0], PERIOD_M):
        for box in period:
            moved = box + np.array([start_m, 0.0, 0.0])
            if moved[1, 0] < high[0]:
                yield moved


def _furniture(low: FloatArray, high: FloatArray, config: FramesConfig) -> Iterator[FloatArray]:
    rng = np.random.default_rng([config.seed, 0, 1])
    x_m = 2.0
    while x_m < PERIOD_M - 0.5:
        at_left, size_m = rng.random() < 0.5, rng.uniform([0.25, 0.15, 0.3], [0.8, 0.5, 1.9])
        start_m = x_m - size_m[0] / 2
        if config.aligned:
            size_m, start_m = np.maximum(np.round(size_m, 1), 0.1), np.round(start_m, 1)
        corner_m = np.array([start_m, high[1] - size_m[1] if at_left else low[1], low[2]])
        yield np.array([corner_m, corner_m + size_m])
        x_m += rng.uniform(1.5, 3.5)


def _poles(low: FloatArray, high: FloatArray, config: FramesConfig) -> Iterator[FloatArray]:
    """From floor to ceiling, clear of the path of the camera."""
    rng = np.random.default_rng([config.seed, 0, 2])
    for x_m in np.arange(4.0, PERIOD_M, POLE_EVERY_M):
        y_m = rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 0.8)
        corner_m = np.array([x_m - POLE_M / 2, y_m - POLE_M / 2, low[2]])
        yield np.array([corner_m, [*(corner_m[:2] + POLE_M), high[2]]])
