"""The 3D map as cubes, obstacles in blue, with the camera drawn as a vermilion frustum (the paper's Fig. 9)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, inverse, look_at, transform
from ..grid import OccupancyGrid
from .colours import PATH_COLOUR
from .save import NotebookFigure

FACE_NORMALS: Array = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
FACE_SHADES = (0.78, 0.78, 0.62, 0.62, 1.0, 0.5)
"""Brightness of the faces, so that edges show."""
GROUND_COLOUR = (0.86, 0.86, 0.83)
LOW_COLOUR, HIGH_COLOUR = (0.10, 0.22, 0.58), (0.45, 0.72, 0.98)
HEIGHTS_M = (-1.5, 1.5)
"""Heights against the camera between which the blue runs from dark to light."""
MOST_FACES = 400_000


def cubes_figure(
    grid: OccupancyGrid,
    T_world_cam: FloatArray,
    camera: StereoCamera,
    *,
    back_and_up_m: tuple[float, float] = (4.0, 3.0),
    path_m: FloatArray,
    heights_m: tuple[float, float] = (-np.inf, np.inf),
    ground_m: float | None = None,
    title: str = "",
) -> Figure:
    """Cells with p > threshold as cubes, seen from behind and above the camera by back_and_up_m.

    path_m (N, 3): the camera's path, a vermilion line; heights are counted from its nearest point, so that a road may
    climb. Cells between heights_m are drawn (a ceiling is cut away with it), those below ground_m in grey.
    T_world_cam (4, 4): where the frustum stands.
    """
    T_eye_world = inverse(eye_behind(T_world_cam, *back_and_up_m))
    centres = grid.occupied_centres()
    above_m = above_path_m(centres, path_m)
    kept = (above_m >= heights_m[0]) & (above_m <= heights_m[1])
    if not kept.any():
        raise InvalidInputError("the map has no occupied cell in the heights to be drawn")
    cells = np.floor(centres[kept] / grid.cell_m).astype(np.int64)
    polygons, colours = _faces(cells, _colours(above_m[kept], ground_m), grid.cell_m, T_eye_world)
    figure = NotebookFigure(figsize=(9, 5.4), layout="constrained")
    axes = figure.add_subplot()
    axes.add_collection(PolyCollection(list(polygons), facecolors=colours, edgecolors="face", linewidths=0.15))
    _draw_lines(axes, T_eye_world, np.stack([path_m[:-1], path_m[1:]], axis=1), 1.0)
    _draw_lines(axes, T_eye_world, frustum_lines_m(camera, T_world_cam), 1.6)
    (left, right), (low, high) = (_extent(polygons[..., n], limit) for n, limit in ((0, 0.75), (1, 0.5)))
    axes.set(xlim=(left, right), ylim=(low, high), aspect="equal", title=title)
    axes.set_axis_off()
    return figure


def above_path_m(points_m: FloatArray, path_m: FloatArray) -> FloatArray:
    """How far points (N, 3) lie above the nearest point (in x and y) of the camera's path (M, 3) [m]."""
    nearest = KDTree(path_m[:, :2]).query(points_m[:, :2])[1]
    above_m: FloatArray = points_m[:, 2] - path_m[nearest, 2]
    return above_m


def eye_behind(T_world_cam: FloatArray, back_m: float, up_m: float) -> FloatArray:
    """A viewer's pose (4, 4) behind and above a camera, looking a little ahead of it."""
    forward = T_world_cam[:3, 2] * [1, 1, 0]
    if np.linalg.norm(forward) < 1e-6:
        # A camera that looks straight down: its image's upper edge says which way is ahead.
        forward = -T_world_cam[:3, 1] * [1, 1, 0]
    forward /= np.linalg.norm(forward)
    at = T_world_cam[:3, 3] - back_m * forward + [0, 0, up_m]
    return look_at(at, T_world_cam[:3, 3] + 0.5 * back_m * forward)


def frustum_lines_m(camera: StereoCamera, T_world_cam: FloatArray, depth_m: float = 0.8) -> FloatArray:
    """Edges (8, 2, 3) in world of the left camera's view up to depth_m [m]."""
    corners = camera.ray_directions[[0, 0, -1, -1], [0, -1, -1, 0]] * depth_m
    apex = np.zeros((4, 3))
    edges = np.concatenate([np.stack([apex, corners], 1), np.stack([corners, np.roll(corners, -1, 0)], 1)])
    return transform(T_world_cam, edges)


def _extent(values: FloatArray, limit: float) -> tuple[float, float]:
    """Where the picture begins and ends: around all that is drawn, within +-limit of the view's axis."""
    return max(float(values.min()) - 0.02, -limit), min(float(values.max()) + 0.02, limit)


def _faces(cells: Array, cell_colours: FloatArray, cell_m: float, T_eye_world: FloatArray) -> tuple[Array, Array]:
    """Polygons (F, 4, 2) of the outer faces of cubes (N, 3) that the eye sees, far ones first; colours (F, 3)."""
    eye_m = inverse(T_eye_world)[:3, 3]
    occupied = set(map(tuple, cells.tolist()))
    corners, depths, colours = [], [], []
    for normal, shade in zip(FACE_NORMALS, FACE_SHADES, strict=True):
        beside = cells + normal
        open_side = np.array([tuple(c) not in occupied for c in beside.tolist()])
        middle = (cells + 0.5 + 0.5 * normal) * cell_m
        facing = ((eye_m - middle) @ normal) > 0
        kept = open_side & facing & (transform(T_eye_world, middle)[:, 2] > 0.3)
        quad = transform(T_eye_world, middle[kept][:, None] + _square(normal) * cell_m)
        corners.append(quad)
        depths.append(np.linalg.norm(quad.mean(axis=1), axis=1))
        colours.append(cell_colours[kept] * shade)
    quads, depth, colour = (np.concatenate(parts) for parts in (corners, depths, colours))
    order = np.argsort(-depth, kind="stable")[-MOST_FACES:]
    quads, depth = quads[order], depth[order]
    near = np.all(quads[:, :, 2] > 0.05, axis=1)
    haze = np.clip(depth / 40, 0, 0.6)[:, None]
    flat = quads[near, :, :2] / quads[near, :, 2:] * [1, -1]
    return flat, (colour[order] * (1 - haze) + haze)[near]


def _square(normal: Array) -> FloatArray:
    """Corners (4, 3) of a unit face about its middle."""
    u, v = np.delete(np.eye(3), int(np.argmax(np.abs(normal))), axis=0)
    return 0.5 * np.stack([-u - v, u - v, u + v, -u + v])


def _colours(above_m: FloatArray, ground_m: float | None) -> FloatArray:
    """(N, 3): blue, lighter with height above the path (N,); grey below ground_m."""
    share = np.clip((above_m - HEIGHTS_M[0]) / (HEIGHTS_M[1] - HEIGHTS_M[0]), 0, 1)[:, None]
    blue: FloatArray = (1 - share) * np.array(LOW_COLOUR) + share * np.array(HIGH_COLOUR)
    if ground_m is not None:
        blue[above_m < ground_m] = GROUND_COLOUR
    return blue


def _draw_lines(axes: Axes, T_eye_world: FloatArray, segments_m: FloatArray, width: float) -> None:
    """Segments (S, 2, 3) in world as vermilion lines; those behind the eye are left out."""
    seen = transform(T_eye_world, segments_m)
    seen = seen[(seen[:, :, 2] > 0.1).all(axis=1)]
    flat = seen[:, :, :2] / seen[:, :, 2:] * [1, -1]
    axes.add_collection(LineCollection(list(flat), colors=PATH_COLOUR, linewidths=width))
