"""Textures of what grows: lawn, bark, leaves and the inside of bushes; square-root reflectance, and they tile."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from stereogrid.observation import Image

from ..scene.textures import Painter, Texture, noise, to_image

Points = NDArray[np.float64]

RIM_PX = 8
"""Strokes are drawn on a larger canvas: at its very edge OpenCV leaves them out."""


def grass(rng: np.random.Generator) -> Texture:
    """A mown lawn seen from above: blades over dark soil, straw, clover and worn spots; 2 mm a texel."""
    n = 2048
    canvas = np.full((n + 2 * RIM_PX, n + 2 * RIM_PX), 66, np.uint8)
    for layer in np.linspace(0.0, 1.0, 9):
        blades = _strokes(rng, n, count=13000, length_px=(5, 15))
        _draw(canvas, rng, blades, brightness=(88 + 56 * layer, 15), thickness=2 if layer < 0.5 else 1)
    _draw(canvas, rng, _strokes(rng, n, count=5000, length_px=(4, 12)), brightness=(178, 18), thickness=1)
    canvas = canvas[RIM_PX:-RIM_PX, RIM_PX:-RIM_PX].copy()
    for x, y in rng.uniform(20, n - 20, (420, 2)):
        _clover(canvas, (int(x), int(y)), float(rng.uniform(100, 140)))
    patches = noise(rng, (n // 8, n // 8), power=1.3, finest_px=4)
    patches = np.tile(patches, (3, 3))[n // 8 - 2 : n // 4 + 2, n // 8 - 2 : n // 4 + 2]
    patches = cv2.resize(patches, (n + 32, n + 32), interpolation=cv2.INTER_LINEAR)[16:-16, 16:-16]
    image = canvas.astype(np.float32) / 255 * (1 + 0.07 * patches)
    return Texture(to_image(image), (4.0, 4.0))


def bark(rng: np.random.Generator) -> Texture:
    """Furrowed bark, upright."""
    field = noise(rng, (128, 256), power=0.9, finest_px=2.5)
    field = cv2.resize(field, (256, 512), interpolation=cv2.INTER_LINEAR)
    furrows = np.abs(field)
    image = 0.2 + 0.2 * np.clip(furrows, 0, 1.4) + 0.035 * noise(rng, (512, 256), power=0.4, finest_px=2)
    return Texture(to_image(image.astype(np.float32)), (0.6, 1.2))


def birch(rng: np.random.Generator) -> Texture:
    """White bark with dark lenticels and scars."""
    image = 0.74 + 0.035 * noise(rng, (512, 256), power=0.9, finest_px=3)
    image = image.astype(np.float32)
    for x, y, w, h in zip(*rng.uniform((0, 0, 4, 1), (256, 512, 34, 4), (130, 4)).T, strict=True):
        cv2.ellipse(image, ((float(x), float(y)), (float(w), float(h)), float(rng.normal(0, 4))), 0.3, -1, cv2.LINE_AA)
    for x, y in rng.uniform(0, (256, 512), (6, 2)):
        cv2.ellipse(image, ((float(x), float(y)), (40.0, 16.0), float(rng.normal(0, 25))), 0.2, -1, cv2.LINE_AA)
    return Texture(to_image(image), (0.6, 1.2))


def foliage(rng: np.random.Generator) -> Texture:
    """The inside of a bush or a crown: leaves one behind the other, darker inwards."""
    n = 1024
    canvas = np.full((n, n), 26, np.uint8)
    for layer in np.linspace(0.0, 1.0, 6):
        for x, y in rng.uniform(0, n, (1000, 2)):
            shade = float(np.clip(38 + 76 * layer + rng.normal(0, 14), 14, 170))
            _leaflet(
                canvas, (float(x), float(y)), (34.0, float(rng.uniform(10, 17)), float(rng.uniform(0, 180))), shade
            )
    return Texture(canvas, (1.8, 1.8))


def leaf_of(brightness: float) -> Painter:
    """A painter of one leaf with its veins, tip up."""

    def painter(rng: np.random.Generator) -> Texture:
        image = brightness + 0.04 * noise(rng, (64, 32), power=0.9, finest_px=2)
        image = image.astype(np.float32)
        cv2.line(image, (16, 64), (16, 4), brightness + 0.14, 2, cv2.LINE_AA)
        for y in range(10, 60, 9):
            for x in (0, 32):
                cv2.line(image, (16, y + 8), (x, y - 3), brightness + 0.07, 1, cv2.LINE_AA)
        return Texture(to_image(image), (0.05, 0.09))

    return painter


def _strokes(rng: np.random.Generator, n: int, *, count: int, length_px: tuple[float, float]) -> Points:
    """(K, 2, 2) ends of random strokes on an n x n tile, those over its edge repeated on the other side."""
    start = rng.uniform(0, n, (count, 2))
    angle, length = rng.uniform(0, 2 * np.pi, count), rng.uniform(*length_px, count)
    ends = np.stack([start, start + length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)], axis=1)
    shifts = n * np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(1, 9, 1, 2)
    copies: Points = (ends[:, None] + shifts).reshape(-1, 2, 2)
    middle = copies.mean(axis=1)
    return copies[np.all((middle > -RIM_PX) & (middle < n + RIM_PX), axis=1)]


def _draw(
    canvas: Image, rng: np.random.Generator, strokes: Points, *, brightness: tuple[float, float], thickness: int
) -> None:
    """Draw strokes in twelve shades; neighbours in the list share one, so that a wrapped stroke keeps its own."""
    fixed = np.round((strokes + RIM_PX) * 16).astype(np.int32)
    for part in np.array_split(fixed, 12):
        shade = float(np.clip(rng.normal(*brightness), 5, 250))
        cv2.polylines(canvas, list(part), False, shade, thickness, cv2.LINE_AA, shift=4)


def _clover(canvas: Image, center: tuple[int, int], shade: float) -> None:
    for k in range(3):
        angle = 2.1 * k + shade
        x, y = center[0] + 7 * np.cos(angle), center[1] + 7 * np.sin(angle)
        cv2.circle(canvas, (int(x), int(y)), 5, shade, -1, cv2.LINE_AA)


def _leaflet(canvas: Image, center: tuple[float, float], shape: tuple[float, float, float], shade: float) -> None:
    """One leaf (length, width [px], angle [degrees]) and its copies across the tile's edges."""
    n = len(canvas)
    for x, y in _copies(center, n, shape[0]):
        cv2.ellipse(canvas, ((x, y), (shape[0], shape[1]), shape[2]), shade, -1, cv2.LINE_AA)
        angle = np.deg2rad(shape[2])
        dx, dy = 0.45 * shape[0] * np.cos(angle), 0.45 * shape[0] * np.sin(angle)
        cv2.line(canvas, (int(x - dx), int(y - dy)), (int(x + dx), int(y + dy)), shade * 1.25, 1, cv2.LINE_AA)


def _copies(center: tuple[float, float], n: int, reach: float) -> Iterator[tuple[float, float]]:
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            x, y = center[0] + i * n, center[1] + j * n
            if -reach < x < n + reach and -reach < y < n + reach:
                yield x, y
