"""What a notebook shows of an object: its repr and a small picture, as HTML."""

import base64
import html

import cv2
import numpy as np

from .geometry import Array, FloatArray

LARGEST_PX = 480
NO_MATCH = (255, 255, 255)
UNKNOWN_RGB = (201, 211, 227)
"""Of cells that nobody knows, wherever free ones are white and occupied ones black."""
GAP_PX = 4


def shown(words: str, picture: Array | None = None, caption: str = "") -> str:
    """HTML of words, with a picture (H, W) or (H, W, 3) BGR uint8 and its caption below."""
    text = f"<pre>{html.escape(words)}</pre>"
    if picture is None:
        return text
    _, png = cv2.imencode(".png", _resized(picture))
    data = base64.b64encode(png.tobytes()).decode()
    return f'{text}<img alt="{html.escape(caption)}" src="data:image/png;base64,{data}"><br>{html.escape(caption)}'


def pair_picture(left: Array, right: Array) -> Array:
    """Two pictures (H, W) side by side."""
    gap = np.full((left.shape[0], GAP_PX), 255, np.uint8)
    beside: Array = np.hstack([left, gap, right])
    return beside


def disparity_picture(disparity_px: Array) -> Array:
    """(H, W, 3) BGR: near is yellow, far is dark blue, no match is white; the scale ends at the 99th percentile."""
    valid = ~np.isnan(disparity_px)
    largest = float(np.percentile(disparity_px[valid], 99)) if valid.any() else 1.0
    share = np.clip(np.where(valid, disparity_px, 0) / largest, 0, 1)
    picture: Array = cv2.applyColorMap(np.rint(255 * share).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    picture[~valid] = NO_MATCH
    return picture


def layer_picture(cells: Array, probability: FloatArray) -> Array:
    """(Y, X, 3) BGR of cells by their indices i, j (N, 2) and p(occupied) (N,), x to the right and y upwards.

    White is free, black is occupied, blue-grey is unknown. Layers that are larger than a thumbnail are drawn coarsely:
    a pixel shows the most occupied of its cells.
    """
    low = cells.min(axis=0)
    stride = int(np.ceil((np.ptp(cells, axis=0).max() + 1) / LARGEST_PX))
    column, row = ((cells - low) // stride).T
    p = np.full((row.max() + 1, column.max() + 1), -1.0)
    np.maximum.at(p, (row, column), probability)
    picture = np.repeat(np.rint(255 * (1 - p)).clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)
    picture[p < 0] = UNKNOWN_RGB[::-1]
    return np.ascontiguousarray(picture[::-1])


def _resized(picture: Array) -> Array:
    """So large that it can be seen, so small that it does not fill the page; what is enlarged keeps its squares."""
    longest = max(picture.shape[:2])
    if longest > LARGEST_PX:
        return _scaled(picture, LARGEST_PX / longest, cv2.INTER_AREA)
    return _scaled(picture, max(1, LARGEST_PX // longest), cv2.INTER_NEAREST)


def _scaled(picture: Array, factor: float, how: int) -> Array:
    scaled: Array = cv2.resize(picture, None, fx=factor, fy=factor, interpolation=how)
    return scaled
