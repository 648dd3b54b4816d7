"""Numba kernels of the renderer: visibility and light baking in, brightness and depth out. Arrays only.

Per face (rows of `planes`): at pixel (x, y) of a pinhole camera the inverse depth, and the in-plane coordinates
times the inverse depth, are affine in x and y. A row holds the nine coefficients: inverse depth (x, y, 1),
s / z (x, y, 1), t / z (x, y, 1), with s and t in metres along the face's texture axes.
"""

import math

import numpy as np
from numba import njit

from stereogrid.geometry import Array, FloatArray

MAX_TAPS = 6
"""Most samples along the long side of a pixel's footprint; beyond a ratio of 9 the texture blurs."""

TAP_PITCH = 1.5
"""Distance of those samples in texels of their level: neighbours just overlap."""

_kernel = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "arcp", "nsz"})
_inner = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "arcp", "nsz"}, inline="always")


@_kernel
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


@_inner
def _bilinear(texels: Array, levels: Array, level: int, u: float, v: float) -> float:
    """One level of a texture that tiles, at (u, v) in tiles; its columns and rows are powers of two."""
    start, columns, rows = levels[level, 0], levels[level, 1], levels[level, 2]
    x, y = u * columns - 0.5, v * rows - 0.5
    x_low, y_low = math.floor(x), math.floor(y)
    fx, fy = x - x_low, y - y_low
    x0, y0 = int(x_low) & (columns - 1), int(y_low) & (rows - 1)
    x1, y1 = (x0 + 1) & (columns - 1), (y0 + 1) & (rows - 1)
    row0, row1 = start + y0 * columns, start + y1 * columns
    top = (1.0 - fx) * texels[row0 + x0] + fx * texels[row0 + x1]
    bottom = (1.0 - fx) * texels[row1 + x0] + fx * texels[row1 + x1]
    value: float = (1.0 - fy) * top + fy * bottom
    return value


@_inner
def _filtered(
    texels: Array,
    levels: Array,
    first: int,
    last: int,
    u: float,
    v: float,
    du_dx: float,
    dv_dx: float,
    du_dy: float,
    dv_dy: float,
) -> float:
    """The texture's mean over a pixel's footprint: trilinear samples along its long side."""
    columns, rows = levels[first, 1], levels[first, 2]
    ax, ay, bx, by = du_dx * columns, dv_dx * rows, du_dy * columns, dv_dy * rows
    a2, b2 = ax * ax + ay * ay, bx * bx + by * by
    step_u, step_v, long2 = (du_dx, dv_dx, a2) if a2 > b2 else (du_dy, dv_dy, b2)
    long = math.sqrt(long2) + 1e-12
    short = max(abs(ax * by - ay * bx) / long, long / (MAX_TAPS * TAP_PITCH), 1.0)
    taps = max(1, math.ceil(long / (short * TAP_PITCH)))
    detail = math.log2(short)
    low = min(first + int(detail + 0.15), last)
    # Blending only in the middle of the way between two levels spares a third of the reads.
    blend = min(max((detail + 0.15 - int(detail + 0.15) - 0.3) / 0.7, 0.0), 1.0)
    total = 0.0
    for k in range(taps):
        shift = (k + 0.5) / taps - 0.5
        at_u, at_v = u + shift * step_u, v + shift * step_v
        value = _bilinear(texels, levels, low, at_u, at_v)
        if blend > 0.0 and low < last:
            value += blend * (_bilinear(texels, levels, low + 1, at_u, at_v) - value)
        total += value
    mean: float = total / taps
    return mean


@_inner
def _light(lights: Array, sheets: Array, face: int, s: float, t: float) -> float:
    """Light at (s, t) [m] on a face; a sheet is start, columns, rows, s0, t0 [m], texels per metre along s, t."""
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


@_inner
def _brightness(
    x: float,
    y: float,
    f: int,
    planes: Array,
    tiles: Array,
    sheets: Array,
    levels: Array,
    texels: Array,
    lights: Array,
) -> tuple[float, float]:
    """The brightness, 0 to 255, of face f at one pixel, and its depth [m]."""
    per_depth = planes[f, 0] * x + planes[f, 1] * y + planes[f, 2]
    z = 1.0 / per_depth
    s = (planes[f, 3] * x + planes[f, 4] * y + planes[f, 5]) * z
    t = (planes[f, 6] * x + planes[f, 7] * y + planes[f, 8]) * z
    across, down = tiles[f, 2], tiles[f, 3]
    value = _filtered(
        texels,
        levels,
        int(tiles[f, 4]),
        int(tiles[f, 5]) - 1,
        (s - tiles[f, 0]) * across,
        (t - tiles[f, 1]) * down,
        (planes[f, 3] - s * planes[f, 0]) * z * across,
        (planes[f, 6] - t * planes[f, 0]) * z * down,
        (planes[f, 4] - s * planes[f, 1]) * z * across,
        (planes[f, 7] - t * planes[f, 1]) * z * down,
    )
    return value * _light(lights, sheets, f, s, t), z


@_kernel
def shade(
    faces: Array, planes: Array, tiles: Array, sheets: Array, levels: Array, texels: Array, lights: Array
) -> tuple[Array, Array]:
    """Brightness (H, W) float32 and depth z (H, W) float32 [m]; 0 and NaN where no face was hit (faces < 0)."""
    height, width = faces.shape
    gray, depth = np.zeros((height, width), np.float32), np.full((height, width), np.nan, np.float32)
    for y in range(height):
        for x in range(width):
            f = faces[y, x]
            if f >= 0:
                gray[y, x], depth[y, x] = _brightness(x, y, f, planes, tiles, sheets, levels, texels, lights)
    return gray, depth


@_kernel
def faces_of(triangles: Array, face_of_triangle: Array) -> Array:
    """The face (N,) int32 of each triangle (N,), -1 for -1."""
    faces = np.empty(len(triangles), np.int32)
    for n in range(len(triangles)):
        faces[n] = face_of_triangle[triangles[n]] if triangles[n] >= 0 else -1
    return faces


@_kernel
def edge_pixels(faces: Array, gray: Array, contrast: float) -> Array:
    """(N, 2) int32 columns and rows of pixels that differ from a neighbour in face, and in gray by `contrast`."""
    height, width = faces.shape
    pixels = np.empty((height * width, 2), np.int32)
    n = 0
    for y in range(height):
        for x in range(width):
            found = False
            for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                i, j = min(max(y + dy, 0), height - 1), min(max(x + dx, 0), width - 1)
                if faces[i, j] != faces[y, x] and abs(gray[i, j] - gray[y, x]) > contrast:
                    found = True
            if found:
                pixels[n, 0], pixels[n, 1] = x, y
                n += 1
    return pixels[:n].copy()


@_kernel
def soften(
    gray: Array,
    pixels: Array,
    subpixels: Array,
    faces: Array,
    planes: Array,
    tiles: Array,
    sheets: Array,
    levels: Array,
    texels: Array,
    lights: Array,
) -> None:
    """Set the brightness of edge pixels (N, 2) to the mean over rays at offsets subpixels (M, 2), faces (N, M)."""
    for n in range(len(pixels)):
        total = 0.0
        for m in range(len(subpixels)):
            f = faces[n, m]
            if f >= 0:
                x, y = pixels[n, 0] + subpixels[m, 0], pixels[n, 1] + subpixels[m, 1]
                total += _brightness(x, y, f, planes, tiles, sheets, levels, texels, lights)[0]
        gray[pixels[n, 1], pixels[n, 0]] = total / len(subpixels)


@_kernel
def subpixel_rays(camera: Array, pixels: Array, subpixels: Array) -> Array:
    """Directions (N * M, 3) float32 in the world of the rays at offsets subpixels (M, 2) from pixels (N, 2)."""
    rays = np.empty((len(pixels) * len(subpixels), 3), np.float32)
    for n in range(len(pixels)):
        for m in range(len(subpixels)):
            x, y = pixels[n, 0] + subpixels[m, 0], pixels[n, 1] + subpixels[m, 1]
            for a in range(3):
                rays[n * len(subpixels) + m, a] = camera[1, a] * x + camera[2, a] * y + camera[3, a]
    return rays


@_kernel
def pixel_rays(camera: Array, width: int, height: int) -> Array:
    """Directions (H * W, 3) float32 in the world of the rays through the pixel centres, row after row."""
    rays = np.empty((height * width, 3), np.float32)
    for y in range(height):
        for x in range(width):
            for a in range(3):
                rays[y * width + x, a] = camera[1, a] * x + camera[2, a] * y + camera[3, a]
    return rays
