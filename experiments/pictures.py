"""The README's picture, made anew from a run: `python -m experiments pictures runs/latest`."""

import io
from pathlib import Path

import matplotlib.image
import numpy as np
from matplotlib.figure import Figure

from stereogrid.errors import RecordingError
from stereogrid.figures import save_figure
from stereogrid.geometry import Array
from stereogrid.observation import Recording
from stereogrid.recording import Subset, open_recording

PICTURE_DPI = 110
"""Keeps the picture below 300 kB."""


def corridor_picture(run: Path, out: Path) -> Path:
    """The corridor as the left camera sees it, beside the cubes of its map."""
    drive = open_recording(run / "drive.mcap")
    return _side_by_side([("What the left camera sees", _quarter_way(drive)), ("The map", _picture(run))], out)


def _quarter_way(recording: Recording) -> Array:
    start = len(recording) // 4
    return next(iter(Subset(recording, start, start + 1))).left


def _picture(run: Path) -> Array:
    try:
        return np.asarray(matplotlib.image.imread(io.BytesIO((run / "cubes.png").read_bytes()), format="png"))
    except OSError as error:
        raise RecordingError(f"{run / 'cubes.png'}: cannot be read ({error.strerror})") from None


def _side_by_side(panels: list[tuple[str, Array]], out: Path) -> Path:
    shapes = [image.shape[1] / image.shape[0] for _, image in panels]
    figure = Figure(figsize=(9, 9 / sum(shapes) + 0.35), layout="constrained")
    for axes, (title, image) in zip(figure.subplots(1, len(panels), width_ratios=shapes), panels, strict=True):
        axes.imshow(image, cmap="gray", vmin=0, vmax=255 if image.ndim == 2 else None)
        axes.set_title(title, fontsize=10)
        axes.set_axis_off()
    return save_figure(figure, out, dots_per_inch=PICTURE_DPI)
