"""A reading as a person sees it: the left image beside its disparity."""

import numpy as np
from matplotlib.figure import Figure

from ..observation import Disparity, Image
from .colours import SCALE
from .save import NotebookFigure


def disparity_figure(left: Image, disparity: Disparity, *, title: str = "") -> Figure:
    """The left image (H, W) beside its disparity [px]; pixels without a match are white."""
    height, width = left.shape
    figure = NotebookFigure(figsize=(11, 11 * 0.46 * height / width + 0.9), layout="constrained")
    photo, panel = figure.subplots(1, 2)
    photo.imshow(left, cmap="gray", vmin=0, vmax=255)
    photo.set_title(title or "left image")
    largest = float(np.nanpercentile(disparity.disparity_px, 99)) if disparity.valid.any() else 1.0
    drawn = panel.imshow(disparity.disparity_px, cmap=SCALE, vmin=0, vmax=largest, interpolation="nearest")
    panel.set_title(f"disparity, {100 * disparity.density:.0f} % of pixels matched")
    figure.colorbar(drawn, ax=panel, label="disparity [px]", shrink=0.8)
    for axes in (photo, panel):
        axes.set_xticks([])
        axes.set_yticks([])
    return figure
