"""How well a calibration fits: where corners are off, what of the pictures was seen, and a rectified pair."""

from collections.abc import Collection, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from ..calibration import BoardViews, Residuals, StereoCalibration
from ..calibration.rig import Both
from ..geometry import FloatArray
from ..observation import Image
from .save import NotebookFigure

BLUE, ORANGE = "#1f4e9c", "#c8651b"
ARROW_OF_WIDTH = 0.06
"""The longest arrows of errors that are no exceptions, in widths of the picture."""
LINES = 16


def calibration_figure(views: BoardViews, found: Residuals, far: Collection[str] = ()) -> Figure:
    """Both pictures with the errors of all corners and the boards' outlines; below, the difference of rectified rows
    and the error of each pair. far: names of pairs that are drawn apart."""
    figure = NotebookFigure(figsize=(11, 8.2), layout="constrained")
    axes = figure.subplots(2, 2, height_ratios=(1.25, 1))
    longest_px = max(float(np.percentile(np.linalg.norm(off, axis=-1), 98)) for off in found.off_px)
    times = float(f"{ARROW_OF_WIDTH * views.size_px[0] / max(longest_px, 1e-6):.1g}")
    for each, side, corners, off_px in zip(axes[0], ("left", "right"), views.corners, found.off_px, strict=True):
        _draw_errors(each, views, corners, off_px * times)
        each.set_title(f"{side} picture: boards seen, and {times:g} times what the corners are off", fontsize=10)
    _draw_rows(axes[1, 0], found.rows_px)
    _draw_pairs(axes[1, 1], views.names, found.rms_px, far)
    return figure


def _draw_errors(axes: Axes, views: BoardViews, corners: FloatArray, off_px: FloatArray) -> None:
    columns, rows = views.board.columns, views.board.rows
    outline = [0, columns - 1, columns * rows - 1, columns * (rows - 1)]
    for board in corners:
        axes.add_patch(Polygon(board[outline], closed=True, facecolor="#3a923a", alpha=0.10, edgecolor="none"))
    (x, y), (dx, dy) = corners.reshape(-1, 2).T, off_px.reshape(-1, 2).T
    axes.quiver(
        x, y, dx, dy, angles="xy", scale_units="xy", scale=1, color=BLUE, width=0.0016, headwidth=4, headlength=5
    )
    width, height = views.size_px
    axes.set(xlim=(0, width - 1), ylim=(height - 1, 0), aspect="equal", xlabel="column [px]", ylabel="row [px]")


def _draw_rows(axes: Axes, rows_px: FloatArray) -> None:
    off = np.abs(rows_px)
    reach = max(float(np.percentile(off, 99.5)), 0.05)
    axes.hist(np.clip(rows_px.ravel(), -reach, reach), bins=41, range=(-reach, reach), color=BLUE)
    axes.axvline(0, color="0.3", linewidth=0.8)
    axes.set(xlabel="row of a rectified corner, left - right [px]", ylabel="corners")
    axes.set_title(
        f"epipolar error: mean {off.mean():.3f} px, 95 % within {np.percentile(off, 95):.3f} px", fontsize=10
    )


def _draw_pairs(axes: Axes, names: Sequence[str], rms_px: FloatArray, far: Collection[str]) -> None:
    places = np.arange(len(names))
    axes.bar(places, rms_px, color=[ORANGE if name in far else BLUE for name in names])
    axes.axhline(float(np.median(rms_px)), color="0.3", linewidth=0.8, linestyle="--")
    axes.set_xticks(places, names, rotation=60, ha="right", fontsize=8 if len(names) <= 30 else 5)
    axes.set(ylabel="rms of the corners [px]")
    title = "error of each pair; dashed: the median"
    axes.set_title(f"{title}; orange: far worse than the others" if far else title, fontsize=10)


def rectified_figure(calibration: StereoCalibration, pair: tuple[Image, Image], corners: Both) -> Figure:
    """A raw pair (H, W), rectified, with lines along its rows; corners (N, 2) of both raw pictures [px] are marked."""
    left, right = calibration.rectification().rectify(*pair)
    width, height = calibration.size_px
    points = calibration.rectified_points(*corners)
    figure = NotebookFigure(figsize=(11, 11 * height / (2 * width) + 0.6), layout="constrained")
    axes = figure.subplots()
    axes.imshow(np.hstack([left, right]), cmap="gray", vmin=0, vmax=255)
    axes.hlines(np.linspace(0, height, LINES + 2)[1:-1], 0, 2 * width - 1, color=ORANGE, linewidth=0.6, alpha=0.8)
    for side, each in enumerate(points):
        axes.plot(each[:, 0] + side * width, each[:, 1], "+", color="#35d0e0", markersize=6, markeredgewidth=0.8)
    axes.axvline(width - 0.5, color="white", linewidth=2)
    axes.set(xticks=[], yticks=[], xlim=(0, 2 * width - 1), ylim=(height - 1, 0))
    axes.set_title("rectified: what a line crosses on the left, it crosses on the right", fontsize=10)
    return figure
