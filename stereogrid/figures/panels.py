"""Disparities of one pair side by side, and where each is wrong."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..geometry import FloatArray
from ..observation import FloatImage, Image
from .colours import SCALE
from .save import NotebookFigure

Mask = NDArray[np.bool_]
PANEL_INCHES = 2.7
STEPS_PX = (0.5, 1.0, 2.0, 4.0)
ERROR_CLASSES = (
    ("off by up to 0.5 px", "#fdf3e3"),
    ("0.5 to 1 px", "#fdcc8a"),
    ("1 to 2 px", "#fc8d59"),
    ("2 to 4 px", "#d7301f"),
    ("more than 4 px", "#7a0010"),
    ("no match", "#9a9a9a"),
    ("occluded, matched", "#4f86c6"),
    ("occluded, no match", "#c3d8f0"),
    ("not judged", "#000000"),
)
"""What a pixel of the error map can be, with its colour; the numbers of error_classes count through them."""
NO_MATCH, OCCLUDED_MATCHED, OCCLUDED_UNMATCHED, NOT_JUDGED = 5, 6, 7, 8


def error_classes(found_px: FloatImage, truth_px: FloatArray, visible: Mask, hidden: Mask) -> NDArray[np.uint8]:
    """For each pixel (H, W) which of ERROR_CLASSES it is; visible and hidden: both images show it, only the left."""
    matched = ~np.isnan(found_px)
    classes = np.full(found_px.shape, NOT_JUDGED, np.uint8)
    both = visible & matched
    classes[both] = np.digitize(np.abs(found_px[both] - truth_px[both]), STEPS_PX, right=True)
    classes[visible & ~matched] = NO_MATCH
    classes[hidden & matched], classes[hidden & ~matched] = OCCLUDED_MATCHED, OCCLUDED_UNMATCHED
    return classes


def panels_figure(
    left: Image,
    truth_px: FloatArray,
    found_px: Mapping[str, FloatImage],
    *,
    masks: tuple[Mask, Mask],
) -> Figure:
    """The left image (H, W[, 3] BGR) above the true disparity; beside them each disparity above its error map.

    found_px: disparities by the panel's title, NaN = no match (white). masks: visible and hidden, as error_classes
    takes them. All disparities share one scale.
    """
    height, width = truth_px.shape
    columns = 1 + len(found_px)
    size = (PANEL_INCHES * columns + 0.9, 2 * PANEL_INCHES * height / width + 1.7)
    figure = NotebookFigure(figsize=size, layout="constrained")
    axes = figure.subplots(2, columns)
    largest = float(np.nanmax(truth_px))
    axes[0, 0].imshow(left[..., ::-1] if left.ndim == 3 else left, cmap="gray", vmin=0, vmax=255)
    axes[0, 0].set_title("left image", fontsize=10)
    drawn = _draw_disparity(axes[1, 0], truth_px, "true disparity", largest)
    for (above, below), (name, disparity_px) in zip(axes[:, 1:].T, found_px.items(), strict=True):
        _draw_disparity(above, disparity_px, name, largest)
        _draw_error(below, error_classes(disparity_px, truth_px, *masks))
    for each in axes.flat:
        each.set(xticks=[], yticks=[])
    figure.colorbar(drawn, ax=axes[0, :], label="disparity [px]", pad=0.01, shrink=0.9)
    patches = [Patch(facecolor=colour, edgecolor="0.5", label=name) for name, colour in ERROR_CLASSES]
    figure.legend(handles=patches, loc="outside lower center", ncols=5, fontsize=9, frameon=False)
    return figure


def _draw_disparity(axes: Axes, disparity_px: FloatArray | FloatImage, title: str, largest: float) -> AxesImage:
    axes.set_title(title, fontsize=10)
    return axes.imshow(disparity_px, cmap=SCALE, vmin=0, vmax=largest, interpolation="nearest")


def _draw_error(axes: Axes, classes: NDArray[np.uint8]) -> None:
    colours = ListedColormap([colour for _, colour in ERROR_CLASSES])
    axes.imshow(classes, colours, vmin=-0.5, vmax=len(ERROR_CLASSES) - 0.5, interpolation="nearest")
    axes.set_title("its errors", fontsize=10)
