"""What a browser shows of a map: its occupied cells, the robot's path, and what the camera sees, where it sees it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps

from ..camera import StereoCamera
from ..geometry import Array, FloatArray, quaternion_wxyz
from ..observation import Image

MOST_CUBES = 20_000
"""Beyond it cells are drawn as points, which a browser without a graphics card draws too."""
HEIGHTS_M = (-0.2, 1.8)
"""World heights between which the colours run, from dark to light."""
ABOVE_CAMERA_M = 1.0
"""By default, cells higher than this above the camera are left out: a ceiling hides what is below it."""
DARKER = 0.82
"""Every other cell is drawn with this share of its brightness."""
FRUSTUM_M = 0.4
GROUND = {"cell_size": 1.0, "cell_thickness": 0.6, "section_size": 10.0, "section_thickness": 0.8}
"""Squares of a metre."""
RED = (214, 39, 40)
_CORNERS = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(8, 3) - 0.5
_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)
_PALETTE: Array = (255 * colormaps["viridis"](np.linspace(0, 1, 256))[:, :3]).astype(np.uint8)


def height_colours(z_m: FloatArray) -> Array:
    """(N, 3) uint8 of heights (N,) in world [m]."""
    low, high = HEIGHTS_M
    share = np.clip((z_m - low) / (high - low), 0, 1)
    colours: Array = _PALETTE[np.rint(255 * share).astype(np.int64)]
    return colours


def cell_colours(centres_m: FloatArray, cell_m: float) -> Array:
    """(N, 3) uint8 of cells by their centres (N, 3) [m]: by height, and alternating a little, so that one tells cells
    apart."""
    even = np.floor(centres_m / cell_m).astype(np.int64).sum(axis=1) % 2
    shade = np.where(even, 1.0, DARKER)[:, None]
    colours: Array = np.rint(shade * height_colours(centres_m[:, 2])).astype(np.uint8)
    return colours


@dataclass
class Choices:
    """What the person at the page chose: which cells are drawn."""

    threshold: float = 0.6
    below_m: float = 1.4


class MapScene:
    """Draws into a viser server.

    camera_height_m: where the camera is at first, which says what is too high; range_m: how far it sees.
    """

    def __init__(self, server: Any, camera: StereoCamera, *, camera_height_m: float, range_m: float) -> None:
        self._server, self._camera = server, camera
        self.choices = Choices(below_m=round(camera_height_m + ABOVE_CAMERA_M, 1))
        server.scene.set_up_direction("+z")
        server.scene.add_grid("/ground", infinite_grid=True, **GROUND, fade_distance=8 * range_m)
        server.initial_camera.position = (-0.45 * range_m, -0.4 * range_m, 0.6 * range_m)
        server.initial_camera.look_at = (0.6 * range_m, 0.0, 0.1 * range_m)
        self._add_controls()
        self._frustum: Any = None
        self._points: Any = None

    def _add_controls(self) -> None:
        gui, choices = self._server.gui, self.choices
        threshold = gui.add_slider("cells with p above", min=0.5, max=0.95, step=0.05, initial_value=choices.threshold)
        below = gui.add_slider("up to a height of [m]", min=0.0, max=4.0, step=0.1, initial_value=choices.below_m)
        self._words = gui.add_markdown("")

        def choose(_: Any) -> None:
            choices.threshold, choices.below_m = threshold.value, below.value

        threshold.on_update(choose)
        below.on_update(choose)

    def say(self, words: str) -> None:
        """Show a line of Markdown beside the controls."""
        self._words.content = words

    def draw_cells(self, centres_m: FloatArray, cell_m: float) -> None:
        """Cells, by their centres (N, 3) [m], in place of those drawn before."""
        colours = cell_colours(centres_m, cell_m)
        if len(centres_m) > MOST_CUBES:
            self._draw_points(centres_m.astype(np.float32), colours, cell_m)
            return
        self._points = None
        turns = np.broadcast_to(np.array([1, 0, 0, 0], np.float32), (len(centres_m), 4))
        self._server.scene.add_batched_meshes_simple(
            "/map",
            (_CORNERS * cell_m).astype(np.float32),
            _FACES,
            turns,
            centres_m.astype(np.float32),
            batched_colors=colours,
            flat_shading=True,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

    def _draw_points(self, points_m: Array, colours: Array, cell_m: float) -> None:
        if self._points is None:
            self._points = self._server.scene.add_point_cloud(
                "/map", points_m, colours, point_size=0.6 * cell_m, point_shading="flat", precision="float32"
            )
            return
        with self._server.atomic():
            self._points.points, self._points.colors = points_m, colours

    def draw_path(self, path_m: FloatArray) -> None:
        """The camera's way (M, 3) [m] so far, as a red line."""
        if len(path_m) < 2:
            return
        ends = np.stack([path_m[:-1], path_m[1:]], axis=1).astype(np.float32)
        self._server.scene.add_line_segments("/path", ends, RED, thickness=3.0, thickness_units="screen")

    def draw_view(self, left: Image, T_world_cam: FloatArray) -> None:
        """The camera at T_world_cam (4, 4), with its image (H, W) in its frustum."""
        camera = self._camera
        picture = np.repeat(left[:, :, None], 3, axis=2)
        pose = {"wxyz": quaternion_wxyz(T_world_cam), "position": T_world_cam[:3, 3]}
        if self._frustum is None:
            self._frustum = self._server.scene.add_camera_frustum(
                "/camera",
                fov=2 * np.arctan(0.5 * camera.height_px / camera.focal_px),
                aspect=camera.width_px / camera.height_px,
                scale=FRUSTUM_M,
                color=RED,
                image=picture,
                format="jpeg",
                **pose,
            )
            return
        with self._server.atomic():
            self._frustum.image = picture
            self._frustum.wxyz, self._frustum.position = pose["wxyz"], pose["position"]
