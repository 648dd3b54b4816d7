"""Numba kernels of the renderer: the faces in view in, brightness and depth out. Arrays only.

Per face (rows of `planes`): at pixel (x, y) of a pinhole camera the inverse depth, and the texture coordinates
times the inverse depth, are affine in x and y. A row holds the nine coefficients: inverse depth (x, y, 1),
s / z (x, y, 1), t / z (x, y, 1), with s and t in metres along the face's texture axes.

What kernels call or read stands in this file: Numba's cache does not see another one change.
"""

import math
from typing import NamedTuple

import numpy as np

from stereogrid.geometry import Array

from ..kernel import inner, kernel
from .shapes import Shapes

MAX_TAPS = 6
"""Most samples along the long side of a pixel's footprint; beyond a ratio of 9 the texture blurs."""

TAP_PITCH = 1.5
"""Distance of those samples in texels of their level: neighbours just overlap."""

POSITIVE = float(1 << 20)
"""Added to texel coordinates, so that cutting their fraction off rounds down; it shifts no texture that tiles."""

RUN_PX = 4
"""Neighbours in a row that share one footprint: it hardly changes from pixel to pixel."""

ROUND = 0.15
"""How much the layer of clouds bends down to the horizon: without it their texture would be squeezed to nothing."""
HAZE = 0.05
"""Sine of the elevation at which clouds are half as clear as overhead."""
WHITE = 250.0
GLOW = 0.6
"""Beyond this from the sun (1 - cosine) nothing is left of its glow."""

Pair = tuple[float, float]
Vector = tuple[float, float, float]

Slopes = tuple[float, float, float, float]
"""How s and t [m] change by a pixel: s by x, t by x, s by y, t by y."""

LightReading = tuple[int, int, int, float, int, float, float]


class Surfaces(NamedTuple):
    """How the F faces look.

    tiles (F, 6): texture origin s, t [m]; tiles per metre along s, t; first and past-the-last level.
    sheets (F, 8), lights: see lighting.Sheets. levels, texels: see atlas.Atlas. sky: see sky.sky_numbers.
    """

    tiles: Array
    sheets: Array
    lights: Array
    levels: Array
    texels: Array
    sky: Array


class Rays(NamedTuple):
    """N rays: apex, direction, and its change from pixel to pixel, to the right and down; all (N, 3) float64."""

    apex: Array
    direction: Array
    across: Array
    down: Array


@inner
def ellipse(ax: float, ay: float, bx: float, by: float) -> tuple[float, int, float, float]:
    """A pixel's footprint, given how far one pixel to the right (ax, ay) and down (bx, by) are [texels].

    Returns its short side, at least 1, the number of taps, and the step between them.
    """
    a2, b2 = ax * ax + ay * ay, bx * bx + by * by
    step_x, step_y = (ax, ay) if a2 > b2 else (bx, by)
    long = math.sqrt(max(a2, b2)) + 1e-12
    short = max(abs(ax * by - ay * bx) / long, long / (MAX_TAPS * TAP_PITCH), 1.0)
    taps = min(max(1, math.ceil(long / (short * TAP_PITCH))), MAX_TAPS)
    return short, taps, step_x / taps, step_y / taps


@inner
def tap_mean(levels: Array, texels: Array, level: int, uv: Pair, step: Pair, taps: int) -> float:
    """Mean of bilinear samples about (u, v), all in tiles; the columns and rows of a level are powers of two."""
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
def texture_reading(f: int, slopes: Slopes, surfaces: Surfaces) -> tuple[int, float, int, float, float]:
    """How to read a texture at a pixel: level, share of the next one, taps, and the step between them [tiles]."""
    tiles, levels = surfaces.tiles, surfaces.levels
    first, last = int(tiles[f, 4]), int(tiles[f, 5]) - 1
    columns, rows = levels[first, 1] * tiles[f, 2], levels[first, 2] * tiles[f, 3]
    short, taps, step_x, step_y = ellipse(slopes[0] * columns, slopes[1] * rows, slopes[2] * columns, slopes[3] * rows)
    detail = math.log2(short) + 0.15
    level = min(first + int(detail), last)
    # Blending only in the middle of the way between two levels spares a third of the reads.
    blend = min(max((detail - int(detail) - 0.3) / 0.7, 0.0), 1.0) if level < last else 0.0
    return level, blend, taps, step_x / levels[first, 1], step_y / levels[first, 2]


@inner
def light_reading(f: int, slopes: Slopes, surfaces: Surfaces) -> LightReading:
    """How to read a light sheet at a pixel: start, columns, rows and scale of a level, taps, the step between [m]."""
    sheets = surfaces.sheets
    start, columns, rows = int(sheets[f, 0]), int(sheets[f, 1]), int(sheets[f, 2])
    if sheets[f, 7] < 2:
        return start, columns, rows, 1.0, 1, 0.0, 0.0
    a, b = sheets[f, 5], sheets[f, 6]
    short, taps, step_s, step_t = ellipse(slopes[0] * a, slopes[1] * b, slopes[2] * a, slopes[3] * b)
    scale = 1.0
    for _ in range(min(int(math.log2(short) + 0.5), int(sheets[f, 7]) - 1)):
        start += columns * rows
        columns, rows, scale = columns >> 1, rows >> 1, 0.5 * scale
    return start, columns, rows, scale, taps, step_s / a, step_t / b


@inner
def _light(surfaces: Surfaces, f: int, st: Pair, reading: LightReading) -> float:
    """Light at one point (s, t) [m] of a face; see lighting.Sheets."""
    sheets, lights = surfaces.sheets, surfaces.lights
    start, columns, rows, scale = reading[0], reading[1], reading[2], reading[3]
    x = min(max((st[0] - sheets[f, 3]) * sheets[f, 5] * scale - 0.5, 0.0), columns - 1.0)
    y = min(max((st[1] - sheets[f, 4]) * sheets[f, 6] * scale - 0.5, 0.0), rows - 1.0)
    x0, y0 = int(x), int(y)
    x1, y1 = min(x0 + 1, columns - 1), min(y0 + 1, rows - 1)
    fx, fy = x - x0, y - y0
    row0, row1 = start + y0 * columns, start + y1 * columns
    top = (1.0 - fx) * lights[row0 + x0] + fx * lights[row0 + x1]
    bottom = (1.0 - fx) * lights[row1 + x0] + fx * lights[row1 + x1]
    value: float = (1.0 - fy) * top + fy * bottom
    return value


@inner
def light_mean(surfaces: Surfaces, f: int, st: Pair, reading: LightReading) -> float:
    """Mean light about (s, t) [m] on a face."""
    taps, step_s, step_t = reading[4], reading[5], reading[6]
    s, t = st[0] - 0.5 * (taps - 1) * step_s, st[1] - 0.5 * (taps - 1) * step_t
    total = 0.0
    for _ in range(taps):
        total += _light(surfaces, f, (s, t), reading)
        s += step_s
        t += step_t
    mean: float = total / taps
    return mean


@inner
def surface_brightness(
    surfaces: Surfaces,
    f: int,
    st: Pair,
    look: tuple[int, float, int, float, float],
    glow: LightReading,
) -> float:
    """Brightness, 0 to 255, of face f at (s, t) [m], read as texture_reading and light_reading say."""
    tiles = surfaces.tiles
    level, blend, taps, du, dv = look
    uv = ((st[0] - tiles[f, 0]) * tiles[f, 2], (st[1] - tiles[f, 1]) * tiles[f, 3])
    value = tap_mean(surfaces.levels, surfaces.texels, level, uv, (du, dv), taps)
    if blend > 0.0:
        coarse = tap_mean(surfaces.levels, surfaces.texels, level + 1, uv, (du, dv), taps)
        value += blend * (coarse - value)
    brightness: float = value * light_mean(surfaces, f, st, glow)
    return brightness


@inner
def _layer(sky: Array, d: Vector) -> tuple[float, float, float]:
    """Where a direction meets the clouds (u, v) [tiles], and the sine of its elevation, at least 0."""
    norm = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    up = max(d[2] / norm, 0.0)
    scale = 1.0 / (norm * (up + ROUND))
    return d[0] * scale * sky[9], d[1] * scale * sky[10], up


@kernel
def sky_brightness(sky: Array, atlas: tuple[Array, Array], d: Vector, a: Vector, b: Vector) -> float:
    """Brightness, 0 to 255, in direction d (any length), which changes by a and b from pixel to pixel.

    sky: see sky_numbers. atlas: levels and texels, see atlas.Atlas.
    """
    levels, texels = atlas
    if sky[0] == 0.0:
        return 0.0
    u, v, up = _layer(sky, d)
    value: float = sky[1] + (sky[2] - sky[1]) * up * (2.0 - up)
    first, past = int(sky[7]), int(sky[8])
    if past > first:
        ua, va, _ = _layer(sky, (d[0] + a[0], d[1] + a[1], d[2] + a[2]))
        ub, vb, _ = _layer(sky, (d[0] + b[0], d[1] + b[1], d[2] + b[2]))
        columns, rows = levels[first, 1], levels[first, 2]
        short, taps, du, dv = ellipse((ua - u) * columns, (va - v) * rows, (ub - u) * columns, (vb - v) * rows)
        level = min(first + int(math.log2(short) + 0.5), past - 1)
        cloud = tap_mean(levels, texels, level, (u, v), (du / columns, dv / rows), taps) / 255.0
        value += cloud * up / (up + HAZE) * (WHITE - value)
    if sky[6] > 0.0:
        norm = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        away = 1.0 - (d[0] * sky[3] + d[1] * sky[4] + d[2] * sky[5]) / norm
        if away < GLOW:
            value += 60.0 * math.exp(-12.0 * away) + 120.0 * math.exp(-300.0 * away)
    return value


@inner
def _shade_run(
    run: tuple[int, int, int], f: int, plane: Array, surfaces: Surfaces, out: tuple[Array, Array, Pair]
) -> None:
    """Write the brightness, 0 to 255, and the depth [m] of face f to a run of pixels: row y, columns x to end."""
    gray, depth, shift = out
    y = run[0] + shift[1]
    x = 0.5 * (run[1] + run[2] - 1) + shift[0]
    z = 1.0 / (plane[0] * x + plane[1] * y + plane[2])
    s = (plane[3] * x + plane[4] * y + plane[5]) * z
    t = (plane[6] * x + plane[7] * y + plane[8]) * z
    ax, ay = (plane[3] - s * plane[0]) * z, (plane[6] - t * plane[0]) * z
    bx, by = (plane[4] - s * plane[1]) * z, (plane[7] - t * plane[1]) * z
    look = texture_reading(f, (ax, ay, bx, by), surfaces)
    glow = light_reading(f, (ax, ay, bx, by), surfaces)
    for column in range(run[1], run[2]):
        x = column + shift[0]
        z = 1.0 / (plane[0] * x + plane[1] * y + plane[2])
        s = (plane[3] * x + plane[4] * y + plane[5]) * z
        t = (plane[6] * x + plane[7] * y + plane[8]) * z
        gray[run[0], column] = surface_brightness(surfaces, f, (s, t), look, glow)
        depth[run[0], column] = z


@inner
def _sky_run(run: tuple[int, int, int], rays: Array, surfaces: Surfaces, out: tuple[Array, Array, Pair]) -> None:
    """Write the brightness of the sky, and no depth, to a run of pixels."""
    gray, depth, shift = out
    a, b, c = rays[1], rays[2], rays[3]
    y = run[0] + shift[1]
    for column in range(run[1], run[2]):
        x = column + shift[0]
        d = (a[0] * x + b[0] * y + c[0], a[1] * x + b[1] * y + c[1], a[2] * x + b[2] * y + c[2])
        atlas = (surfaces.levels, surfaces.texels)
        gray[run[0], column] = sky_brightness(surfaces.sky, atlas, d, (a[0], a[1], a[2]), (b[0], b[1], b[2]))
        depth[run[0], column] = np.nan


@kernel
def shade(
    seen: Array, outlines: tuple[Array, Array], surfaces: Surfaces, rays: Array, shift: Pair
) -> tuple[Array, Array]:
    """Brightness (H, W) float32 and depth z (H, W) float32 [m]; the sky's and NaN where no face was hit.

    seen (H, W): indices into the outlined faces (S,) and their planes (S, 9), or -1.
    rays (4, 3): the eye, then the rows whose sum x * row + y * row + row is the ray of unit depth at pixel (x, y).
    shift: how far beside the pixels' centres is looked [px].
    """
    height, width = seen.shape
    faces, planes = outlines
    gray, depth = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    for y in range(height):
        x = 0
        while x < width:
            k, end = seen[y, x], x + 1
            while end < min(x + RUN_PX, width) and seen[y, end] == k:
                end += 1
            if k >= 0:
                _shade_run((y, x, end), faces[k], planes[k], surfaces, (gray, depth, shift))
            elif surfaces.sky[0] > 0.0:
                _sky_run((y, x, end), rays, surfaces, (gray, depth, shift))
            else:
                for i in range(x, end):
                    gray[y, i], depth[y, i] = 0.0, np.nan
            x = end
    return gray, depth


@kernel
def shade_some(
    places: tuple[Array, Array], outlines: tuple[Array, Array, Array], surfaces: Surfaces, rays: Array, shift: Pair
) -> Array:
    """Brightness (N,) float32 of pixels: rows, columns (N,) and seen (N,), faces (S,), planes as `shade` has them."""
    rows, columns = places
    seen, faces, planes = outlines
    gray, depth = np.empty((len(rows), 1), np.float32), np.empty((len(rows), 1), np.float32)
    for i in range(len(rows)):
        # A picture of one column, whose row i looks at this pixel.
        out = (gray, depth, (columns[i] + shift[0], rows[i] - i + shift[1]))
        if seen[i] >= 0:
            _shade_run((i, 0, 1), faces[seen[i]], planes[seen[i]], surfaces, out)
        elif surfaces.sky[0] > 0.0:
            _sky_run((i, 0, 1), rays, surfaces, out)
        else:
            gray[i, 0] = 0.0
    return gray[:, 0]


@kernel
def sheet_light(shapes: Shapes, surfaces: Surfaces, faces: Array, points: Array) -> Array:
    """Light (N,) on faces (N,) at points (N, 3) in their body's frame."""
    lights = np.empty(len(faces), np.float32)
    for i in range(len(faces)):
        f, p = faces[i], points[i]
        s, t = shapes.axes[f, 0], shapes.axes[f, 1]
        st = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2], t[0] * p[0] + t[1] * p[1] + t[2] * p[2])
        lights[i] = light_mean(surfaces, f, st, light_reading(f, (0.0, 0.0, 0.0, 0.0), surfaces))
    return lights


@kernel
def shade_rays(rays: Rays, faces: Array, shapes: Shapes, surfaces: Surfaces) -> tuple[Array, Array]:
    """Brightness (N,) float32, 0 to 255, and depth (N,) of the faces (N,) that rays meet; the sky's and NaN for -1.

    Each ray is given in the frame of the body that its face belongs to.
    """
    n = len(faces)
    gray, depth = np.empty(n, np.float32), np.empty(n)
    for i in range(n):
        f = faces[i]
        o, d, a, b = rays.apex[i], rays.direction[i], rays.across[i], rays.down[i]
        if f < 0:
            here, right, below = (d[0], d[1], d[2]), (a[0], a[1], a[2]), (b[0], b[1], b[2])
            gray[i] = sky_brightness(surfaces.sky, (surfaces.levels, surfaces.texels), here, right, below)
            depth[i] = np.nan
            continue
        m = shapes.normals[f]
        slant = m[0] * d[0] + m[1] * d[1] + m[2] * d[2]
        t = (shapes.offsets[f] - (m[0] * o[0] + m[1] * o[1] + m[2] * o[2])) / slant
        ka = (m[0] * a[0] + m[1] * a[1] + m[2] * a[2]) / slant
        kb = (m[0] * b[0] + m[1] * b[1] + m[2] * b[2]) / slant
        s = t2 = s_a = t_a = s_b = t_b = 0.0
        for c in range(3):
            u, v = shapes.axes[f, 0, c], shapes.axes[f, 1, c]
            p, p_a, p_b = o[c] + t * d[c], t * (a[c] - ka * d[c]), t * (b[c] - kb * d[c])
            s, s_a, s_b = s + u * p, s_a + u * p_a, s_b + u * p_b
            t2, t_a, t_b = t2 + v * p, t_a + v * p_a, t_b + v * p_b
        slopes = (s_a, t_a, s_b, t_b)
        look, glow = texture_reading(f, slopes, surfaces), light_reading(f, slopes, surfaces)
        gray[i] = surface_brightness(surfaces, f, (s, t2), look, glow)
        depth[i] = t
    return gray, depth
