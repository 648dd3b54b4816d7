"""The 2D slice of the map parallel to the ground (the paper's Fig. 7)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Patch

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray
from ..grid import OccupancyGrid
from ..thumbnails import UNKNOWN_RGB
from .colours import PATH_COLOUR, TRUTH_COLOUR
from .save import NotebookFigure

UNKNOWN_COLOUR = "#{:02x}{:02x}{:02x}".format(*UNKNOWN_RGB)
LARGEST_CELLS = 4000
"""Pixels along the longer edge; larger maps are sampled more coarsely."""


def slice_figure(
    grid: OccupancyGrid,
    height_m: float,
    *,
    path_m: FloatArray | None = None,
    truth_segments_m: FloatArray | None = None,
    title: str = "",
) -> Figure:
    """p(occupied) at z = height_m [m] in world: white free, black occupied, blue-grey unknown.

    path_m (N, 3): where the camera went, drawn in vermilion. truth_segments_m (S, 2, 3): the true surfaces' section
    with the plane, in green.
    """
    width_m, depth_m = _span_m(grid, height_m)
    figure = NotebookFigure(figsize=(9, float(np.clip(7.2 * depth_m / width_m, 2.0, 9)) + 1.2), layout="constrained")
    axes = figure.add_subplot()
    image = draw_slice(axes, grid, height_m)
    figure.colorbar(image, ax=axes, label="p(occupied)", shrink=0.8, aspect=30)
    _overlays(axes, path_m, truth_segments_m)
    _legend(figure, axes)
    axes.set(xlabel="x (world) [m]", ylabel="y (world) [m]", title=title or f"Slice at z = {height_m:.2f} m")
    return figure


def slices_figure(
    grids: Mapping[str, OccupancyGrid],
    height_m: float,
    *,
    path_m: FloatArray | None = None,
    truth_segments_m: FloatArray | None = None,
) -> Figure:
    """The slices of several maps of one place, by name, as slice_figure draws them and all to one scale.

    Long maps stand one above the other, tall ones side by side.
    """
    figure, all_axes = _side_by_side(np.max([_span_m(grid, height_m) for grid in grids.values()], axis=0), len(grids))
    limits = []
    for axes, (name, grid) in zip(all_axes, grids.items(), strict=True):
        image = draw_slice(axes, grid, height_m)
        limits.append(image.get_extent())
        _overlays(axes, path_m, truth_segments_m)
        axes.set(title=name, xlabel="x (world) [m]", ylabel="y (world) [m]")
        axes.label_outer()
    if path_m is not None:
        x, y = path_m[:, 0], path_m[:, 1]
        limits.append((x.min() - 0.1, x.max() + 0.1, y.min() - 0.1, y.max() + 0.1))
    low, high = np.min(limits, axis=0), np.max(limits, axis=0)
    all_axes[0].set(xlim=(low[0], high[1]), ylim=(low[2], high[3]))
    figure.colorbar(image, ax=all_axes, label="p(occupied)", shrink=0.6, aspect=30)
    _legend(figure, all_axes[0])
    return figure


def _side_by_side(span_m: FloatArray, n: int) -> tuple[Figure, list[Axes]]:
    """A figure with room for n slices of that width and depth."""
    width_m, depth_m = span_m
    long = width_m > depth_m
    shape = (n, 1) if long else (1, n)
    each_inches = [9.0, 7.6 * depth_m / width_m + 0.4] if long else [6.0 * width_m / depth_m + 0.5, 6.0]
    size = (each_inches[0] * shape[1] + 0.6, each_inches[1] * shape[0] + 1.0)
    figure = NotebookFigure(figsize=size, layout="constrained")
    return figure, list(figure.subplots(*shape, sharex=True, sharey=True, squeeze=False).ravel())


def _span_m(grid: OccupancyGrid, height_m: float) -> tuple[float, float]:
    """Width and depth of the known part of the slice [m]."""
    x, y, _ = _sample(grid, height_m)
    return max(x[-1] - x[0], 1e-9), max(y[-1] - y[0], 1e-9)


def draw_slice(axes: Axes, grid: OccupancyGrid, height_m: float) -> AxesImage:
    """The slice at z = height_m [m] alone, into axes."""
    x, y, p = _sample(grid, height_m)
    half = (x[1] - x[0]) / 2
    axes.set_facecolor(UNKNOWN_COLOUR)
    return axes.imshow(
        p.T,
        origin="lower",
        extent=(x[0] - half, x[-1] + half, y[0] - half, y[-1] + half),
        cmap="gray_r",
        vmin=0,
        vmax=1,
        interpolation="nearest",
    )


def _legend(figure: Figure, axes: Axes) -> None:
    # Below the axes: inside them it would hide a part of the map.
    unknown = Patch(facecolor=UNKNOWN_COLOUR, edgecolor="0.6", label="unknown")
    handles = [*axes.get_legend_handles_labels()[0], unknown]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)


def _sample(grid: OccupancyGrid, height_m: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cell centres x (X,), y (Y,) [m] of the known part of the slice and p (X, Y), NaN = unknown."""
    layer = grid.known_layer(height_m)
    if not len(layer):
        k = grid.known_cells()[0][:, 2]
        ends_m = f"from {k.min() * grid.cell_m:.2f} to {(k.max() + 1) * grid.cell_m:.2f} m" if len(k) else "none at all"
        raise InvalidInputError(
            f"the map knows no cell at z = {height_m:.2f} m, so there is no slice to draw; its cells: {ends_m}"
        )
    low, high = layer.min(axis=0) - 1, layer.max(axis=0) + 2
    stride = int(np.ceil((high - low).max() / LARGEST_CELLS))
    x, y = ((np.arange(a, b, stride) + 0.5) * grid.cell_m for a, b in zip(low, high, strict=True))
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((len(x), len(y)), height_m)], axis=-1)
    return x, y, grid.probability(points.reshape(-1, 3)).reshape(len(x), len(y))


def _overlays(axes: Axes, path_m: Array | None, truth_segments_m: Array | None) -> None:
    if truth_segments_m is not None and len(truth_segments_m):
        lines = LineCollection(list(truth_segments_m[:, :, :2]), colors=TRUTH_COLOUR, linewidths=0.7, label="truth")
        axes.add_collection(lines, autolim=False)
    if path_m is not None:
        axes.plot(path_m[:, 0], path_m[:, 1], color=PATH_COLOUR, linewidth=1.2, label="camera path")
        axes.plot(*path_m[0, :2], "o", color=PATH_COLOUR, markersize=4)
