"""A still picture of a world: a bystander's view, what both cameras of the robot see, and the true depth."""

import io
from pathlib import Path

import cv2
import numpy as np
import PIL.Image
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import KDTree

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.files import check_writable, written_beside
from stereogrid.observation import FloatImage

from ..rig import StereoRig
from ..scene.scene import World
from .robot_body import TINTS
from .viewer import Sight, Viewer, pose_at

WIDTH_PX, GAP_PX, TITLE_PX, CAPTION_PX, SCALE_PX = 1200, 12, 38, 28, 36
"""Of the picture: its width, the gaps at its edges and between panels, and room for texts."""
OVERVIEW_PX = (WIDTH_PX - 2 * GAP_PX, 490)
BYSTANDER = StereoCamera(760.0, (OVERVIEW_PX[0] - 1) / 2, (OVERVIEW_PX[1] - 1) / 2, 0.06, *OVERVIEW_PX)
SMALL_PX = (OVERVIEW_PX[0] - 2 * GAP_PX) // 3
NEAR_M, FAR_M = 0.5, 30.0
"""Depths at the ends of the colour scale, which is logarithmic."""
DEPTH_TICKS_M = (0.5, 1, 2, 5, 10, 30)
NO_DEPTH_GRAY = 236
MOST_BYTES = 300_000
GRAY_LEVELS = (128, 64, 48, 40, 32, 24, 16)
"""Of the picture: the first number with which it is small enough is taken. Colours are few and keep their places."""
ROBOT_LEVELS = 10
DOTS_PER_INCH = 100
RGB = NDArray[np.uint8]


def draw_picture(world: World, out: str | Path, *, at_m: float | None = None, rig: StereoRig | None = None) -> Path:
    """Write the picture (.png) of a world with the robot at_m along its path [m], by default a quarter of it.

    Raises InvalidInputError for another suffix, for a place beyond the path, or when the file cannot be written.
    """
    path = Path(out)
    if path.suffix.lower() != ".png":
        raise InvalidInputError(f"{path}: no picture has the suffix {path.suffix!r}; choose .png")
    check_writable(path)
    station_m = world.path_length_m / 4 if at_m is None else at_m
    T_world_base = pose_at(world, station_m)
    sight = Viewer(world, BYSTANDER, rig).look(T_world_base)
    title = f"{world.name}, seed {world.seed}: {station_m:.1f} m along a path of {world.path_length_m:.1f} m"
    content = png_within(compose(sight, title), MOST_BYTES)
    with written_beside(path) as temporary:
        temporary.write_bytes(content)
    return path


def compose(sight: Sight, title: str) -> RGB:
    """The picture (H, WIDTH_PX, 3) uint8 RGB: the overview above, both images and the depth below."""
    small = (SMALL_PX, round(SMALL_PX * sight.left.shape[0] / sight.left.shape[1]))
    top = TITLE_PX + OVERVIEW_PX[1] + CAPTION_PX
    height = top + small[1] + SCALE_PX
    figure = Figure(figsize=(WIDTH_PX / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH)
    canvas = FigureCanvasAgg(figure)
    _panel(figure, sight.overview, (GAP_PX, TITLE_PX), title, size=13)
    depth_m = cv2.resize(sight.depth_m, small, interpolation=cv2.INTER_NEAREST)
    pictures = {
        "Left camera": _rgb(sight.left, small),
        "Right camera": _rgb(sight.right, small),
        "True depth of the left image [m]": depth_colours(depth_m),
    }
    for k, (caption, picture) in enumerate(pictures.items()):
        _panel(figure, picture, (GAP_PX + k * (SMALL_PX + GAP_PX), top), caption, size=10)
    _scale(figure, (GAP_PX + 2 * (SMALL_PX + GAP_PX), top + small[1] + 6))
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]


def depth_colours(depth_m: FloatImage) -> RGB:
    """Depths (H, W) [m] as colours (H, W, 3): red near, blue far, light gray where there is none."""
    share = np.log(np.clip(depth_m, NEAR_M, FAR_M) / NEAR_M) / np.log(FAR_M / NEAR_M)
    level = (255 * (1 - np.nan_to_num(share)) + 0.5).astype(np.uint8)
    colours: RGB = cv2.cvtColor(cv2.applyColorMap(level, cv2.COLORMAP_TURBO), cv2.COLOR_BGR2RGB)
    colours[~np.isfinite(depth_m)] = NO_DEPTH_GRAY
    return colours


def png_within(picture: RGB, most_bytes: int) -> bytes:
    """A PNG of a picture (H, W, 3) with as many of GRAY_LEVELS as fit into most_bytes; the fewest if none do."""
    content = b""
    for levels in GRAY_LEVELS:
        buffer = io.BytesIO()
        index, palette = _indexed(picture, levels)
        image = PIL.Image.fromarray(index)
        image.putpalette(palette.tobytes())
        image.save(buffer, format="png", optimize=True)
        content = buffer.getvalue()
        if len(content) <= most_bytes:
            break
    return content


def _indexed(picture: RGB, levels: int) -> tuple[NDArray[np.uint8], RGB]:
    """The picture as indices (H, W) into a palette (N, 3): gray levels, and the colours of depths and of the robot."""
    grays = np.rint(np.linspace(0, 255, levels)).astype(np.uint8)
    depths = depth_colours(np.geomspace(NEAR_M, FAR_M, 64, dtype=np.float32)[None])[0]
    shades = np.linspace(25, 130, ROBOT_LEVELS)[:, None]
    robot = [np.clip(shades * tint, 0, 255).astype(np.uint8) for tint in TINTS.values()]
    colours = np.concatenate([depths, *robot])
    flat = picture.astype(np.int32)
    index = np.rint(flat[..., 1] * ((levels - 1) / 255)).astype(np.uint8)
    coloured = np.ptp(flat, axis=2) > 12
    tree = KDTree(colours.astype(float))
    index[coloured] = levels + tree.query(flat[coloured])[1]
    return index, np.concatenate([np.repeat(grays[:, None], 3, axis=1), colours])


def _rgb(image: NDArray[np.uint8], size_px: tuple[int, int]) -> RGB:
    small = cv2.resize(image, size_px, interpolation=cv2.INTER_AREA)
    rgb: RGB = cv2.cvtColor(small, cv2.COLOR_GRAY2RGB)
    return rgb


def _axes(figure: Figure, place_px: tuple[int, int], size_px: tuple[int, int]) -> Axes:
    """Axes of exactly that size at a place (from the left, from the top), so that pixels stay pixels."""
    width, height = figure.get_size_inches() * DOTS_PER_INCH
    (x, y), (w, h) = place_px, size_px
    return figure.add_axes((x / width, 1 - (y + h) / height, w / width, h / height))


def _panel(figure: Figure, picture: RGB, place_px: tuple[int, int], caption: str, *, size: int) -> None:
    axes = _axes(figure, place_px, (picture.shape[1], picture.shape[0]))
    axes.imshow(picture, interpolation="none", aspect="auto")
    axes.set_axis_off()
    axes.set_title(caption, fontsize=size, loc="left", pad=5)


def _scale(figure: Figure, place_px: tuple[int, int]) -> None:
    """The colours of the depths below their panel."""
    axes = _axes(figure, place_px, (SMALL_PX, 10))
    depths_m = np.geomspace(NEAR_M, FAR_M, SMALL_PX).astype(np.float32)
    axes.imshow(depth_colours(depths_m[None]), aspect="auto", interpolation="none")
    at = np.log(np.array(DEPTH_TICKS_M) / NEAR_M) / np.log(FAR_M / NEAR_M) * (SMALL_PX - 1)
    axes.set_yticks([])
    axes.set_xticks(at, [f"{depth:g}" for depth in DEPTH_TICKS_M], fontsize=9)
    axes.tick_params(length=3, pad=2)
    first, *_, last = axes.get_xticklabels()
    first.set_horizontalalignment("left")
    last.set_horizontalalignment("right")
