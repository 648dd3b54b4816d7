"""What a browser shows of a map: its cells, the robot's path, what the cameras see, a slice and the true mesh."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..camera import StereoCamera
from ..geometry import Array, FloatArray, quaternion_wxyz
from ..observation import Image
from .cell_blocks import CellBlocks
from .colours import RED, slice_image
from .controls import AXES

MOST_CUBES = 20_000
"""Beyond it cells are drawn as points, which a browser without a graphics card draws too."""
MOST_CELLS = 1_500_000
"""Beyond it cells are drawn coarser."""
EXACT_FLOAT16 = 2048
"""Whole numbers up to it are exact in two bytes."""
FRUSTUM_M = 0.4
SMALL_M = 0.12
"""Of the frustums that are not the current one."""
BEHIND_M = 0.8
"""From here behind a camera one looks over its shoulder."""
GROUND = {"cell_size": 1.0, "cell_thickness": 0.6, "section_size": 10.0, "section_thickness": 0.8}
"""Squares of a metre."""
GREY = (110, 110, 110)
TRUTH_RGB = (0, 158, 115)
LEAST_PX = 512
"""Slices of fewer cells are enlarged, so that their cells have sharp edges in a browser."""
_CORNERS = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(8, 3) - 0.5
_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


class MapScene:
    """Draws into a viser server. camera: of the frustums, None where there are none."""

    def __init__(self, server: Any, camera: StereoCamera | None, *, fade_m: float) -> None:
        self._server, self._camera = server, camera
        server.scene.set_up_direction("+z")
        server.scene.add_grid("/ground", infinite_grid=True, **GROUND, fade_distance=fade_m)
        self._frustum: Any = None
        self._points: Any = None
        self._gizmo: Any = None
        self._slice: Any = None
        self._truth: Any = None
        self._small: list[Any] = []

    def look_from(self, position_m: Sequence[float], look_at_m: Sequence[float]) -> None:
        """Where browsers that come later look from."""
        self._server.initial_camera.position = tuple(map(float, position_m))
        self._server.initial_camera.look_at = tuple(map(float, look_at_m))

    def draw_cells(self, cells: Array, cell_m: float, colours: Array) -> None:
        """Cells (N, 3) in colours (N, 3), in place of those drawn before."""
        if len(cells) > MOST_CUBES:
            self._draw_points(cells, cell_m, colours)
            return
        self._points = None
        turns = np.broadcast_to(np.array([1, 0, 0, 0], np.float32), (len(cells), 4))
        self._server.scene.add_batched_meshes_simple(
            "/map",
            (_CORNERS * cell_m).astype(np.float32),
            _FACES,
            turns,
            ((cells + 0.5) * cell_m).astype(np.float32),
            batched_colors=colours,
            flat_shading=True,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

    def _draw_points(self, cells: Array, cell_m: float, colours: Array) -> None:
        """Counted in cells from the middle one: where they fit in two bytes each, nine bytes go out a cell."""
        middle = (cells.min(axis=0) + cells.max(axis=0)) // 2
        near = cells - middle
        precision = "float16" if np.abs(near).max() <= EXACT_FLOAT16 else "float32"
        points = near.astype(np.float16 if precision == "float16" else np.float32)
        position = (middle + 0.5) * cell_m
        if self._points is None:
            self._points = self._server.scene.add_point_cloud(
                "/map",
                points,
                colours,
                point_size=1.0,
                point_shading="flat",
                precision=precision,
                scale=cell_m,
                position=position,
            )
            return
        with self._server.atomic():
            self._points.precision = precision
            self._points.points, self._points.colors = points, colours
            self._points.scale, self._points.position = cell_m, position

    def draw_path(self, path_m: FloatArray, ahead_m: FloatArray | None = None) -> None:
        """The camera's way (M, 3) [m] so far, as a red line; ahead_m (K, 3): the rest of it, as a thin grey one."""
        self._draw_line("/path", path_m, RED, 3.0)
        if ahead_m is not None:
            self._draw_line("/ahead", ahead_m, GREY, 1.0)

    def _draw_line(self, name: str, path_m: FloatArray, colour: tuple[int, int, int], thickness: float) -> None:
        path = path_m if len(path_m) > 1 else np.repeat(path_m, 2, axis=0) if len(path_m) else np.zeros((2, 3))
        ends = np.stack([path[:-1], path[1:]], axis=1).astype(np.float32)
        self._server.scene.add_line_segments(
            name, ends, colour, thickness=thickness, thickness_units="screen", visible=len(path_m) > 1
        )

    def draw_view(self, picture: Image, T_world_cam: FloatArray) -> None:
        """The camera at T_world_cam (4, 4), with its image (H, W), or one in colours (H, W, 3), in its frustum."""
        shown = np.repeat(picture[:, :, None], 3, axis=2) if picture.ndim == 2 else picture
        pose = {"wxyz": quaternion_wxyz(T_world_cam), "position": T_world_cam[:3, 3]}
        if self._frustum is None:
            self._frustum = self._add_frustum("/camera", T_world_cam, FRUSTUM_M, RED, image=shown, format="jpeg")
            return
        with self._server.atomic():
            self._frustum.image = shown
            self._frustum.wxyz, self._frustum.position = pose["wxyz"], pose["position"]

    def _add_frustum(self, name: str, T_world_cam: FloatArray, scale_m: float, colour: Any, **options: Any) -> Any:
        camera = self._camera
        if camera is None:
            return None
        return self._server.scene.add_camera_frustum(
            name,
            fov=2 * np.arctan(0.5 * camera.height_px / camera.focal_px),
            aspect=camera.width_px / camera.height_px,
            scale=scale_m,
            color=colour,
            wxyz=quaternion_wxyz(T_world_cam),
            position=T_world_cam[:3, 3],
            **options,
        )

    def add_frustums(self, poses: FloatArray, clicked: Callable[[int], object]) -> None:
        """Thin ones at poses (K, 4, 4); a click on one looks from there, and calls clicked with its row."""
        for row, pose in enumerate(poses):
            frustum = self._add_frustum(
                f"/cameras/{row}", pose, SMALL_M, GREY, thickness=1.0, thickness_units="screen", variant="filled"
            )

            def click(event: Any, row: int = row, pose: FloatArray = pose) -> None:
                with event.client.atomic():
                    event.client.camera.wxyz = quaternion_wxyz(pose)
                    event.client.camera.position = pose[:3, 3] - BEHIND_M * pose[:3, 2]
                clicked(row)

            frustum.on_click(click)
            self._small.append(frustum)

    def show_frustums(self, visible: bool) -> None:
        """Whether the thin ones are drawn."""
        for each in self._small:
            if each.visible != visible:
                each.visible = visible

    def draw_slice(self, blocks: CellBlocks, axis: str, index: int, dragged: Callable[[float], None]) -> None:
        """Probabilities of the cells at an index along an axis, as a picture in its place, with a handle to drag."""
        n = AXES.index(axis)
        values, first = blocks.layer(n, index)
        picture = slice_image(blocks.probability(values)) if values.size else np.full((1, 1, 3), 255, np.uint8)
        size = np.array(picture.shape[:2])
        middle_m = np.insert((first + size / 2) * blocks.cell_m, n, (index + 0.5) * blocks.cell_m)
        larger = max(1, -(-LEAST_PX // int(size.max())))
        shown = picture.repeat(larger, axis=0).repeat(larger, axis=1)
        # Columns of a picture go along its x, rows along its y.
        self._slice = self._server.scene.add_image(
            "/slice",
            np.ascontiguousarray(shown.transpose(1, 0, 2)),
            render_width=size[0] * blocks.cell_m,
            render_height=size[1] * blocks.cell_m,
            format="png",
            wxyz=_PLANE_WXYZ[axis],
            position=middle_m,
            cast_shadow=False,
            receive_shadow=False,
        )
        self._move_handle(n, middle_m, blocks.cell_m, dragged)

    def _move_handle(self, n: int, middle_m: FloatArray, cell_m: float, dragged: Callable[[float], None]) -> None:
        along = tuple(each == n for each in range(3))
        if self._gizmo is not None and self._gizmo.active_axes == along:
            # Not under the hand of who drags it: only where the slider moved the plane.
            if abs(self._gizmo.position[n] - middle_m[n]) > cell_m:
                self._gizmo.position = middle_m
            return
        self.hide_handle()
        self._gizmo = self._server.scene.add_transform_controls(
            "/handle",
            scale=0.8,
            active_axes=along,
            disable_sliders=True,
            disable_rotations=True,
            depth_test=False,
            position=middle_m,
        )
        self._gizmo.on_update(lambda event: dragged(float(event.target.position[n])))

    def hide_slice(self) -> None:
        """It goes, and its handle."""
        if self._slice is not None:
            self._slice.remove()
            self._slice = None
        self.hide_handle()

    def hide_handle(self) -> None:
        """It goes."""
        if self._gizmo is not None:
            self._gizmo.remove()
            self._gizmo = None

    def draw_truth(self, corners_m: FloatArray, faces: Array) -> None:
        """The true mesh, of corners (V, 3) [m] and faces (F, 3)."""
        self._truth = self._server.scene.add_mesh_simple(
            "/truth",
            corners_m,
            faces,
            color=TRUTH_RGB,
            opacity=0.5,
            flat_shading=True,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

    def fade_truth(self, opacity: float) -> None:
        """How much of it one sees; 0: nothing."""
        if self._truth is not None:
            self._truth.opacity, self._truth.visible = opacity, opacity > 0


_HALF = float(np.sqrt(0.5))
_PLANE_WXYZ = {"x": (0.5, 0.5, 0.5, 0.5), "y": (_HALF, _HALF, 0.0, 0.0), "z": (1.0, 0.0, 0.0, 0.0)}
"""Turns a picture's x and y into the other axes in their order: y and z, x and z, x and y."""
