"""Numba kernels for pixels and rays: where edges are, where rays go, and how they are mirrored.

A pixel's ray has an apex o and a direction d; t d away from the apex is depth t. One pixel to the right the
direction is d + a, one down d + b. A flat mirror keeps all this: what it shows is seen from a mirrored apex.
"""

import numpy as np

from stereogrid.geometry import Array

from ..kernel import kernel
from .shading import Rays

OFF_M = 1e-3
"""Mirrored rays start so far off the surface."""


@kernel
def pixel_rays(camera: Array, x: Array, y: Array, shift: tuple[float, float]) -> Rays:
    """The rays `shift` beside N pixels (x, y) of a pinhole (4, 3): eye, and the rows of x * row + y * row + row."""
    n = len(x)
    apex, direction, across, down = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        for c in range(3):
            apex[i, c], across[i, c], down[i, c] = camera[0, c], camera[1, c], camera[2, c]
            direction[i, c] = (x[i] + shift[0]) * camera[1, c] + (y[i] + shift[1]) * camera[2, c] + camera[3, c]
    return Rays(apex, direction, across, down)


@kernel
def rays_near(start: Array, direction: Array, ball: Array) -> Array:
    """The places of those rays (N, 3) that meet a ball (4,): middle and radius."""
    found, count = np.empty(len(start), np.int64), 0
    for i in range(len(start)):
        d = direction[i]
        x, y, z = ball[0] - start[i, 0], ball[1] - start[i, 1], ball[2] - start[i, 2]
        along, square = x * d[0] + y * d[1] + z * d[2], d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        far2, radius2 = x * x + y * y + z * z, ball[3] * ball[3]
        if far2 < radius2 or (along > 0.0 and (far2 - radius2) * square < along * along):
            found[count] = i
            count += 1
    return found[:count]


@kernel
def mirror_rays(rays: Rays, normals: Array, offsets: Array, gloss: Array) -> tuple[Rays, Array, Array]:
    """What N rays become at the planes (N, 3), (N,) that they meet, where they start (N, 3), and the share (N,) of
    light that is mirrored: gloss head-on, all of it at grazing angles (Schlick)."""
    n = len(offsets)
    apex, direction, across, down = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    start, share = np.empty((n, 3)), np.empty(n)
    for i in range(n):
        m, o, d, a, b = normals[i], rays.apex[i], rays.direction[i], rays.across[i], rays.down[i]
        height = m[0] * o[0] + m[1] * o[1] + m[2] * o[2] - offsets[i]
        slant = m[0] * d[0] + m[1] * d[1] + m[2] * d[2]
        ma, mb = m[0] * a[0] + m[1] * a[1] + m[2] * a[2], m[0] * b[0] + m[1] * b[1] + m[2] * b[2]
        side = OFF_M if height > 0 else -OFF_M
        for c in range(3):
            apex[i, c], direction[i, c] = o[c] - 2.0 * height * m[c], d[c] - 2.0 * slant * m[c]
            across[i, c], down[i, c] = a[c] - 2.0 * ma * m[c], b[c] - 2.0 * mb * m[c]
            start[i, c] = o[c] - height / slant * d[c] + side * m[c]
        cosine = min(abs(slant) / np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), 1.0)
        share[i] = gloss[i] + (1.0 - gloss[i]) * (1.0 - cosine) ** 5
    return Rays(apex, direction, across, down), start, share


@kernel
def edge_pixels(seen: Array, gray: Array, contrast: float) -> Array:
    """(H, W) bool: pixels that differ from a neighbour in face, and in gray by more than `contrast`."""
    height, width = seen.shape
    edges = np.empty((height, width), np.bool_)
    for y in range(height):
        for x in range(width):
            found = False
            for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                i, j = min(max(y + dy, 0), height - 1), min(max(x + dx, 0), width - 1)
                if seen[i, j] != seen[y, x] and abs(gray[i, j] - gray[y, x]) > contrast:
                    found = True
            edges[y, x] = found
    return edges


@kernel
def pixel_points(depth: Array, rays: Array) -> Array:
    """Points (H W, 3) that a camera with rays (4, 3) sees at depths (H, W), NaN where it sees none."""
    height, width = depth.shape
    points = np.empty((height * width, 3))
    for y in range(height):
        for x in range(width):
            for c in range(3):
                ray = x * rays[1, c] + y * rays[2, c] + rays[3, c]
                points[y * width + x, c] = rays[0, c] + depth[y, x] * ray
    return points
