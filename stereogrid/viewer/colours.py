"""Colours that people with any colour vision tell apart, and their legends in words."""

from collections.abc import Sequence
from html import escape

import numpy as np
from matplotlib import colormaps

from ..geometry import Array, FloatArray
from ..thumbnails import UNKNOWN_RGB

DARKER = 0.82
"""Every other cell is drawn with this share of its brightness."""
RED = (214, 39, 40)
MEANINGS = ("truly occupied", "falsely occupied", "missed", "not judged: hidden from the cameras")
"""Of a cell beside the truth, by its class."""
MEANING_RGB = np.array([(86, 180, 233), (213, 94, 0), (30, 30, 30), (200, 200, 200)], np.uint8)
"""Sky blue, vermilion, black and grey: of Okabe and Ito's palette, and of different brightness."""


def palette(name: str) -> Array:
    """(256, 3) uint8 of a colour map of matplotlib."""
    colours: Array = (255 * colormaps[name](np.linspace(0, 1, 256))[:, :3]).astype(np.uint8)
    return colours


PALETTES = {"height": palette("viridis"), "probability": palette("cividis"), "age": palette("viridis")}


def ramp(values: FloatArray, ends: tuple[float, float], colours: Array) -> Array:
    """(..., 3) uint8 of values between two ends, by the 256 colours of a palette; beyond an end as there."""
    low, high = ends
    share = np.clip((values - low) / max(high - low, 1e-9), 0, 1)
    found: Array = colours[np.rint(255 * share).astype(np.int64)]
    return found


def shaded(colours: Array, cells: Array) -> Array:
    """Colours (N, 3) of cells (N, 3), alternating a little, so that one tells neighbours apart."""
    even = cells.sum(axis=1) % 2
    shade = np.where(even, 1.0, DARKER).astype(np.float32)[:, None]
    darker: Array = np.rint(shade * colours).astype(np.uint8)
    return darker


def slice_image(p: FloatArray) -> Array:
    """(U, V, 3) uint8 of probabilities (U, V): white free, black occupied, blue-grey unknown (NaN)."""
    grey = np.rint(255 * (1 - np.nan_to_num(p)))[..., None]
    picture: Array = np.where(np.isnan(p)[..., None], np.array(UNKNOWN_RGB), grey).astype(np.uint8)
    return picture


def bar_legend(title: str, colours: Array, ends: tuple[str, str]) -> str:
    """HTML of a bar of colours between two ends in words."""
    stops = ", ".join(_css(colours[n]) for n in range(0, 256, 51))
    bar = f'<div style="height:0.8em;border-radius:3px;background:linear-gradient(90deg,{stops})"></div>'
    low, high = map(escape, ends)
    ends_line = f'<div style="display:flex;justify-content:space-between"><span>{low}</span><span>{high}</span></div>'
    return _framed(f"<div>{escape(title)}</div>{bar}{ends_line}")


def named_legend(rows: Sequence[tuple[Sequence[int], str]]) -> str:
    """HTML of squares of colour (rgb) with words."""
    square = "display:inline-block;width:0.8em;height:0.8em;margin-right:0.5em;border:1px solid #888"
    lines = (
        f'<div><span style="{square};background:{_css(colour)}"></span>{escape(words)}</div>' for colour, words in rows
    )
    return _framed("".join(lines))


def _framed(html: str) -> str:
    return f'<div style="font-size:0.8em;padding:0 0.75em 0.4em;line-height:1.35">{html}</div>'


def _css(colour: Sequence[int] | Array) -> str:
    return f"rgb({int(colour[0])},{int(colour[1])},{int(colour[2])})"
