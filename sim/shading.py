"""Numba kernels of the renderer: the faces in view in, brightness and depth out. Arrays only.

Per face (rows of `planes`): at pixel (x, y) of a pinhole camera the inverse depth, and the in-plane coordinates
times the inverse depth, are affine in x and y. A row holds the nine coefficients: inverse depth (x, y, 1),
s / z (x, y, 1), t / z (x, y, 1), with s and t in metres along the face's texture axes.
"""

import math
from typing import NamedTuple

import numpy as np

from stereogrid.geometry import Array, FloatArray

from .kernel import inner, kernel

MAX_TAPS = 6
"""Most samples along the long side of a pixel's footprint; beyond a ratio of 9 the texture blurs."""

TAP_PITCH = 1.5
"""Distance of those samples in texels of their level: neighbours just overlap."""

RUN_PX = 4
"""Neighbours in a row that share one footprint: it hardly changes from pixel to pixel."""

POSITIVE = float(1 << 20)
"""Added to texel coordinates, so that cutting their fraction off rounds down; it shifts no texture that tiles."""

Pair = tuple[float, float]


class Surfaces(NamedTuple):
    """How the F faces look.

    tiles (F, 6): texture origin s, t [m]; tiles per metre along s, t; first and past-the-last level.
    sheets (F, 7), lights: see lighting.Sheets. levels, texels: see atlas.Atlas.
    """

    tiles: Array
    sheets: Array
    lights: Array
    levels: Array
    texels: Array


@kernel
def project_planes(normals: Array, offsets: Array, axes: Array, camera: Array) -> FloatArray:
    """Coefficients (F, 9) of F planes normals . p = offsets with texture axes (F, 2, 3), in a camera.

    camera: (4, 3): the eye, then the rows whose sum x * row + y * row + row is the ray of unit depth at (x, y).
    """
    planes = np.empty((len(normals), 9))
    for f in range(len(normals)):
        n, eye = normals[f], camera[0]
        distance = offsets[f] - (n[0] * eye[0] + n[1] * eye[1] + n[2] * eye[2])
        for c in range(3):
            ray = camera[1 + c]
            planes[f, c] = (n[0] * ray[0] + n[1] * ray[1] + n[2] * ray[2]) / distance
        for a in range(2):
            axis = axes[f, a]
            start = axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2]
            for c in range(3):
                ray = camera[1 + c]
                along = axis[0] * ray[0] + axis[1] * ray[1] + axis[2] * ray[2]
                planes[f, 3 + 3 * a + c] = along + start * planes[f, c]
    return planes


@inner
def _footprint(x: float, y: float, f: int, planes: Array, surfaces: Surfaces) -> tuple[int, float, int, float, float]:
    """How to read a texture at a pixel: level, share of the next one, taps, and the step between them [tiles]."""
    tiles, levels = surfaces.tiles, surfaces.levels
    first, last = int(tiles[f, 4]), int(tiles[f, 5]) - 1
    z = 1.0 / (planes[f, 0] * x + planes[f, 1] * y + planes[f, 2])
    s = (planes[f, 3] * x + planes[f, 4] * y + planes[f, 5]) * z
    t = (planes[f, 6] * x + planes[f, 7] * y + planes[f, 8]) * z
    columns, rows = levels[first, 1] * tiles[f, 2] * z, levels[first, 2] * tiles[f, 3] * z
    ax, ay = (planes[f, 3] - s * planes[f, 0]) * columns, (planes[f, 6] - t * planes[f, 0]) * rows
    bx, by = (planes[f, 4] - s * planes[f, 1]) * columns, (planes[f, 7] - t * planes[f, 1]) * rows
    a2, b2 = ax * ax + ay * ay, bx * bx + by * by
    step_x, step_y = (ax, ay) if a2 > b2 else (bx, by)
    long = math.sqrt(max(a2, b2)) + 1e-12
    short = max(abs(ax * by - ay * bx) / long, long / (MAX_TAPS * TAP_PITCH), 1.0)
    taps = min(max(1, math.ceil(long / (short * TAP_PITCH))), MAX_TAPS)
    detail = math.log2(short) + 0.15
    level = min(first + int(detail), last)
    # Blending only in the middle of the way between two levels spares a third of the reads.
    blend = min(max((detail - int(detail) - 0.3) / 0.7, 0.0), 1.0) if level < last else 0.0
    return level, blend, taps, step_x / (taps * levels[first, 1]), step_y / (taps * levels[first, 2])


@inner
def _tap_mean(surfaces: Surfaces, level: int, uv: Pair, step: Pair, taps: int) -> float:
    """Mean of bilinear samples about (u, v), all in tiles; the columns and rows of a level are powers of two."""
    levels, texels = surfaces.levels, surfaces.texels
    start, columns, rows = levels[level, 0], levels[level, 1], levels[level, 2]
    dx, dy = step[0] * columns, step[1] * rows
    x = uv[0] * columns - 0.5 - 0.5 * (taps - 1) * dx + POSITIVE
    y = uv[1] * rows - 0.5 - 0.5 * (taps - 1) * dy + POSITIVE
    total = 0.0
    for _ in range(taps):
        column, row = int(x), int(y)
        fx, fy = x - column, y - row
        x0, x1 = column & (columns - 1), (column + 1) & (columns - 1)
        row0, row1 = start + (row & (rows - 1)) * columns, start + ((row + 1) & (rows - 1)) * columns
        top = (1.0 - fx) * texels[row0 + x0] + fx * texels[row0 + x1]
        bottom = (1.0 - fx) * texels[row1 + x0] + fx * texels[row1 + x1]
        total += (1.0 - fy) * top + fy * bottom
        x += dx
        y += dy
    mean: float = total / taps
    return mean


@inner
def _light(surfaces: Surfaces, face: int, s: float, t: float) -> float:
    """Light at (s, t) [m] on a face; see lighting.Sheets."""
    sheets, lights = surfaces.sheets, surfaces.lights
    start, columns, rows = int(sheets[face, 0]), int(sheets[face, 1]), int(sheets[face, 2])
    x = min(max((s - sheets[face, 3]) * sheets[face, 5] - 0.5, 0.0), columns - 1.0)
    y = min(max((t - sheets[face, 4]) * sheets[face, 6] - 0.5, 0.0), rows - 1.0)
    x0, y0 = int(x), int(y)
    x1, y1 = min(x0 + 1, columns - 1), min(y0 + 1, rows - 1)
    fx, fy = x - x0, y - y0
    row0, row1 = start + y0 * columns, start + y1 * columns
    top = (1.0 - fx) * lights[row0 + x0] + fx * lights[row0 + x1]
    bottom = (1.0 - fx) * lights[row1 + x0] + fx * lights[row1 + x1]
    value: float = (1.0 - fy) * top + fy * bottom
    return value


@inner
def _shade_run(run: tuple[int, int, int], f: int, planes: Array, surfaces: Surfaces, out: tuple[Array, Array]) -> None:
    """Write the brightness, 0 to 255, and the depth [m] of face f to a run of pixels: row y, columns x to end."""
    y, x_first, x_end = run
    tiles = surfaces.tiles
    level, blend, taps, du, dv = _footprint(0.5 * (x_first + x_end - 1), y, f, planes, surfaces)
    for x in range(x_first, x_end):
        z = 1.0 / (planes[f, 0] * x + planes[f, 1] * y + planes[f, 2])
        s = (planes[f, 3] * x + planes[f, 4] * y + planes[f, 5]) * z
        t = (planes[f, 6] * x + planes[f, 7] * y + planes[f, 8]) * z
        uv = ((s - tiles[f, 0]) * tiles[f, 2], (t - tiles[f, 1]) * tiles[f, 3])
        value = _tap_mean(surfaces, level, uv, (du, dv), taps)
        if blend > 0.0:
            coarse = _tap_mean(surfaces, level + 1, uv, (du, dv), taps)
            value += blend * (coarse - value)
        out[0][y, x] = value * _light(surfaces, f, s, t)
        out[1][y, x] = z


@kernel
def shade(faces: Array, planes: Array, surfaces: Surfaces) -> tuple[Array, Array]:
    """Brightness (H, W) float32 and depth z (H, W) float32 [m]; 0 and NaN where no face was hit (faces < 0)."""
    height, width = faces.shape
    gray, depth = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    for y in range(height):
        x = 0
        while x < width:
            f, end = faces[y, x], x + 1
            while end < min(x + RUN_PX, width) and faces[y, end] == f:
                end += 1
            if f >= 0:
                _shade_run((y, x, end), f, planes, surfaces, (gray, depth))
            else:
                for i in range(x, end):
                    gray[y, i], depth[y, i] = 0.0, np.nan
            x = end
    return gray, depth


@kernel
def edge_pixels(faces: Array, gray: Array, contrast: float) -> Array:
    """(H, W) bool: pixels that differ from a neighbour in face, and in gray by more than `contrast`."""
    height, width = faces.shape
    edges = np.empty((height, width), np.bool_)
    for y in range(height):
        for x in range(width):
            found = False
            for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                i, j = min(max(y + dy, 0), height - 1), min(max(x + dx, 0), width - 1)
                if faces[i, j] != faces[y, x] and abs(gray[i, j] - gray[y, x]) > contrast:
                    found = True
            edges[y, x] = found
    return edges
