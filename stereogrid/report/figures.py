"""Figures of a report: a picture with a caption, or a map to turn where the browser can, and its picture elsewhere."""

import base64
import html
from dataclasses import dataclass
from pathlib import Path

from ..figures.colours import PATH_COLOUR, TRUTH_COLOUR
from ..figures.save import DOTS_PER_INCH
from .view3d import PALETTE, Scene3D

HOW_TO_TURN = (
    "Drag to turn; shift and drag, or two fingers, to move; wheel or pinch to come nearer; arrows, + and - on the "
    "keyboard."
)
CSS_DOTS_PER_INCH = 96


@dataclass(frozen=True)
class ReportFigure:
    """A picture (PNG file in the run folder) and what it shows; scene: what can be turned in its place in a browser."""

    path: Path
    caption: str
    scene: Scene3D | None = None


def figure_html(figure: ReportFigure) -> str:
    """The figure with its picture inside."""
    png = figure.path.read_bytes()
    caption = html.escape(figure.caption)
    source = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    image = f'<img alt="{caption}" width="{_shown_px(png)}" src="{source}">'
    if figure.scene is None:
        return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
    turned = (
        "The map's occupied cells, coloured by height; the camera and its way in vermilion. "
        f"{html.escape(figure.scene.note)} {HOW_TO_TURN}"
    )
    words = f'<span class="for-still">{caption}</span><span class="for-live">{turned}</span>'
    return f'<figure class="view3d">{image}{_scene_html(figure.scene)}<figcaption>{words}</figcaption></figure>'


def _shown_px(png: bytes) -> int:
    """How wide a picture is shown where there is room: as large as it was drawn, for letters of one size in all."""
    width_px = int.from_bytes(png[16:20], "big")
    return max(1, round(width_px * CSS_DOTS_PER_INCH / DOTS_PER_INCH))


def _scene_html(scene: Scene3D) -> str:
    low, high = (f"{round(each_m, 1) + 0.0:.1f} m" for each_m in scene.heights_m)  # never -0.0
    shades = ", ".join(f"rgb({', '.join(str(round(255 * part)) for part in shade)})" for shade in PALETTE)
    lines = [(PATH_COLOUR, "claimed path"), *([(TRUTH_COLOUR, "true path")] if scene.has_truth else [])]
    keys = "".join(f'<b style="background: {colour}"></b>{name}' for colour, name in lines)
    return (
        '<div class="scene"><canvas tabindex="0" role="img" aria-label="The map in three dimensions"></canvas>'
        f'<button type="button">first view</button><div class="key">z {low}'
        f'<i style="background: linear-gradient(90deg, {shades})"></i>{high} {keys}</div>'
        f'<script type="application/json">{scene.json}</script></div>'
    )
